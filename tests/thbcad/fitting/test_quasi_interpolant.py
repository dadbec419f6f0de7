"""Levels, leaf cells and the hierarchical quasi-interpolant."""

import numpy as np
import pytest
from hypothesis import given

from oracles.spline_definitions import gamma
from tests.thbcad.cases import seeds, spaces
from tests.thbcad.fitting.cases import refined, tensor
from thbcad.fitting.quasi_interpolant import quasi_interpolate, quasi_interpolation
from thbcad.hierarchy import THBSpace
from thbcad.splines import KnotVector
from thbcad.surfaces import THBSurface

EPS = np.finfo(float).eps


def corner(degree, levels):
    """Cells around (1/3, 2/3) refined again and again."""
    space = tensor(degree, 6)
    for level in range(levels):
        middle = (np.array([6, 12]) << level) // 3
        cells = space.cells[space.cells[:, 0] == level, 1:]
        space = space.refine({level: cells[abs(cells - middle).max(axis=1) <= (degree + 1) // 2]})
    return space


# ---- quasi-interpolation ----


def assert_projector(space):
    """Q A = identity, up to the rounding of each functional: its norm times the roundings of the 2 p + 1
    equations of either direction and of the basis."""
    u, v, q = quasi_interpolation(space)
    defect = q @ space.collocation(u, v)
    defect.setdiag(defect.diagonal() - 1)
    norms = abs(q).sum(axis=1)
    sizes = [(2 * kv.degree + 1) ** 2 for kv in (space.kv_u, space.kv_v)]
    assert (abs(defect).max(axis=1).toarray().ravel() <= float(gamma(2 * sum(sizes))) * norms).all()
    return norms


@given(spaces(max_degree=5, max_spans=4))
def test_quasi_interpolation_is_a_projector(space):
    assert_projector(space)


@pytest.mark.slow
@pytest.mark.parametrize("degree", [2, 7])
def test_quasi_interpolation_is_a_projector_on_level_10(degree):
    assert_projector(corner(degree, 10))


@pytest.mark.slow
def test_quasi_interpolation_of_degree_10_is_as_stable_as_wide_supports_allow():
    """Samples in a single cell would give norms of 10^17: no digit left."""
    assert assert_projector(tensor(10, 12)).max() < 1e5
    assert assert_projector(tensor(3, 12)).max() < 4.4**2


@given(spaces(max_degree=3, max_spans=4), seeds())
def test_quasi_interpolation_gives_splines_of_the_space_back(space, rng):
    surface = THBSurface(space, rng.uniform(-1, 1, (space.dim, 2)))
    found = quasi_interpolate(space, surface)
    norms = abs(quasi_interpolation(space)[2]).sum(axis=1)
    assert (
        abs(found.coefficients - surface.coefficients).max(axis=1) <= 500 * EPS * norms
    ).all()  # as above, 2 * 2 * 7^2 roundings at most


def test_quasi_interpolation_samples_only_leaf_cells_of_the_level():
    """Values in the refined block do not touch the functions of level 0: a local projector onto what is
    left."""
    space = refined(3, 8, 5)
    u, v, q = quasi_interpolation(space)
    coarse = q[(space.functions[:, 0] == 0).nonzero()[0]]
    inside = (u < 5 / 8) & (v < 5 / 8)
    assert abs(coarse[:, inside.nonzero()[0]]).sum() == 0
    assert abs(coarse[:, (~inside).nonzero()[0]]).sum() > 0


def test_functionals_that_leave_no_digits_are_refused():
    outer = [-50, -40, -30, -20, -10, 0, 0.01, 10, 20, 30, 40, 50]
    space = THBSpace(KnotVector(5, outer), KnotVector.uniform(5, 4)).refine({0: [(0, 0)]})
    with pytest.raises(ValueError, match="fewer than four digits of float64; use least_squares"):
        quasi_interpolate(space, lambda u, v: np.ones(len(u)))
