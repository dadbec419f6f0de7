"""The picture of a lens: sections to scale, and its numbers."""

import re
from xml.etree import ElementTree

import numpy as np
import pytest

from tests.thbcad.lens.cases import flat_sag, plano
from thbcad.lens.freeform_surface import FreeformSurface
from thbcad.lens.lens import POINTS, Lens
from thbcad.sags import Conic

BOWL = FreeformSurface((10.0, 6.0), Conic(40.0, -1.0), flat_sag(0.25))


def sections(html):
    """Return the outlines of the two sections, (2 POINTS, 2) in pixels each."""
    page = ElementTree.fromstring(html)
    paths = [e.attrib["d"] for e in page.iter() if e.tag.endswith("path")]
    return [np.array(re.findall(r"[ML]([-\d.]+) ([-\d.]+)", path), float) for path in paths]


def test_sections_are_to_scale():
    """Front and rear of equal size: 20 mm by 12 mm; 0.1 pixel of rounding in about 200."""
    along_x, along_y = sections(plano(BOWL, 5.0)._repr_html_())
    tall, low = np.ptp(along_x, axis=0), np.ptp(along_y, axis=0)
    assert len(along_x) == 2 * POINTS
    assert tall[1] / low[1] == pytest.approx(20 / 12, rel=2e-3)
    # the rear is farthest at its rim, z = 5 + 0.25 + r^2 / 80
    assert tall[0] / tall[1] == pytest.approx((5.25 + 100 / 80) / 20, rel=5e-3)
    assert low[0] / tall[1] == pytest.approx((5.25 + 36 / 80) / 20, rel=5e-3)


def test_a_section_runs_along_the_front_and_back_along_the_rear():
    front = FreeformSurface((8.0, 6.0))
    (line, _) = sections(Lens(front, BOWL, 5.0, 1.5)._repr_html_())
    assert np.ptp(line[:POINTS, 0]) == 0
    assert np.ptp(line[:POINTS, 1]) / np.ptp(line[POINTS:, 1]) == pytest.approx(8 / 10, rel=2e-3)
    assert (line[POINTS:, 0] > line[0, 0]).all()


def test_the_numbers_of_a_lens_stand_beside_it():
    lens = plano(BOWL, 5.0)
    html = lens._repr_html_()
    texts = ("1.5", "5 mm, 5.25 mm in the middle", "20 x 12 mm", lens.sags[0].space.dim)
    for text in (*texts, f"{lens.volume():.6g} mm^3"):
        assert f">{text}<" in html
    assert len(html.encode()) <= 40_000


@pytest.mark.parametrize(
    "rear",
    [
        FreeformSurface((10.0, 6.0), Conic(40.0, -0.5)),
        FreeformSurface((10.0, 6.0), Conic(), flat_sag(degree=1)),
    ],
    ids=["sphere-like", "degree 1"],
)
def test_a_volume_that_takes_long_or_is_none_is_left_out(rear):
    assert "volume" not in plano(rear)._repr_html_()


@pytest.mark.parametrize("thickness", [1e-3, 5.0, 1e4])
def test_thin_and_thick_lenses_have_their_picture(thickness):
    html = plano(FreeformSurface((10.0, 6.0)), thickness)._repr_html_()
    assert all(np.isfinite(line).all() for line in sections(html))
    assert max(np.ptp(line, axis=0).max() for line in sections(html)) <= 300


def test_a_surface_shows_its_sag_and_without_one_its_height():
    html = BOWL._repr_html_()
    for text in ("20 x 12 mm", "40 mm", "0.25 to 0.25 mm", "3 x 3"):
        assert f">{text}<" in html
    bare = FreeformSurface((10.0, 6.0), Conic(-40.0, -1.0))._repr_html_()
    assert ">-1.7 to 0 mm<" in bare
    assert "plane" in FreeformSurface((10.0, 6.0))._repr_html_()


@pytest.mark.parametrize("sag", [None, flat_sag(0.25)])
def test_a_surface_with_an_outline_shows_what_lies_within(sag):
    """z = -r^2 / 80 down to the rim of the disk, not to the corners of the square; white covers the rest."""
    html = FreeformSurface((10.0, 10.0), Conic(-40.0, -1.0), sag, (10.0, 10.0))._repr_html_()
    assert ("0.25 to 0.25 mm" if sag else "-1.25 to 0 mm") in html
    cover = next(e for e in ElementTree.fromstring(html).iter() if e.get("fill-rule") == "evenodd")
    points = np.array(re.findall(r"[ML]([-\d.]+) ([-\d.]+)", cover.attrib["d"]), float)
    size = points[2]
    assert np.hypot(*(2 * points[4:] / size - 1).T) == pytest.approx(1, abs=1e-3)
    assert "fill-rule" not in BOWL._repr_html_()
