"""The faces of lenses with an outline: on it, joined without a gap, and shaded from outside."""

from dataclasses import replace

import numpy as np
import pytest

from optics.reporting.view import solid_faces
from tests.optics.cases import hollow_lens, small_lens
from thbcad.lens import Lens

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
