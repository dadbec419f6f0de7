"""Bounds of the distance between splines hold at every point and are near the greatest value met."""

import numpy as np
import pytest
from hypothesis import given

from tests.cases import examples
from tests.thbcad.cases import seeds, spaces
from thbcad.certified import distance_bounds
from thbcad.hierarchy import THBSpace
from thbcad.splines import BSplineSurface, KnotVector
from thbcad.surfaces import THBSurface

SHARES = np.linspace(0, 1, 101)


def spline(rng, p, q, shape=(), start=0.0, stop=1.0):
    kv_u, kv_v = KnotVector.uniform(p, 5, start, stop), KnotVector.uniform(q, 3, start, stop)
    return BSplineSurface(kv_u, kv_v, rng.uniform(-1, 1, (kv_u.dim, kv_v.dim, *shape)))


@given(spaces(max_degree=4, max_spans=4), seeds())
@examples(20)
def test_no_point_is_farther_than_the_bound_of_its_cell(space, rng):
    surface = THBSurface(space, rng.uniform(-1, 1, (space.dim, 2)))
    (a, b), (c, d) = ((kv.start, kv.stop) for kv in (space.kv_u, space.kv_v))
    kv_u, kv_v = KnotVector.uniform(2, 3, a - 1, b + 1), KnotVector.uniform(5, 2, c, d)
    other = BSplineSurface(kv_u, kv_v, rng.uniform(-1, 1, (kv_u.dim, kv_v.dim, 2)))
    points, bounds = distance_bounds(surface, other, 0.0)
    here = np.linalg.norm(surface(*points) - other(*points), axis=1)
    assert (here <= bounds).all()
    u, v = a + (b - a) * SHARES, c + (d - c) * SHARES
    most = np.linalg.norm(surface.grid(u, v) - other.grid(u, v), axis=2).max()
    assert most <= bounds.max()
    # three quarterings leave 1/64 of what coefficients exceed values by; the grid misses little
    assert bounds.max() <= 1.25 * most


@pytest.mark.parametrize("shape", [(), (3,)])
def test_one_spline_in_two_forms_has_no_distance_but_rounding(shape):
    rng = np.random.default_rng(0)
    surface = spline(rng, 3, 2, shape)
    finer = surface.insert([0.1, 0.5, 0.5], [0.7]).elevated((4, 4))
    _, bounds = distance_bounds(surface, finer, 1e-3)
    assert 0 < bounds.max() < 1e-12  # eight steps of 80 roundings of numbers below 1


def test_a_bound_above_what_is_enough_is_improved_until_a_value_is_above_it_too():
    space = THBSpace(KnotVector.uniform(3, 1), KnotVector.uniform(3, 1))
    wave = np.zeros((4, 4))
    wave[1], wave[2] = 1, -1  # values to 0.29, coefficients to 1
    surface, flat = THBSurface(space, wave.ravel()), THBSurface(space, np.zeros(16))
    assert distance_bounds(surface, flat, 1.5)[1].tolist() == pytest.approx([1.0])
    assert distance_bounds(surface, flat, 0.3)[1].max() <= 0.3
    assert distance_bounds(surface, flat, 0.28)[1].max() >= 0.2886  # 1 / (2 sqrt 3)


def test_splines_that_cannot_be_compared_are_refused():
    rng = np.random.default_rng(0)
    with pytest.raises(ValueError, match="splines of one dimension"):
        distance_bounds(spline(rng, 3, 3), spline(rng, 3, 3, (2,)), 1.0)
    with pytest.raises(ValueError, match="a segment needs"):
        distance_bounds(spline(rng, 3, 3), spline(rng, 3, 3, start=0.1), 1.0)
