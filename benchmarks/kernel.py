"""The THB kernel: run time beside error, on the annulus hierarchy that five codes agree on.

Run on one core: thbcad bench kernel
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import BSpline, NdBSpline

from benchmarks.rows import Row, median_seconds
from thbcad import BSplineSurface, KnotVector, THBSpace, THBSurface

WIDTHS = (0.25, 0.15, 0.08, 0.04, 0.02)
REPEATS = 9


def rows() -> list[Row]:
    """Return the figures."""
    marks = annulus_marks()
    space = annulus(marks)
    surface = THBSurface(space, coefficients(space))
    return [*_hierarchy(marks, space, surface), *_transfer(marks, space), *_corner(), *_tensor()]


def annulus_marks() -> list[np.ndarray]:
    """Return the cells of every level that meet the open annulus |r - 0.3| < w about (1/2, 1/2)."""
    marks = []
    for level, width in enumerate(WIDTHS):
        n = 7 << level
        # in units of 1 / (2 n), so that the test is exact up to the square root
        low, high = np.arange(n) / n - 0.5, (np.arange(n) + 1) / n - 0.5
        near = np.where((low <= 0) & (high >= 0), 0.0, np.minimum(abs(low), abs(high)))
        far = np.maximum(abs(low), abs(high))
        least, most = np.hypot.outer(near, near), np.hypot.outer(far, far)
        marks.append(np.argwhere((least < 0.3 + width) & (most > 0.3 - width)))
    return marks


def annulus(marks: list[np.ndarray]) -> THBSpace:
    """Return the hierarchy, ready to evaluate."""
    kv = KnotVector.uniform(3, 7)
    space = THBSpace(kv, kv)
    for level, cells in enumerate(marks):
        space = space.refine({level: cells})
    assert space.embedding.steps
    return space


def coefficients(space: THBSpace) -> np.ndarray:
    """Return the oracle's coefficients."""
    level, i, j = space.functions.T.astype(float)
    return np.sin(1.3 * i + 2.1 * j + 0.7 * level) + 0.3 * np.cos(0.37 * i * j + level)


def _ms(function, repeats: int = REPEATS) -> float:
    return 1e3 * median_seconds(function, repeats)


def _hierarchy(marks: list[np.ndarray], space: THBSpace, surface: THBSurface) -> list[Row]:
    grid = np.linspace(0, 1, 449)
    u, v = np.random.default_rng(0).random((2, 201_601))
    c = surface.coefficients

    def fresh() -> THBSurface:
        return THBSurface(space, c)

    def with_gradient() -> None:
        own = fresh()
        for derivative in ((0, 0), (1, 0), (0, 1)):
            own.grid(grid, grid, derivative)

    tensor = surface.to_bspline()
    scipy_tensor = NdBSpline((tensor.kv_u.knots, tensor.kv_v.knots), tensor.coefficients, 3)
    points = np.column_stack([u, v])
    error = float(abs(space.collocation(u, v) @ c - scipy_tensor(points)).max())
    patches = surface.to_patches()
    return [
        Row("annulus: degrees of freedom", space.dim, "", "5593"),
        Row("annulus: build and 5 refinements, ready to evaluate", _ms(lambda: annulus(marks)), "ms", "pygismo 40, pyiga 75", 10),
        Row("annulus: values on 449^2, operators built", _ms(lambda: fresh().grid(grid, grid)), "ms", "pyiga 57", 3),
        Row("annulus: values and gradient on 449^2", _ms(with_gradient), "ms", "60 and up", 10),
        Row("annulus: 201,601 scattered points", _ms(lambda: surface(u, v), 5), "ms", "pygismo 5070", 80),
        Row("   scipy NdBSpline on the tensor-product form, same run", _ms(lambda: scipy_tensor(points), 5), "ms"),
        Row("   collocation matrix times coefficients against scipy", error, "", "", 1e-13),
        Row("annulus: collocation matrix of these points", _ms(lambda: space.collocation(u, v), 3), "ms", "pyiga 3300", 150),
        Row("annulus: its derivative in u", _ms(lambda: space.collocation(u, v, (1, 0)), 3), "ms", "", 200),
        Row("annulus: exact patches", len(patches), "", "leaves 1261, minimum 381", 381),
        Row("annulus: time of the patches", _ms(surface.to_patches, 5), "ms", "", 200),
    ]


def _transfer(marks: list[np.ndarray], fine: THBSpace) -> list[Row]:
    coarse = annulus(marks[:-1])
    p = coarse.prolongation(fine)
    c = coefficients(coarse)
    grid = np.linspace(0, 1, 301)
    error = abs(THBSurface(coarse, c).grid(grid, grid) - THBSurface(fine, p @ c).grid(grid, grid)).max()
    identity = fine.restriction(coarse) @ p
    identity.setdiag(identity.diagonal() - 1)
    return [
        Row("transfer 2797 to 5593, explicit", _ms(lambda: coarse.prolongation(fine)), "ms", "pygismo 187", 10),
        Row("   error of the geometry", float(error), "", "", 2e-15),
        Row("restriction 5593 to 2797", _ms(lambda: fine.restriction(coarse), 3), "ms"),
        Row("   |Q P - I|", float(abs(identity).max()), "", "", 1e-13),
    ]


def _corner() -> list[Row]:
    def build(depth: int) -> THBSpace:
        kv = KnotVector.uniform(3, 8)
        space = THBSpace(kv, kv)
        block = np.argwhere(np.ones((4, 4)))
        for level in range(depth):
            space = space.refine({level: block})
        assert space.embedding.steps
        return space

    return [
        Row("corner refinement, 8 x 8, level 12 (697 DOF)", _ms(lambda: build(12)), "ms", "nutils 1700", 50),
        Row("corner refinement, 8 x 8, level 20 (1081 DOF)", _ms(lambda: build(20)), "ms", "", 100),
    ]


def _tensor() -> list[Row]:
    kv = KnotVector.uniform(3, 224)
    net = np.random.default_rng(1).random((kv.dim, kv.dim, 3))
    surface = BSplineSurface(kv, kv, net)
    grid = np.linspace(0, 1, 449)

    def by_scipy() -> np.ndarray:
        return BSpline(kv.knots, BSpline(kv.knots, net, 3)(grid).swapaxes(0, 1), 3)(grid).swapaxes(0, 1)

    new = (np.arange(100) + 0.37) / 100
    error = float(abs(surface.grid(grid, grid) - by_scipy()).max())
    return [
        Row("227^2 bicubic, 3 components, on 449^2", _ms(lambda: surface.grid(grid, grid)), "ms", "", 2.5),
        Row("   scipy BSpline twice, same run", _ms(by_scipy), "ms"),
        Row("   difference from scipy", error, "", "", 1e-14),
        Row("insert 100 knots in u and in v, 227^2, 3 components", _ms(lambda: surface.insert(new, new)), "ms", "splipy 135", 10),
    ]
