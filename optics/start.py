"""The surface to start from: optimal transport, Snell's law, and a fit of slopes in THB space."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import LinearOperator, cg

from optics.beam import Profile
from optics.model import target_irradiance, target_screen
from optics.screen import Screen
from optics.transport import transport
from thbcad.multilevel import MultilevelBasis
from thbcad.thb import THBSurface

if TYPE_CHECKING:
    from optics.problem import Problem
    from thbcad.lens import Lens
    from thbcad.space import THBSpace

SNELL_STEPS = 4
FIT_STEPS = 60
CELLS_PER_PIXEL = 2
LEAST_CELLS, MOST_CELLS = 64, 512
INSIDE = 0.97  # of z_freedom
DARK = 1e-3  # of the greatest irradiance: nothing is sent there


class TransportStart:
    """Rear slopes that send parallel rays to the picture; needs a plane front.

    Every source cell gets a target point by optimal transport, Snell's law the slope that the
    rear must have there.  `fit` gives the sag with these slopes in any THB space.
    """

    def __init__(self, problem: Problem, lens: Lens, light: NDArray[np.float64]) -> None:
        screen = target_screen(problem)
        lit, centre, half = _lit_part(target_irradiance(light, screen, problem.target.fit, 1.0), screen)
        beam = [min(s, f) for s, f in zip(problem.source.half_width, lens.front.half_width)]
        cells = [int(np.clip(CELLS_PER_PIXEL * n, LEAST_CELLS, MOST_CELLS)) for n in screen.pixels]

        def density(grid: tuple[int, ...]) -> NDArray[np.float64]:
            pixels = min(grid[0], lit.shape[1]), min(grid[1], lit.shape[0])
            return target_irradiance(lit, Screen(half, pixels), "stretch", 1.0)[::-1].T

        profile = Profile(problem.source.profile, problem.source.sigma)
        reach = [b / s for b, s in zip(beam, problem.source.half_width)]

        def emitted(grid: tuple[int, ...]) -> NDArray[np.float64]:
            return profile(*(r * ((2 * np.arange(n) + 1) / n - 1) for n, r in zip(grid, reach)))

        found = transport(density, cells, np.sqrt(beam[0] * half[0] / (beam[1] * half[1])), emitted)
        self._x, self._y = found.x * beam[0], found.y * beam[1]
        arrival = centre[0] + half[0] * found.tx, centre[1] + half[1] * found.ty
        slopes = _slopes(lens, self._x, self._y, *arrival, problem.target_z)
        base = (lens.rear.conic(self._x[:, None], self._y[None, :], d) for d in ((1, 0), (0, 1)))
        self._slopes = [s - b for s, b in zip(slopes, base)]
        self._bound = INSIDE * problem.lens.rear.freeform.z_freedom
        self.reach = 0.0

    def fit(self, space: THBSpace) -> THBSurface:
        """Return the sag in a THB space over x, y in mm; `reach` keeps the greatest |c| it asked for.

        A sag that exceeds z_freedom is scaled down, which moves the light part of the way.
        """
        sag = fit_slopes(space, self._x, self._y, *self._slopes)
        self.reach = float(np.abs(sag.coefficients).max())
        return sag if self.reach <= self._bound else THBSurface(space, sag.coefficients * (self._bound / self.reach))

    @property
    def note(self) -> str:
        """A sentence for the user where z_freedom is too small for the transport map, or ""."""
        if self.reach <= self._bound:
            return ""
        return (
            f"the transport map asks for a sag of +-{self.reach:.2f} mm, more than z_freedom allows; "
            f"raise lens.rear.freeform.z_freedom above {self.reach / INSIDE:.2f} for better light"
        )


def _lit_part(image: NDArray[np.float64], screen: Screen) -> tuple[NDArray[np.float64], tuple[float, float], tuple[float, float]]:
    """Return the least rectangle of an irradiance that holds all light but for DARK of the greatest, its centre and half-widths, mm."""
    bright = image > DARK * image.max()
    rows, columns = (np.flatnonzero(bright.any(axis=axis)) for axis in (1, 0))
    (hx, hy), (r0, r1, c0, c1) = screen.half_width, (rows[0], rows[-1] + 1, columns[0], columns[-1] + 1)
    wide, tall = hx / image.shape[1], hy / image.shape[0]  # half a pixel
    centre = float((c0 + c1) * wide - hx), float(hy - (r0 + r1) * tall)
    return image[r0:r1, c0:c1], centre, (float((c1 - c0) * wide), float((r1 - r0) * tall))


def _slopes(
    lens: Lens, x: NDArray[np.float64], y: NDArray[np.float64], px: NDArray[np.float64], py: NDArray[np.float64], target_z: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return (zx, zy) that refract parallel rays at (x, y) to (px, py, target_z), each (nx, ny).

    The normal lies along n d_in - d_out.  The height, which is needed for the direction to the
    target, is integrated from the slopes of the step before.
    """
    x, y = x[:, None], y[None, :]
    z = lens.thickness + lens.rear.conic(x, y)
    for _ in range(SNELL_STEPS):
        dx, dy, dz = px - x, py - y, target_z - z
        length = np.sqrt(dx * dx + dy * dy + dz * dz)
        across = lens.index - dz / length
        zx, zy = dx / length / across, dy / length / across
        z = lens.thickness + _integrated(zx, zy, x[:, 0], y[0])
    return zx, zy


