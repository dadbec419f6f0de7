"""Graphs that are cut to a rectangle round the axis: the same heights, as far as the graph goes."""

import re

import build123d as bd
import numpy as np
import pytest
from hypothesis import given, strategies as st

from oracles.spline_definitions import gamma
from tests.thbcad.cases import EPS, seeds
from thbcad import read_lens_solid, to_build123d
from thbcad.cad import write_step
from thbcad.cad.foreign.upright_graphs import CENTRED, SLIVER, centred
from thbcad.hierarchy import THBSpace
from thbcad.lens import FreeformSurface, Lens
from thbcad.sags import Conic
from thbcad.splines import BSplineSurface, KnotVector
from thbcad.surfaces import THBSurface

LENGTHS = st.floats(1.0, 20.0)


def graph_over(x, y, rng):
    """A graph of degree 3 with random coefficients over two intervals."""
    kv_u, kv_v = (KnotVector.uniform(3, 4, *interval) for interval in (x, y))
    return BSplineSurface(kv_u, kv_v, rng.uniform(-1, 1, (7, 7)))


@given(*[LENGTHS] * 4, st.tuples(LENGTHS, LENGTHS), seeds())
def test_a_cut_graph_has_the_same_heights(left, right, low, high, own, rng):
    """It is as large as the face, and None where it covers no face."""
    graph = graph_over((-left, right), (-low, high), rng)
    cut = centred(graph, np.array(own))
    most = np.array([min(left, right), min(low, high)])
    if (most < np.array(own) * (1 - SLIVER) - CENTRED).any():
        assert cut is None
        return
    half = np.array([cut.kv_u.stop, cut.kv_v.stop])
    assert [cut.kv_u.start, cut.kv_v.start] == (-half).tolist()
    assert (half <= most).all()
    assert (half >= np.minimum(own, most) * (1 - SLIVER)).all()
    x, y = (np.linspace(-h, h, 9) for h in half)
    # 5 roundings per degree of a basis function and 4 of each sum, in x and in y: of the cut and of both
    # values; slopes are at most 2 * 3 / 0.5 per mm, and the spacing of x and y is 20 EPS: the rest
    assert np.abs(cut.grid(x, y) - graph.grid(x, y)).max() <= 3 * float(gamma(40)) + 1e3 * EPS


@pytest.mark.parametrize("apart", [1e-15, -1e-12, 1e-9, -1e-9])
def test_a_cut_leaves_no_sliver(apart):
    """The knots are 2 mm apart, and one of them opposite the nearer end but for rounding."""
    kv_u, kv_v = KnotVector.uniform(3, 11, -10 + apart, 12 + apart), KnotVector.uniform(3, 10, -10, 10)
    graph = BSplineSurface(kv_u, kv_v, np.zeros((14, 13)))
    cut = centred(graph, np.array([10.0, 10.0]))
    assert cut.kv_u.spans == 10
    assert np.diff(cut.kv_u.breaks).min() > 1
    assert cut.kv_u.stop == pytest.approx(10, abs=2e-9)


def lens_of(size, conic):
    kv = KnotVector.uniform(3, 2)
    space = THBSpace(kv, kv)
    rear = FreeformSurface(size, conic, THBSurface(space, np.zeros(space.dim)))
    return Lens(FreeformSurface((11, 10)), rear, 6.0, 1.5)


def furthest(found, lens, refit, shift):
    """The greatest distance in z of the refitted rear from a lens's that was shifted along x, mm."""
    x, y = (np.linspace(-h, h, 9) for h in refit.lens.rear.half_width)
    origin = found.frame.shift
    inside = abs(x + origin[0] - shift) <= lens.rear.half_width[0]
    got = origin[2] + refit.lens.thickness + refit.lens.rear.grid(x[inside], y)
    return abs(got - lens.thickness - lens.rear.grid(x[inside] + origin[0] - shift, y + origin[1])).max()


def test_a_round_lens_cut_off_centre_is_as_near_as_is_proven(tmp_path):
    lens = lens_of((11.0, 10.0), Conic(60.0, -1.0))
    bd.export_step(
        to_build123d(lens) & (bd.Pos(1.0, 0.0, 0.0) * bd.Cylinder(8.0, 60.0)), tmp_path / "lens.step"
    )
    found = read_lens_solid(tmp_path / "lens.step")
    refit = found.refit(1.5)
    assert refit.how[1] == "spline as it is"
    assert refit.proven[1]
    assert refit.lens.rear.outline.is_circle
    assert refit.lens.rear.half_width == pytest.approx((8, 8), abs=1e-6)
    assert furthest(found, lens, refit, 0.0) <= refit.deviation[1] < 1e-12


def test_a_rear_off_the_axis_is_as_near_as_is_proven(tmp_path):
    shift = 9e-7
    lens = lens_of((9.0, 7.0), Conic(12.0, -1.0))
    write_step(lens, tmp_path / "lens.step")

    def moved(match):
        x, y, z = (float(text) for text in match[1].split(","))
        return f"CARTESIAN_POINT('',({x + shift * (z > 2):.16E},{y:.16E},{z:.16E}))"

    text = (tmp_path / "lens.step").read_text()
    point = r"CARTESIAN_POINT\('',\(([^,()]+,[^,()]+,[^,()]+)\)\)"
    (tmp_path / "lens.step").write_text(re.sub(point, moved, text))
    found = read_lens_solid(tmp_path / "lens.step")
    refit = found.refit(1.5)
    assert found.rear.centre[0] == pytest.approx(shift, rel=1e-6)
    assert (refit.how[1], refit.proven[1]) == ("spline as it is", True)
    assert furthest(found, lens, refit, shift) <= refit.deviation[1] < 1e-12
