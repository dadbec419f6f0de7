"""Optimal transport between two rectangles: the map that turns a source's light into a target irradiance.

A map x -> t(x) = grad phi(x) carries a density f(x) to g(t) when the Monge-Ampere equation

    det D^2 phi(x) = f(x) / g(grad phi(x)),    grad phi(source rectangle) = target rectangle,

holds; for convex phi it is the optimal one.  In coordinates scaled so that both rectangles are
equal, phi = |x|^2 / 2 + v with zero normal derivative of v on the border, and the fixed-point
iteration

    Laplace phi <- sqrt((phi_xx - phi_yy)^2 + 4 phi_xy^2 + 4 f / g)

needs one Poisson solve (cosine transform) a step.  It converges for smooth densities of modest
contrast; so the density is smoothed by one cell, the steps are damped, and the contrast is
raised in stages, as far as the iteration follows.  Coarse grids start finer ones.

Source: J.-D. Benamou, B. Froese, A. Oberman, Two numerical methods for the elliptic
Monge-Ampere equation, ESAIM: M2AN 44 (2010).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dctn, idctn
from scipy.ndimage import gaussian_filter, zoom

FLOORS = (0.5, 0.3, 0.2, 0.1, 0.05, 0.02)  # of the mean: least densities in the target, tried in turn
FOLLOWS = 0.15  # residual below which a lower floor counts as solved
COARSE = 64  # cells in the shorter direction of the grid on which the floors are tried
STEPS = 40  # per grid and floor
DAMPING = 0.5
SMOOTHING = 1.0  # cells
FAINT = 0.02  # of the mean: least density of the source

Density = Callable[[tuple[int, ...]], NDArray[np.float64]]


@dataclass(frozen=True, eq=False)
class TransportMap:
    """Target positions of source cells, both relative to the half-widths.

    x : (nx,), y : (ny,) cell centres in [-1, 1].  tx, ty : (nx, ny) in [-1, 1].
    residual : root mean square of g det D^2 phi / f - 1 for the smoothed density.
    floor : least density for which the iteration converged, relative to the mean.
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    tx: NDArray[np.float64]
    ty: NDArray[np.float64]
    residual: float
    floor: float


def transport(
    density: Density, shape: Sequence[int], aspect: float, source: Density = np.ones
) -> TransportMap:
    """Return the TransportMap from a source to a density.

    density : called with (nx, ny), returns the density's cell means on such a grid over the
        target, index order x, y, any positive scale.
    shape : cells of the source.
    source : called with (nx, ny), returns its cell means on such a grid, any positive scale.
    aspect : width / height of the scaled rectangle, sqrt(ax bx / (ay by)) for half-widths a of
        the source and b of the target.
    """
    grids = [tuple(shape)]
    while min(grids[0]) >= 2 * COARSE:
        grids.insert(0, tuple(-(-n // 2) for n in grids[0]))
    size = np.array([1.0, 1.0 / aspect])
    v, floor, residual = np.zeros(grids[0]), FLOORS[0], np.inf
    for lower in FLOORS:
        f, g = _smoothed(source(grids[0]), FAINT), _smoothed(density(grids[0]), lower)
        w, error = _iterate(v, f, g, size)
        if lower < floor and error > FOLLOWS:
            break
        v, floor, residual = w, lower, error
    for grid in grids[1:]:
        f, g = _smoothed(source(grid), FAINT), _smoothed(density(grid), floor)
        v, residual = _iterate(_resampled(v, grid), f, g, size)
    gx, gy = _gradient(v, size)
    x, y = ((2 * np.arange(n) + 1) / n - 1 for n in shape)
    tx = np.clip(x[:, None] + 2 * gx / size[0], -1, 1)
    ty = np.clip(y[None, :] + 2 * gy / size[1], -1, 1)
    return TransportMap(x, y, tx, ty, residual, floor)


def _iterate(
    v: NDArray[np.float64], f: NDArray[np.float64], g: NDArray[np.float64], size: NDArray[np.float64]
) -> tuple[NDArray[np.float64], float]:
    """Return (v, residual) after fixed-point steps on one grid; v is the best one met."""
    n = v.shape
    h = size / n
    # the eigenvalues of the Laplacian in the basis of the cosine transform
    spectrum = np.add.outer(
        *((2 * np.cos(np.pi * np.arange(k) / k) - 2) / step**2 for k, step in zip(n, h)),
    )
    spectrum[0, 0] = 1.0
    x, y = ((np.arange(k) + 0.5) * step for k, step in zip(n, h))
    best, least = v, np.inf
    for _ in range(STEPS):
        p = np.pad(v, 1, mode="edge")
        vxx = (p[2:, 1:-1] - 2 * v + p[:-2, 1:-1]) / h[0] ** 2
        vyy = (p[1:-1, 2:] - 2 * v + p[1:-1, :-2]) / h[1] ** 2
        vxy = (p[2:, 2:] - p[2:, :-2] - p[:-2, 2:] + p[:-2, :-2]) / (4 * h[0] * h[1])
        gx, gy = _gradient(v, size)
        arriving = _bilinear(g, (x[:, None] + gx) / size[0], (y[None, :] + gy) / size[1])
        residual = float(np.sqrt(np.mean((arriving * ((1 + vxx) * (1 + vyy) - vxy**2) / f - 1) ** 2)))
        if residual < least:
            best, least = v, residual
        wanted = np.sqrt((vxx - vyy) ** 2 + 4 * vxy**2 + 4 * f / arriving) - 2
        transformed = dctn(wanted) / spectrum
        transformed[0, 0] = 0.0  # the border condition fixes the mean of the Laplacian
        v = v + DAMPING * (idctn(transformed) - v)
    return best, least


def _gradient(
    v: NDArray[np.float64], size: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    p = np.pad(v, 1, mode="edge")
    h = size / v.shape
    return (p[2:, 1:-1] - p[:-2, 1:-1]) / (2 * h[0]), (p[1:-1, 2:] - p[1:-1, :-2]) / (2 * h[1])


def _bilinear(g: NDArray[np.float64], s: NDArray[np.float64], t: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return g between its cell centres at relative positions s, t in [0, 1] (clipped)."""
    n, m = g.shape
    a = np.clip(s * n - 0.5, 0, n - 1)
    b = np.clip(t * m - 0.5, 0, m - 1)
    i, j = np.minimum(a.astype(np.int64), max(n - 2, 0)), np.minimum(b.astype(np.int64), max(m - 2, 0))
    a, b = a - i, b - j
    index = i * m + j
    flat = g.ravel()
    low = flat.take(index) * (1 - b) + flat.take(index + 1) * b
    high = flat.take(index + m) * (1 - b) + flat.take(index + m + 1) * b
    return low * (1 - a) + high * a


def _smoothed(density: NDArray[np.float64], floor: float) -> NDArray[np.float64]:
    """Return the density smoothed by a cell, with a floor and unit mean."""
    g = gaussian_filter(density / density.mean(), SMOOTHING, mode="nearest")
    g = np.maximum(g, floor)
    return g / g.mean()


def _resampled(v: NDArray[np.float64], grid: tuple[int, ...]) -> NDArray[np.float64]:
    return zoom(v, [b / a for a, b in zip(v.shape, grid)], order=3, mode="nearest", grid_mode=True)
