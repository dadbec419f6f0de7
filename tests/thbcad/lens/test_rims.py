"""Sides, rims and ruled edges of a lens."""

import numpy as np
import pytest

from thbcad.hierarchy import THBSpace
from thbcad.lens.freeform_surface import FreeformSurface
from thbcad.lens.lens import Lens
from thbcad.lens.rims import (
    CORNERS,
    SIDES,
    placed_surfaces,
    rim,
    rim_indices,
    rim_parameter,
    ruled_edge,
    ruled_edges,
)
from thbcad.sags import Conic
from thbcad.splines import KnotVector
from thbcad.surfaces import THBSurface

T = np.linspace(0, 1, 7)


def uneven_lens():
    """A rough front of 5 mm x 4 mm, a hollow rear of 7 mm x 6 mm."""
    space = THBSpace(KnotVector.uniform(3, 4), KnotVector.uniform(2, 5, -1, 2))
    sag = THBSurface(space, 0.2 * np.sin(np.arange(space.dim)))
    return Lens(FreeformSurface((5, 4), Conic(), sag), FreeformSurface((7, 6), Conic(-40.0, -1.0)), 9.0, 1.5)


LENS = uneven_lens()
SURFACES = placed_surfaces(LENS)


def test_placed_surfaces_are_the_graphs_of_the_lens():
    for surface, freeform, vertex in zip(SURFACES, (LENS.front, LENS.rear), (0.0, 9.0)):
        points = surface.grid(*(kv.start + (kv.stop - kv.start) * T for kv in (surface.kv_u, surface.kv_v)))
        x, y = (h * (2 * T - 1) for h in freeform.half_width)
        assert points[..., 0] == pytest.approx(np.broadcast_to(x[:, None], (7, 7)), abs=1e-14)
        assert points[..., 1] == pytest.approx(np.broadcast_to(y[None, :], (7, 7)), abs=1e-14)
        assert points[..., 2] == pytest.approx(vertex + freeform.grid(x, y), abs=1e-13)


def test_sides_run_counter_clockwise_from_corner_to_corner():
    for k, side in enumerate(SIDES):
        ends = (side.stop, side.start) if side.clockwise else (side.start, side.stop)
        assert ends == (CORNERS[k], CORNERS[(k + 1) % 4])


@pytest.mark.parametrize("side", SIDES, ids=lambda side: side.name)
def test_a_rim_lies_on_the_side_that_its_name_tells(side):
    sign, letter = side.name[-2:]
    across = "xy".index(letter)
    assert across == 1 - side.axis
    for surface, freeform in zip(SURFACES, (LENS.front, LENS.rear)):
        kv, poles = rim(surface, side)
        assert (poles[:, across] == float(f"{sign}1") * freeform.half_width[across]).all()
        assert (np.diff(poles[:, side.axis]) > 0).all()
        assert poles[[0, -1]].tolist() == [surface.coefficients[c].tolist() for c in (side.start, side.stop)]
        parameters = [rim_parameter(surface, side)], kv.start + (kv.stop - kv.start) * T
        points = surface.grid(*(parameters if across == 0 else parameters[::-1])).reshape(-1, 3)
        assert points == pytest.approx(kv.collocation(parameters[1]) @ poles, abs=1e-13)


@pytest.mark.parametrize("side", SIDES, ids=lambda side: side.name)
def test_a_ruled_edge_joins_points_of_equal_relative_position(side):
    edge = ruled_edge(SURFACES, side)
    u = edge.kv_u.start + (edge.kv_u.stop - edge.kv_u.start) * T
    front, rear = (kv.collocation(u) @ poles for kv, poles in (rim(s, side) for s in SURFACES))
    for v in (0.0, 0.3, 1.0):
        assert edge.grid(u, [v])[:, 0] == pytest.approx((1 - v) * front + v * rear, abs=1e-13)
    same = ruled_edges(LENS)[SIDES.index(side)]
    assert same.coefficients.tobytes() == edge.coefficients.tobytes()


def test_rim_indices_go_round_once_counter_clockwise():
    x, y = (a.ravel() for a in np.meshgrid(np.arange(4), np.arange(3), indexing="ij"))
    ring = rim_indices(4, 3)
    assert sorted(ring) == [k for k in range(12) if x[k] in (0, 3) or y[k] in (0, 2)]
    turn = np.roll(ring, -1)
    assert (abs(x[turn] - x[ring]) + abs(y[turn] - y[ring]) == 1).all()
    assert float((x[ring] * y[turn] - x[turn] * y[ring]).sum()) / 2 == 6.0
