"""The picture of the solid: outlines to scale, relief that is seen, sides that are not mixed up."""

from functools import cache

import numpy as np
import pytest
from matplotlib import pyplot as plt

from optics.reporting.figures.scene_figure import solid_views
from tests.optics.reporting.cases import pixels
from thbcad.hierarchy import THBSpace
from thbcad.lens import FreeformSurface, Lens
from thbcad.sags import Conic
from thbcad.splines import KnotVector
from thbcad.surfaces import THBSurface

PANELS = {
    "rear": np.s_[30:440, :460],
    "side": np.s_[30:440, 462:],
    "front": np.s_[480:880, :460],
    "oblique": np.s_[480:880, 462:],
}


def rippled(height, radius=np.inf, where=(-1, 1)):
    """Return a surface with ripples of some height, mm, for x / half-width between the numbers `where`."""
    kv = KnotVector.uniform(3, 24)
    u, v = (a.ravel() for a in np.meshgrid(kv.greville(), kv.greville(), indexing="ij"))
    inside = (where[0] <= 2 * u - 1) & (2 * u - 1 <= where[1])
    sag = height / 2 * inside * np.sin(40 * u) * np.sin(40 * v)
    return FreeformSurface((50.0, 50.0), Conic(radius, -1.0), THBSurface(THBSpace(kv, kv), sag))


def lens(front=None, rear=None, thickness=12.0):
    plane = FreeformSurface((50.0, 50.0))
    return Lens(front or plane, rear or plane, thickness, 1.5)


def picture(solid):
    """Return the pixels of the picture, (rows, columns, 3) float, 0 to 255."""
    return pixels(solid_views(solid))


def glass(seen):
    """Return what is bluish: faces, and neither ink nor paper."""
    return seen[..., 2] > seen[..., 0] + 5


def box(mask):
    """Return (width, height) of the outline of a mask, in pixels."""
    rows, columns = np.nonzero(mask.any(axis=1))[0], np.nonzero(mask.any(axis=0))[0]
    return np.ptp(columns) + 1, np.ptp(rows) + 1


@pytest.mark.slow
def test_the_same_lens_gives_the_same_picture_and_no_figure_stays_open():
    solid = lens(rear=rippled(0.05, 150.0))
    png = solid_views(solid)
    assert png.startswith(b"\x89PNG")
    assert solid_views(solid) == png
    assert plt.get_fignums() == []


@pytest.mark.slow
def test_a_sag_of_zeros_is_drawn_as_none():
    """What is left of the slopes of a paraboloid is rounding, and no relief to be shaded."""
    none, zeros = (
        lens(rear=rear) for rear in (FreeformSurface((50.0, 50.0), Conic(150.0, -1.0)), rippled(0.0, 150.0))
    )
    assert solid_views(none) == solid_views(zeros)


@pytest.mark.slow
def test_ripples_of_a_twentieth_of_a_millimetre_are_seen_on_100_mm():
    """They change grey levels by 10 and more, where eyes tell 2 apart; the view from the front stays as it
    was."""
    before, after = (picture(lens(rear=rippled(height, 150.0))).mean(axis=2) for height in (0.0, 0.05))
    change = (after - before)[PANELS["rear"]][100:300, 120:320]
    assert change.std() > 10
    assert np.array_equal(before[PANELS["front"]], after[PANELS["front"]])


@pytest.mark.slow
@pytest.mark.parametrize(("face", "panel", "side"), [("rear", "rear", 1), ("front", "front", -1)])
def test_relief_is_drawn_where_it_is(face, panel, side):
    """Ripples between 0.3 and 1 of high x lie at the right in the view from the rear, and at the left in that
    from the front."""
    flat, other = (picture(lens(**{face: rippled(h, where=(0.3, 1))})) for h in (0.0, 0.05))
    change = np.abs(other - flat)[PANELS[panel]].sum(axis=(0, 2))
    columns = np.nonzero(glass(flat[PANELS[panel]]).any(axis=0))[0]
    x = 2 * (np.arange(change.size) - columns[0]) / np.ptp(columns) - 1
    assert side * np.sum(x * change) / change.sum() > 0.3


SIZES = {
    "oblong": lens(FreeformSurface((40.0, 30.0)), FreeformSurface((40.0, 30.0), Conic(-90.0, -1.0)), 25.0),
    "wider rear": lens(FreeformSurface((20.0, 30.0)), FreeformSurface((40.0, 30.0), Conic(80.0, -1.0)), 25.0),
    "wider front": lens(
        FreeformSurface((40.0, 30.0), Conic(-80.0, -1.0)), FreeformSurface((20.0, 25.0)), 25.0
    ),
    "steep rim": lens(
        rear=rippled(80.0, where=(0.8, 1)), thickness=60.0
    ),  # samples at equal steps of x leave gaps there
    "steep": lens(FreeformSurface((10.0, 10.0)), FreeformSurface((10.0, 10.0), Conic(-3.0, -1.0)), 40.0),
}


@cache
def picture_of(name):
    """Return the picture of a lens of SIZES, drawn once."""
    return picture(SIZES[name])


@pytest.mark.slow
@pytest.mark.parametrize("name", SIZES)
def test_outlines_have_the_proportions_of_the_lens(name):
    """Width, height and depth of the three outlines at one scale, to the two pixels that lines of ink take at
    each side."""
    solid = SIZES[name]
    pixels = picture_of(name)
    width, height = (2 * max(pair) for pair in zip(solid.front.half_width, solid.rear.half_width))
    ends = []
    for surface, vertex in ((solid.front, 0.0), (solid.rear, solid.thickness)):
        z = vertex + surface.grid(*(np.linspace(-h, h, 101) for h in surface.half_width))
        ends += [z.min(), z.max()]
    depth = max(ends) - min(ends)
    found = {panel: box(glass(pixels[PANELS[panel]])) for panel in ("rear", "side", "front")}
    scale = found["rear"][1] / height
    assert found["rear"] == pytest.approx((scale * width, scale * height), abs=4)
    assert found["front"] == pytest.approx((scale * width, scale * height), abs=4)
    assert found["side"] == pytest.approx((scale * depth, scale * height), abs=4)


@pytest.mark.every(6)
@pytest.mark.parametrize("name", SIZES)
def test_no_paper_shines_through(name):
    """In every row of the three outlines each pixel between the first and the last of the solid is drawn."""
    pixels = picture_of(name)
    for panel in ("rear", "side", "front"):
        view = pixels[PANELS[panel]]
        rows = glass(view).any(axis=1)
        for white, drawn in zip((view[rows] > 250).all(axis=2), glass(view[rows])):
            first, last = np.nonzero(drawn)[0][[0, -1]]
            assert not white[first:last].any()


def test_long_words_under_the_picture_keep_within_it():
    corners = [FreeformSurface((a, b), corners=(a / 4.4, b / 4.8)) for a, b in ((20.0, 22.0), (22.0, 24.0))]
    under = picture(lens(*corners, thickness=6.0))[890:].min(axis=(0, 2))
    assert under.min() < 100
    assert min(under[:5].min(), under[-5:].min()) > 250
