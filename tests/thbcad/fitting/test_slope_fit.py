"""Surfaces from slopes: exact where a space holds the surface, best elsewhere."""

import importlib

import numpy as np
import pytest
from hypothesis import given, strategies as st

from thbcad.fitting import fit_slopes
from thbcad.hierarchy import THBSpace
from thbcad.splines import KnotVector
from thbcad.surfaces import THBSurface


def space_of(degree: int, levels: int, local: bool) -> THBSpace:
    space = THBSpace(KnotVector.uniform(degree, 5, -2, 2), KnotVector.uniform(degree, 4, -1, 1))
    for level in range(levels):
        cells = space.cells[space.cells[:, 0] == level, 1:]
        space = space.refine({level: cells[: len(cells) // 2] if local else cells})
    return space


def samples(reach: float = 1.0, n: int = 70) -> tuple[np.ndarray, np.ndarray]:
    return reach * 2 * (2 * np.arange(n) + 1 - n) / n, reach * (2 * np.arange(n - 9) + 10 - n) / (n - 9)


def residual(sag: THBSurface, x: np.ndarray, y: np.ndarray, zx: np.ndarray, zy: np.ndarray) -> float:
    return float(np.sum((sag.grid(x, y, (1, 0)) - zx) ** 2 + (sag.grid(x, y, (0, 1)) - zy) ** 2))


@pytest.mark.parametrize("local", [False, True])
@pytest.mark.parametrize("degree", [2, 3, 4])
@pytest.mark.parametrize("levels", [0, 1, 3])
def test_a_surface_of_the_space_is_found_but_for_its_constant(degree, levels, local):
    space = space_of(degree, levels, local)
    wanted = THBSurface(space, np.random.default_rng(1).normal(size=space.dim))
    x, y = samples()
    zx, zy = wanted.grid(x, y, (1, 0)), wanted.grid(x, y, (0, 1))
    found = fit_slopes(space, x, y, zx, zy, np.ones(zx.shape))
    # local meshes end with 60 steps of conjugate gradients, whole ones are exact but for ties of weight 1e-3
    assert residual(found, x, y, zx, zy) < (3e-3 if local else 1e-4) * np.sum(zx**2 + zy**2)
    c = found.coefficients
    assert c.max() == pytest.approx(-c.min(), rel=1e-12)


@given(st.integers(0, 10_000))
def test_no_change_of_an_even_fit_on_a_whole_mesh_fits_better(seed):
    """The residual of noisy slopes grows in every direction: the fit is the least-squares one."""
    rng = np.random.default_rng(seed)
    space = space_of(3, 1, local=False)
    x, y = samples()
    zx, zy = rng.normal(size=(2, len(x), len(y)))
    found = fit_slopes(space, x, y, zx, zy, np.ones(zx.shape))
    least = residual(found, x, y, zx, zy)
    for _ in range(5):
        step = rng.normal(size=space.dim)
        changed = [residual(THBSurface(space, found.coefficients + t * step), x, y, zx, zy) for t in (-1, 1)]
        curvature = (sum(changed) - 2 * least) / 2
        slope = (changed[1] - changed[0]) / 2
        assert slope**2 / (4 * curvature) < 1e-4 * least  # what a step along it could gain


def test_slopes_beside_the_samples_go_on_straight():
    """Samples on 80 % of the mesh: the fit of a plane is the plane to the rim."""
    space = space_of(3, 2, local=False)
    x, y = samples(0.8)
    flat = np.ones((len(x), len(y)))
    found = fit_slopes(space, x, y, 0.3 * flat, -0.2 * flat, flat)
    u, v = np.linspace(-2, 2, 9), np.linspace(-1, 1, 7)
    wanted = 0.3 * u[:, None] - 0.2 * v[None, :]
    assert np.abs(found.grid(u, v) - wanted).max() < 1e-9


@pytest.mark.parametrize("levels", [2, 3])
@pytest.mark.parametrize("reach", [0.85, 0.9, 0.95])
@pytest.mark.parametrize("degree", [2, 3])
def test_beside_the_samples_and_in_corners_slopes_stay_about_as_small(degree, reach, levels):
    """A bowl under ripples that no mesh has: beside the samples nothing gets much steeper than among them."""
    knots = KnotVector.uniform(degree, 7, -2, 2)
    space = THBSpace(knots, knots).uniform(levels)
    x = y = reach * 2 * (2 * np.arange(256) + 1 - 256) / 256
    u, v = x[:, None], y[None, :]
    noise = np.random.default_rng(3).normal(0.0, 0.01, (2, 256, 256))
    found = fit_slopes(space, x, y, 0.2 * u + noise[0], 0.2 * v + noise[1], np.ones((256, 256)))
    rows = np.linspace(-2, 2, 301), reach * np.linspace(-2, 2, 301)
    steepest, within = (
        float(np.hypot(*(found.grid(row, row, d) for d in ((1, 0), (0, 1)))).max()) for row in rows
    )
    assert steepest < 3 * within


def test_fewer_samples_than_functions_give_a_smooth_surface():
    space = space_of(3, 3, local=False)
    x, y = samples(n=30)
    zx, zy = np.cos(x)[:, None] + 0 * y, 0 * x[:, None] + y
    found = fit_slopes(space, x, y, zx, zy, np.ones(zx.shape))
    u, v = np.linspace(-1.9, 1.9, 41), np.linspace(-0.9, 0.9, 31)
    off = found.grid(u, v) - (np.sin(u)[:, None] + v[None, :] ** 2 / 2)
    assert np.ptp(off) < 0.02


def test_cells_of_little_weight_do_not_count():
    """Wrong slopes in a corner with a weight of 1e-3 change the fit of the rest by little."""
    space = space_of(3, 2, local=False)
    wanted = THBSurface(space, np.random.default_rng(2).normal(size=space.dim))
    x, y = samples()
    zx, zy = wanted.grid(x, y, (1, 0)), wanted.grid(x, y, (0, 1))
    weight = np.ones(zx.shape)
    weight[:20, :20] = 1e-3
    zx[:20, :20] += 1.0
    found = fit_slopes(space, x, y, zx, zy, weight)
    off = (found.grid(x, y, (1, 0)) - zx)[30:]
    assert np.sqrt(np.mean(off**2)) < 0.05 * np.sqrt(np.mean(zx[30:] ** 2))


@pytest.mark.parametrize("direct", [0, 10_000])
def test_a_factorisation_and_steps_find_the_same_slopes(monkeypatch, direct):
    """Against the dense normal equations, where light is; other degrees by direction, knots at will."""
    module = importlib.import_module("thbcad.fitting.slope_fit")
    monkeypatch.setattr(module, "DIRECT", direct)
    kv_u = KnotVector(2, [-2, -2, -2, -1.7, -0.4, 0.1, 0.1, 1.3, 2, 2, 2])
    kv_v = KnotVector(3, [-1, -1, -1, -1, -0.2, 0.3, 0.5, 1, 1, 1, 1])
    space, (x, y) = THBSpace(kv_u, kv_v), samples()
    weight = np.where(x[:, None] > 0.5 * y, 1.0, 1e-3)
    zx, zy = np.sin(3 * x)[:, None] * np.cos(4 * y), np.cos(2 * x)[:, None] * y**2
    found = fit_slopes(space, x, y, zx, zy, weight)
    rows = np.array(
        [
            [b.grid(x, y, (1, 0)).ravel(), b.grid(x, y, (0, 1)).ravel()]
            for b in (THBSurface(space, e) for e in np.eye(space.dim))
        ]
    )
    normal = np.einsum("iks,jks,s->ij", rows, rows, weight.ravel())
    right = np.einsum("iks,ks,s->i", rows, np.array([zx.ravel(), zy.ravel()]), weight.ravel())
    best = THBSurface(space, np.linalg.lstsq(normal, right, rcond=1e-13)[0])
    for order in ((1, 0), (0, 1)):
        off = found.grid(x, y, order) - best.grid(x, y, order)
        assert np.sqrt(np.mean(weight * off**2)) < 1e-4


@pytest.mark.every(2)
@pytest.mark.parametrize("local", [False, True])
def test_uneven_weights_are_fitted_as_well_as_by_dense_least_squares(local):
    """Slopes that no surface has, with weights of 1 in a disk and 1e-3 beside it."""
    space, (x, y) = space_of(3, 2, local), samples()
    weight = np.where(np.hypot(x[:, None] / 2, y[None, :]) < 0.7, 1.0, 1e-3)
    zx, zy = np.sin(3 * x)[:, None] * np.cos(4 * y), np.cos(2 * x)[:, None] * y**2
    rows = [
        np.concatenate([b.grid(x, y, (1, 0)).ravel(), b.grid(x, y, (0, 1)).ravel()])
        for b in (THBSurface(space, e) for e in np.eye(space.dim))
    ]
    root = np.sqrt(np.concatenate([weight.ravel()] * 2))
    wanted = root * np.concatenate([zx.ravel(), zy.ravel()])
    best = np.linalg.lstsq(np.transpose(rows) * root[:, None], wanted, rcond=1e-12)[0]
    found = fit_slopes(space, x, y, zx, zy, weight).coefficients
    off = [float(np.sum((root * (c @ rows) - wanted) ** 2)) for c in (best, found)]
    assert off[1] < 1.0001 * off[0]


def test_nearly_as_many_functions_as_samples_do_not_spoil_the_fit():
    """115 functions on 128 samples, whose slopes jump where the weight does."""
    n = 128
    kv = KnotVector.uniform(3, 112, -1.0, 1.0)
    space, x = THBSpace(kv, kv), (2 * np.arange(n) + 1) / n - 1
    lit = np.hypot(x[:, None], x[None, :]) < 0.9
    zx = np.where(lit, np.sin(3 * x)[:, None], 0.0)
    zy = np.where(lit, 0.5 * np.cos(2 * x)[None, :], 0.0)
    found = fit_slopes(space, x, x, zx, zy, np.where(lit, 1.0, 1e-3))
    off = np.hypot(found.grid(x, x, (1, 0)) - zx, found.grid(x, x, (0, 1)) - zy)[lit]
    assert np.sqrt((off**2).mean()) < 0.01
