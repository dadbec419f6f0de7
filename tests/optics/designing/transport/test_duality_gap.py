"""The cost of plans that fit, and the gap of transport maps, against linear programming."""

import numpy as np
import pytest
from scipy.optimize import linprog

from optics.designing.transport import transport_map
from optics.designing.transport.back_and_forth import DualProblem
from optics.designing.transport.duality_gap import plan_cost


def least_cost(f, g, spacing):
    """Return the least mean of |x - y|^2 / 2 of all plans between f and g, by linear programming."""
    x, y = np.meshgrid(*(h * np.arange(n) for h, n in zip(spacing, f.shape, strict=True)), indexing="ij")
    places = np.stack([x.ravel(), y.ravel()], axis=1)
    cost = ((places[:, None] - places[None]) ** 2).sum(axis=2) / 2
    n = f.size
    rows = np.kron(np.eye(n), np.ones(n)), np.kron(np.ones(n), np.eye(n))
    found = linprog(cost.ravel(), A_eq=np.vstack(rows), b_eq=np.concatenate([f.ravel(), g.ravel()]))
    return found.fun / n


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("shape", [(6, 6), (5, 7)])
def test_any_potential_and_its_plan_enclose_the_least_cost(backend, seed, shape):
    """Whatever the potential is, and where cells are dark."""
    draw, spacing = np.random.default_rng(seed), (0.2, 0.15)
    f, g = (d / d.mean() for d in (draw.random(shape) + 0.1, draw.random(shape) * (draw.random(shape) < 0.5)))
    dual = DualProblem(backend, f, g, spacing)
    for size in (0.0, 0.1):
        psi, phi, _ = dual.solved(size * draw.random(shape), 1.0)
        least = least_cost(f, g, spacing)
        assert dual.value(psi, phi) <= least * (1 + 1e-9)
        assert plan_cost(backend, psi, f, g, spacing) >= least * (1 - 1e-9)


def test_a_map_that_is_right_has_a_small_gap_and_one_without_steps_a_large_one(backend, monkeypatch):
    """Light on the half of the target: the map (x + 1) / 2 costs 1/6 of the half width squared, here 1/24."""

    def half(grid):
        return np.repeat(np.arange(grid[0]) >= grid[0] // 2, grid[1]).reshape(grid) * 1.0

    found = transport_map(backend, half, (64, 64), 1.0)
    assert found.dual.value(found.psi, found.phi) == pytest.approx(1 / 24, rel=1e-3)
    assert 0 <= found.gap < 0.01
    monkeypatch.setattr("optics.designing.transport.back_and_forth.STEPS", 0)
    assert transport_map(backend, half, (64, 64), 1.0).gap > 0.5


def test_light_that_is_not_moved_has_no_gap(backend):
    assert transport_map(backend, np.ones, (64, 64), 1.0).gap == 0.0
