"""THB spaces against stored values on which independent codes agree."""

import json

import numpy as np
import pytest

from tests.cases import DATA
from tests.thbcad.hierarchy.cases import ORDERS, dof_per_level, refined_by, uniform_space
from thbcad.hierarchy.thb_space import THBSpace
from thbcad.splines import KnotVector
from thbcad.surfaces import THBSurface

ANNULUS = json.loads((DATA / "thb_annulus.json").read_text())
RANDOM = json.loads((DATA / "thb_random.json").read_text())
NONUNIFORM = json.loads((DATA / "thb_nonuniform.json").read_text())


def oracle_coefficients(space):
    level, i, j = space.functions.T
    return np.sin(1.3 * i + 2.1 * j + 0.7 * level) + 0.3 * np.cos(0.37 * i * j + level)


def test_annulus_counts_after_each_step():
    space = uniform_space(3, 7)
    assert (space.dim, dof_per_level(space)) == (100, [100])
    for level, cells in enumerate(ANNULUS["marked"]):
        space = space.refine({level: cells})
        assert space.dim == len(space.functions) == ANNULUS["dof_after_step"][level + 1]
        assert dof_per_level(space) == ANNULUS["dof_per_level_after_step"][level + 1]
    want = [(level, i, j) for level, pairs in enumerate(ANNULUS["active_functions"]) for i, j in pairs]
    assert [tuple(f) for f in space.functions.tolist()] == want


def test_annulus_values():
    space = refined_by(uniform_space(3, 7), ANNULUS["marked"])
    u, v = np.array(ANNULUS["points"]).T
    c = oracle_coefficients(space)
    for order, name, tolerance in zip(ORDERS, ("value", "dx", "dy"), (1e-12, 1e-9, 1e-9)):
        assert abs(space.collocation(u, v, order) @ c - ANNULUS[name]).max() <= tolerance


@pytest.mark.parametrize("case", RANDOM, ids=lambda c: f"seed{c['seed']}-degree{c['p']}-{c['mode']}")
def test_random_oracle(case):
    space = refined_by(uniform_space(case["p"], case["n0"], case["n0"]), case["marked"])
    assert space.dim == case["dof"]
    assert dof_per_level(space) == case["dof_per_level"]
    check_oracle_values(space, case)


@pytest.mark.parametrize("case", NONUNIFORM, ids=lambda c: f"seed{c['seed']}")
def test_nonuniform_oracle(case):
    kvs = (KnotVector(case["p"], case[name]) for name in ("knots_x", "knots_y"))
    space = refined_by(THBSpace(*kvs), case["marked"])
    assert space.dim == case["dof"]
    assert space.functions.tolist() == case["active"]
    check_oracle_values(space, case)


def check_oracle_values(space, case):
    """Relative to the largest value, as the oracles' README states."""
    u, v = np.array(case["points"]).T
    c = oracle_coefficients(space)
    surface = THBSurface(space, c)
    for order, name, tolerance in zip(ORDERS, ("value", "dx", "dy"), (1e-14, 1e-12, 1e-12)):
        want = np.array(case[name])
        assert abs(space.collocation(u, v, order) @ c - want).max() <= tolerance * abs(want).max()
        assert abs(surface(u, v, order) - want).max() <= tolerance * abs(want).max()
