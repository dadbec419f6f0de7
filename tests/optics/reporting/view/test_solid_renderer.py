"""The faces of lenses with an outline: on it, joined without a gap, and shaded from outside."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from optics.reporting.view import solid_faces
from tests.optics.cases import hollow_lens, small_lens
from thbcad.lens import FreeformSurface, Lens
from thbcad.moulds import BodyOptions, MouldedBody, Plate
from thbcad.sags import Conic

LENSES = {"round": (small_lens(), 1.0), "rounded": (small_lens(), 0.3), "round, unlike": (hollow_lens(), 1.0)}


@pytest.fixture(params=LENSES)
def lens(request):
    made, share = LENSES[request.param]
    front, rear = (
        replace(s, corners=tuple(share * h for h in s.half_width)) for s in (made.front, made.rear)
    )
    return Lens(front, rear, made.thickness, made.index)


def test_rims_lie_on_the_outline_and_the_edge_joins_them(lens):
    (front, rear, edge), _ = solid_faces(lens, 41)
    for face, surface, vertex, column in ((front, lens.front, 0.0, 0), (rear, lens.rear, lens.thickness, -1)):
        x, y, z = face.points
        assert np.allclose(z, vertex + surface(x, y), rtol=0, atol=1e-12)
        rim = surface.outline.gauge(*edge.points[:2, :, column])
        assert np.allclose(rim, 1, rtol=0, atol=1e-12)
        assert surface.outline.gauge(x, y).max() == pytest.approx(1, abs=1e-12)
        there = {tuple(p) for p in np.round(face.points.reshape(3, -1).T, 9)}
        assert all(tuple(p) in there for p in np.round(edge.points[:, :, column].T, 9))


def test_edges_go_once_round_and_are_seen_from_outside(lens):
    edge = solid_faces(lens, 41)[0][2]
    x, y, _ = edge.points[:, :, 0]
    turned = np.unwrap(np.arctan2(y, x))
    assert turned[-1] - turned[0] == pytest.approx(2 * np.pi)
    assert (np.diff(turned) > -1e-12).all()
    outward = (edge.normals[:2] * edge.points[:2]).sum(axis=0)
    wide = lens.rear.half_width[0] - lens.front.half_width[0]
    assert (outward > 0).all() or wide > 0  # a wall that opens to the rear looks to the front
    if wide > 0:
        assert (edge.normals[2] < 0).all()


@pytest.mark.parametrize("share", [1.0, 0.3])
def test_a_body_is_closed_by_its_walls_and_its_land(share):
    """From the front: the step to the land, the land, the wall to the parting line and that to the rear; each
    ends where the next begins, and on the wall of the body, within the thousandth of a mm of a picture."""
    front, rear = (
        FreeformSurface((h, h), Conic(r, -1.0), None, (share * h, share * h)) for h, r in ((4, -20), (9, -30))
    )
    lens = Lens(front, rear, 6.0, 1.5)
    body = MouldedBody.of(lens, BodyOptions(draft=3.0, annulus=True, land=-1.5, parting=0.5))
    faces, _ = solid_faces(body, 41)
    rings = [face.points[:, :, [0, -1]] for face in faces[2:]]
    for ring, following in pairwise(rings):
        assert (ring[:, :, 1] == following[:, :, 0]).all()
    for wall, ring in zip((body.inner, None, *body.walls), rings, strict=True):
        if wall is not None:
            assert abs(wall.beside(*ring)).max() < 1e-3
    for k, column, ring in ((0, 0, rings[0]), (1, 1, rings[-1])):
        x, y, z = ring[:, :, column]
        assert np.allclose(z, k * lens.thickness + (lens.front, lens.rear)[k](x, y), rtol=0, atol=1e-9)


def test_the_land_of_a_plate_leaves_its_lenses_free():
    """So that a hollow front shows its own ground; at the lenses' borders the land begins."""
    lens = hollow_lens()
    plate = Plate.of(lens, (2, 1), (24.0, 24.0))
    hx, hy = min(lens.front.half_width, lens.rear.half_width)
    faces, _ = solid_faces(plate, 82)
    for face in faces[-6:-4]:
        for x, y in plate.places:
            away = np.maximum(np.abs(face.points[0] - x) / hx, np.abs(face.points[1] - y) / hy)
            assert away.min() == pytest.approx(1, abs=1e-12)
