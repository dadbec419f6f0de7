"""Optimal transport between two rectangles: the map that turns a source's light into a target irradiance.

Kantorovich's dual problem asks for potentials psi on the source, phi on the target with the greatest

    J = mean(f psi) + mean(g phi),    psi(x) + phi(y) <= |x - y|^2 / 2.

At its maximum each is the c-transform of the other, and x -> x - grad psi(x) carries f to g.  Of the two the
one is improved and the other is its c-transform, in turn:

    phi <- phi + sigma (-Laplace)^-1 (g - (x - grad psi)# f),    psi <- phi^c,    phi <- psi^c,

and the same with psi and phi, f and g exchanged.  Each of the two has a step sigma of its own, which follows
the part that is found of the gain which the gradient promises.  A step that loses more than it promised, by
more than cells can hide, is not taken, and a potential whose sigma has become small is improved no more.
Where the light of a thin ring is spread over the source, samples of the ring leave gaps, and so the steps of
psi lose what those of phi gain; these alone then reach the maximum.

Steps end where J stands still.  Densities may be zero anywhere.  Coarse grids start finer ones.

Source: M. Jacobs, F. Leger, A fast approach to optimal transport: the back-and-forth method, Numerische
Mathematik 146 (2020).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.ndimage import zoom

from optics.base.runtime import Backend
from optics.designing.transport.c_transform import c_transform
from optics.designing.transport.duality_gap import plan_cost
from optics.designing.transport.poisson import solved_poisson
from optics.designing.transport.push_forward import push_forward
from thbcad.checks import Floats

Density = Callable[[tuple[int, int]], Floats]

COARSE = 64  # cells in the shorter direction of the coarsest grid, at least
STEPS = 40  # at most on one grid, each of both potentials; 3 to 13 are usual
# cells: a map that is displaced by so much everywhere is short of the greatest J by half of its square, and a
# step that changes J by less is the last (rel_l2 of pearl: 0.0287, with 0.05 cells 0.0293, without 0.0286)
STILL = 0.01
# sigma times the greatest density, which bounds the curvature of J: first on the coarsest grid, where light
# has far to go, first on the finer ones, and last, where the cells limit the gain and no longer the method
FAR, NEAR, LAST = 32.0, 4.0, 0.8
CHANGE = 0.5, 1.25  # of sigma from step to step, at least and at most
DARK = -1e6  # potential of a cell without light: below all others, in the squared width of the rectangle
ROUNDING = 1e-15  # of a gain, in the same unit
# of five cells: the slope at each of the parabola that fits them; of three: the value of the line that does
PARABOLA = np.array([[k / 10 + x * (k * k - 2) / 7 for k in range(-2, 3)] for x in range(-2, 3)])
LINE = np.array([[1 / 3 + x * k / 2 for k in range(-1, 2)] for x in range(-1, 2)])


@dataclass(frozen=True, eq=False)
class Transport:
    """Where optimal transport from a source to a density sends the source's cells.

    places : x and y, (nx, ny) each, relative to the target's half-widths, in [-1, 1].
    steps : on all grids.  dual, psi, phi : the problem on the finest grid, and its potentials.
    """

    places: tuple[Floats, Floats]
    steps: int
    dual: DualProblem
    psi: Floats
    phi: Floats

    @cached_property
    def gap(self) -> float:
        """Relative gap of primal and dual: no plan on the finest grid costs less than 1 - gap times the one
        that follows this map; 0 where that moves light by less than a cell."""
        dual = self.dual
        with dual.backend.on_threads(1):
            cost = plan_cost(dual.backend, self.psi, dual.f, dual.g, dual.spacing)
        return 1 - dual.value(self.psi, self.phi) / cost if cost > np.prod(dual.spacing) / 2 else 0.0


def transport_map(
    backend: Backend, density: Density, shape: tuple[int, int], aspect: float, source: Density = np.ones
) -> Transport:
    """Return optimal transport from a source to a density.

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
    phi, first, steps = np.zeros(grids[0]), FAR, 0
    with backend.on_threads(1):
        for grid in grids:
            f, g = (d / d.mean() for d in (source(grid), density(grid)))
            phi = zoom(phi, [b / a for a, b in zip(phi.shape, grid)], order=3, mode="nearest", grid_mode=True)
            dual = DualProblem(backend, f, g, [s / n for s, n in zip(size, grid)])
            psi, phi, taken = dual.solved(phi, first)
            first, steps = NEAR, steps + taken
    gx, gy = _gradient(psi, dual.spacing)
    x, y = ((2 * np.arange(n) + 1) / n - 1 for n in shape)
    tx = np.clip(x[:, None] - 2 * gx / size[0], -1, 1)
    ty = np.clip(y[None, :] - 2 * gy / size[1], -1, 1)
    return Transport((tx, ty), steps, dual, psi, phi)


@dataclass(frozen=True, eq=False)
class DualProblem:
    """The dual problem on one grid.  f, g : (nx, ny) densities of mean 1.  spacing : of the cells."""

    backend: Backend
    f: Floats
    g: Floats
    spacing: Sequence[float]

    @property
    def hidden(self) -> float:
        """Mean of |x - y|^2 / 2 from the middle of a cell."""
        return sum(h**2 for h in self.spacing) / 24

    def value(self, psi: Floats, phi: Floats) -> float:
        """Return J."""
        return float(np.mean(psi * self.f) + np.mean(phi * self.g))

    def solved(self, phi: Floats, first: float) -> tuple[Floats, Floats, int]:
        """Return (psi, phi) after steps from phi, and the number of steps.

        first : sigma times the greatest density.
        """
        f, g, psi = self.f, self.g, self._transformed(phi, self.g)
        least = LAST / max(f.max(), g.max())
        still, reached = STILL**2 / 2 * np.prod(self.spacing), -np.inf
        sigma_phi = sigma_psi = first / LAST * least
        for step in range(STEPS):
            if max(sigma_phi, sigma_psi) < least:
                return psi, phi, step
            phi, psi, sigma_phi = self._improved(phi, psi, g, f, sigma_phi, least)
            psi, phi, sigma_psi = self._improved(psi, phi, f, g, sigma_psi, least)
            before, reached = reached, self.value(psi, phi)
            if abs(reached - before) < still:
                return psi, phi, step + 1
        return psi, phi, STEPS

    def _improved(
        self, phi: Floats, psi: Floats, g: Floats, f: Floats, sigma: float, least: float
    ) -> tuple[Floats, Floats, float]:
        """Return phi after a step, psi = phi^c, and the next sigma; with sigma below the least phi and psi as
        they were."""
        if sigma < least:
            return phi, psi, sigma
        missing = g - push_forward(self.backend, psi, f, self.spacing)
        direction = solved_poisson(missing, self.spacing)
        before, slope = np.mean(phi * g) + np.mean(psi * f), np.mean(missing * direction)
        while sigma >= least:
            tried = phi + sigma * direction
            changed = self._transformed(tried, g)
            gain, promised = np.mean(tried * g) + np.mean(changed * f) - before, sigma * slope
            # to the top of the parabola with this gain and this slope
            sigma *= np.clip(0.75 + 0.5 * gain / (promised + ROUNDING), *CHANGE)
            if gain >= -promised - self.hidden:
                return self._transformed(changed, f), changed, sigma
        return phi, psi, sigma

    def _transformed(self, potential: Floats, density: Floats) -> Floats:
        """Return the c-transform over the cells with light: no light can stay in the dark."""
        lit = np.where(density > 0, potential, DARK)
        return c_transform(self.backend, lit, self.spacing)


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
