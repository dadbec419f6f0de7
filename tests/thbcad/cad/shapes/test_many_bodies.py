"""Twenty bodies for moulds, round and rectangular, with cavities and rounded edges: each is a sound solid, or
refused before it is made."""

import numpy as np
import pytest

from tests.thbcad.cad.shapes.cases import assert_whole, rough, same_bits
from thbcad.cad.exchange import SolidState, optical_form, part_step, read_step
from thbcad.cad.shapes import moulded_part
from thbcad.io import brep_of_text, image_distance, volume
from thbcad.lens import FreeformSurface, Lens, Product, optical_forms
from thbcad.moulds import BodyOptions, MouldedBody
from thbcad.sags import Conic

DRAFTS = (0.5, 1.0, 2.0, 3.0, 5.0)  # degrees
RADII = (0.05, 0.1, 0.3, 0.5, 1.0)  # mm
EDGE = 3.0  # mm of wall at the thinnest rim


def lens_of(seed):
    """Return a dome 16 to 40 mm wide, round or a rectangle with rounded corners, over a plane front or a
    cavity, its rear rough."""
    rng = np.random.default_rng(seed)
    half = rng.uniform(8, 20) * np.array([1.0, 1.0 if seed % 2 == 0 else rng.uniform(0.6, 1.0)])
    corners = half if seed % 2 == 0 else np.full(2, rng.uniform(0.25, 0.6) * half.min())
    cavity = seed % 4 > 1
    share = rng.uniform(0.4, 0.6) if cavity else 1.0
    front_radius = -rng.uniform(1.2, 2.5) * share * half.max() if cavity else np.inf
    rear_radius = -rng.uniform(1.5, 4.0) * np.hypot(*half)
    front = FreeformSurface(tuple(share * half), Conic(front_radius, -1.0), None, tuple(share * corners))
    rear = FreeformSurface(tuple(half), Conic(rear_radius, -1.0), rough(), tuple(corners))
    thickness = EDGE + 0.5 * (half @ half) / -rear_radius
    return Lens(front, rear, thickness, 1.5)


def options_of(seed):
    """Return draft, edge radius and land of the body: all pairs of neighbours come together."""
    draft, radius = DRAFTS[seed % 5], RADII[(seed + seed // 5) % 5]
    return BodyOptions(draft, annulus=seed % 4 > 1, edge_radius=radius)


@pytest.mark.parametrize(
    "seed", [s if s in (2, 5) else pytest.param(s, marks=pytest.mark.slow) for s in range(20)]
)
def test_a_body_is_sound_in_its_file(seed, tmp_path):
    """The file is read by OCCT and by its text, whose volume is that of the closed form."""
    lens = lens_of(seed)
    body = MouldedBody.of(lens, options_of(seed))
    part = moulded_part(body)
    assert_whole(SolidState(part.solid), body.face_count)
    for face, form in zip(part.faces, optical_forms(lens)):
        assert same_bits(optical_form(face), form)
    (tmp_path / "body.step").write_bytes(part_step(part, Product()))
    assert_whole(read_step(tmp_path / "body.step"), body.face_count)
    text = brep_of_text((tmp_path / "body.step").read_text("ascii"))
    assert image_distance(text)[0] <= 1e-8  # mm
    assert volume(text) == pytest.approx(body.volume(), rel=1e-9)