def _integrated(zx: NDArray[np.float64], zy: NDArray[np.float64], x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a height whose slopes are about (zx, zy), zero in the middle.

    Trapezoids along the middle row and from there along the columns: good enough for
    distances, the fit itself uses the slopes.
    """
    i, j = len(x) // 2, len(y) // 2
    along = np.concatenate([[0.0], np.cumsum((zx[1:, j] + zx[:-1, j]) / 2 * np.diff(x))])
    across = np.concatenate([np.zeros((len(x), 1)), np.cumsum((zy[:, 1:] + zy[:, :-1]) / 2 * np.diff(y), axis=1)], axis=1)
    return (along - along[i])[:, None] + across - across[:, j : j + 1]


def fit_slopes(
    space: THBSpace, x: NDArray[np.float64], y: NDArray[np.float64], zx: NDArray[np.float64], zy: NDArray[np.float64]
) -> THBSurface:
    """Return the THB surface over x, y in mm whose slopes fit (zx, zy) on a grid best.

    Least squares by conjugate gradients in the multilevel system.  The constant that slopes
    leave open is chosen so that the greatest and the least coefficient are opposite.
    """
    basis, embedding = MultilevelBasis(space), space.embedding
    (a0, a1), (b0, b1) = ((kv.collocation(s), kv.collocation(s, 1)) for kv, s in ((embedding.kv_u, x), (embedding.kv_v, y)))
    a0t, a1t, b0t, b1t = (m.T.tocsr() for m in (a0, a1, b0, b1))

    def transposed(gx: NDArray[np.float64], gy: NDArray[np.float64]) -> NDArray[np.float64]:
        net = a1t @ (b0t @ gx.T).T + a0t @ (b1t @ gy.T).T
        return basis.adjoint(embedding.adjoint(net))

    def normal(weights: NDArray[np.float64]) -> NDArray[np.float64]:
        net = embedding.coefficients(basis.coefficients(weights))
        return transposed((b0 @ (a1 @ net).T).T, (b1 @ (a0 @ net).T).T)

    system = LinearOperator((basis.size, basis.size), matvec=normal, dtype=np.float64)
    weights, _ = cg(system, transposed(zx, zy), rtol=1e-8, maxiter=FIT_STEPS)
    c = basis.coefficients(weights)
    return THBSurface(space, c - (c.max() + c.min()) / 2)
