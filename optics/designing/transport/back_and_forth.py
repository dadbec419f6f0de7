"""Optimal transport between two rectangles: the map that turns a source's light into a target irradiance.

Kantorovich's dual problem asks for potentials psi on the source, phi on the target with the greatest

    J = mean(f psi) + mean(g phi),    psi(x) + phi(y) <= |x - y|^2 / 2.

At its maximum each is the c-transform of the other, and x -> x - grad psi(x) carries f to g.  Of the two the
one is improved and the other is its c-transform, in turn:

    phi <- phi + sigma (-Laplace)^-1 (g - (x - grad psi)# f),    psi <- phi^c,    phi <- psi^c,

and the same with psi and phi, f and g exchanged.  The step sigma follows the part that is found of the gain
which the gradient promises.  Steps end where J stands still.  Densities may be zero anywhere.  Coarse grids
start finer ones.

Source: M. Jacobs, F. Leger, A fast approach to optimal transport: the back-and-forth method, Numerische
Mathematik 146 (2020).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.ndimage import zoom

from optics.base.runtime import Backend
from optics.designing.transport.c_transform import c_transform
from optics.designing.transport.poisson import solved_poisson
from optics.designing.transport.push_forward import push_forward
from thbcad.checks import Floats

Density = Callable[[tuple[int, int]], Floats]

COARSE = 64  # cells in the shorter direction of the coarsest grid, at least
STEPS = 40  # at most on one grid, each of both potentials; 3 to 7 are usual
# cells: a map that is displaced by so much everywhere is short of the greatest J by half of its square, and a
# step that changes J by less is the last (rel_l2 of pearl: 0.0287, with 0.05 cells 0.0293, without 0.0286)
STILL = 0.01
# sigma times the greatest density, which bounds the curvature of J: first on the coarsest grid, where light
# has far to go, first on the finer ones, and last, where the cells limit the gain and no longer the method
FAR, NEAR, LAST = 32.0, 8.0, 0.8
FOUND = 0.25, 0.75  # of the promised gain: sigma falls below the first and rises above the second
CHANGE = 0.8  # of sigma
# of the promised gain, and of sigma: where so much is lost the cells limit the gain and no longer the method,
# at any sigma (on pearl's finer grids three times the promise, whether sigma is 6 or 0.8)
LOST = -1.0, 0.5
DARK = -1e6  # potential of a cell without light: below all others, in the squared width of the rectangle
ROUNDING = 1e-15  # of a gain, in the same unit
# of five cells: the slope at each of the parabola that fits them; of three: the value of the line that does
PARABOLA = np.array([[k / 10 + x * (k * k - 2) / 7 for k in range(-2, 3)] for x in range(-2, 3)])
LINE = np.array([[1 / 3 + x * k / 2 for k in range(-1, 2)] for x in range(-1, 2)])


def transport_map(
    backend: Backend, density: Density, shape: tuple[int, int], aspect: float, source: Density = np.ones
) -> tuple[Floats, Floats]:
    """Return where optimal transport from a source to a density sends the source's cells, tx and ty.

    Both are (nx, ny), relative to the target's half-widths, in [-1, 1].

    density : called with (nx, ny), returns the density's cell means on such a grid over the
        target, index order x, y, any positive scale.
    shape : cells of the source, at least 5 in each direction.
    source : called with (nx, ny), returns its cell means on such a grid, any positive scale.
    aspect : width / height of the scaled rectangle, sqrt(ax bx / (ay by)) for half-widths a of
        the source and b of the target.
    """
    backend = backend.with_precision("double")
    grids = [shape]
    while min(grids[0]) >= 2 * COARSE:
        nx, ny = grids[0]
        grids.insert(0, (-(-nx // 2), -(-ny // 2)))
    size = (1.0, 1.0 / aspect)
    phi, first = np.zeros(grids[0]), FAR
    with backend.on_threads(1):
        for grid in grids:
            f, g = (d / d.mean() for d in (source(grid), density(grid)))
            phi = zoom(phi, [b / a for a, b in zip(phi.shape, grid)], order=3, mode="nearest", grid_mode=True)
            psi, phi = _Dual(backend, f, g, [s / n for s, n in zip(size, grid)]).solved(phi, first)
            first = NEAR
    gx, gy = _gradient(psi, [s / n for s, n in zip(size, shape)])
    x, y = ((2 * np.arange(n) + 1) / n - 1 for n in shape)
    tx = np.clip(x[:, None] - 2 * gx / size[0], -1, 1)
    ty = np.clip(y[None, :] - 2 * gy / size[1], -1, 1)
    return tx, ty


class _Dual:
    """The dual problem on one grid.  f, g : (nx, ny) densities of mean 1.  spacing : of the cells."""

    def __init__(self, backend: Backend, f: Floats, g: Floats, spacing: Sequence[float]) -> None:
        self._backend, self._f, self._g, self._spacing = backend, f, g, spacing

    def solved(self, phi: Floats, first: float) -> tuple[Floats, Floats]:
        """Return (psi, phi) after steps from phi.  first : sigma times the greatest density."""
        f, g = self._f, self._g
        psi, greatest = self._transformed(phi, g), max(f.max(), g.max())
        sigma, reached = first / greatest, -np.inf
        still = STILL**2 / 2 * np.prod(self._spacing)
        for _ in range(STEPS):
            phi, psi, sigma = self._step(phi, psi, g, f, sigma)
            psi, phi, sigma = self._step(psi, phi, f, g, sigma)
            before, reached = reached, float(np.mean(phi * g) + np.mean(psi * f))
            if abs(reached - before) < still or sigma < LAST / greatest:
                break
        return psi, phi

    def _step(
        self, phi: Floats, psi: Floats, g: Floats, f: Floats, sigma: float
    ) -> tuple[Floats, Floats, float]:
        """Return improved phi and psi = phi^c, and the next sigma."""
        missing = g - push_forward(self._backend, psi, f, self._spacing)
        direction = solved_poisson(missing, self._spacing)
        before = np.mean(phi * g) + np.mean(psi * f)
        phi = phi + sigma * direction
        psi = self._transformed(phi, g)
        gain = np.mean(phi * g) + np.mean(psi * f) - before
        promised = sigma * np.mean(missing * direction)
        if gain < LOST[0] * promised - ROUNDING:
            sigma *= LOST[1]
        elif gain < FOUND[0] * promised + ROUNDING:
            sigma *= CHANGE
        elif gain > FOUND[1] * promised:
            sigma /= CHANGE
        return self._transformed(psi, f), psi, sigma

    def _transformed(self, potential: Floats, density: Floats) -> Floats:
        """Return the c-transform over the cells with light: no light can stay in the dark."""
        lit = np.where(density > 0, potential, DARK)
        return c_transform(self._backend, lit, self._spacing)


def _gradient(psi: Floats, spacing: Sequence[float]) -> list[Floats]:
    """Return the slopes of psi, smoothed by about a cell, which takes out the staircase of c-transforms.

    Along a direction the slope of the parabola that fits five cells, across it the line that fits three: both
    weigh differences of psi positively, so the map stays monotone.  The outermost go on to the border: psi
    has a slope across it where the target is dark at its own.
    """
    slope_x, slope_y = (_fitted(psi, axis, PARABOLA, h) for axis, h in enumerate(spacing))
    return [_fitted(slope_x, 1, LINE), _fitted(slope_y, 0, LINE)]


def _fitted(values: Floats, axis: int, weights: Floats, unit: float = 1.0) -> Floats:
    """Return sums of neighbours along an axis, divided by `unit`.

    weights : one row for every cell of a window of odd length; the middle row is taken wherever it fits.
    """
    rows, middle = np.moveaxis(values, axis, 0), len(weights) // 2
    out = np.empty_like(rows)
    inner = len(rows) - 2 * middle
    out[middle:-middle] = sum(w * rows[k : k + inner] for k, w in enumerate(weights[middle]))
    out[:middle] = np.tensordot(weights[:middle], rows[: len(weights)], 1)
    out[-middle:] = np.tensordot(weights[-middle:], rows[-len(weights) :], 1)
    return np.moveaxis(out / unit, 0, axis)
