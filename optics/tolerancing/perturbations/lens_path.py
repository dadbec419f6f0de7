"""Corners of a source's cells that stay on the lens while a perturbation makes light slide over it.

At fixed (s, t) of the source, light meets a free surface at u(s, t; a) for the amount a of a perturbation.
Corners that start at

    (s, t) - a (du / d(s, t))^-1 du/da

stay on the surface to first order.  Where they land is then as smooth in a as the rest of the system: knots,
at which the surface has jumps of its third derivatives, do not move past them.

Light keeps its border: there corners rest, and behind it they set off smoothly.  A cell whose corners move
has the flux of what it covers then.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import RectBivariateSpline
from scipy.ndimage import distance_transform_edt

from optics.scene.sources import SourceCells
from optics.tolerancing.perturbations.perturbation import NOMINAL, Perturbation
from optics.tolerancing.perturbations.traced_light import PerturbedLight
from thbcad.checks import Floats

SAMPLES = 65  # in each direction: light slides over the whole lens in much the same way
STEP = 0.5  # of the perturbation, for differences
RESTING = 2  # cells at the border, which round light cuts
GENTLE = 4.0  # cells become at most a quarter smaller where they set off


@dataclass(frozen=True, eq=False)
class LensPath:
    """How far corners move with the lens for the amount 1 of a perturbation: ds, dt (nx + 1, ny + 1)."""

    ds: Floats
    dt: Floats

    def rows(self, first: int, count: int) -> LensPath:
        """Return the path of corners first, first + 1 ... along s."""
        part = slice(first, first + count)
        return LensPath(self.ds[part], self.dt[part])

    def corners(self, cells: SourceCells, amount: float) -> tuple[Floats, Floats]:
        """Return s and t of the corners of cells, (nx + 1, ny + 1) each."""
        s, t = np.meshgrid(cells.s, cells.t, indexing="ij")
        return s + amount * self.ds, t + amount * self.dt

    def emitted(self, cells: SourceCells, amount: float) -> Floats:
        """Return the flux that cells emit where they are for an amount, (nx, ny)."""
        areas, densities = [], []
        for a in (0.0, amount):
            s, t = self.corners(cells, a)
            # the areas of quadrilaterals, by their diagonals
            s1, t1 = s[1:, 1:] - s[:-1, :-1], t[1:, 1:] - t[:-1, :-1]
            s2, t2 = s[:-1, 1:] - s[1:, :-1], t[:-1, 1:] - t[1:, :-1]
            areas.append((s1 * t2 - s2 * t1) / 2)
            densities.append(cells.density(_middles(s).ravel(), _middles(t).ravel()).reshape(areas[0].shape))
        lit = densities[0] > 0
        brighter = np.divide(densities[1], densities[0], out=np.ones_like(densities[0]), where=lit)
        return np.asarray(cells.emitted * np.maximum(areas[1] / areas[0], 0.0) * brighter)


class LensPaths:
    """The paths on which corners stay on the rear, or on a front that alone is free, by Perturbation.

    Those of a source with a picture for its light rest: what moved cells cover of it is not smooth.
    """

    def __init__(self, light: PerturbedLight) -> None:
        self._light, self._cells = light, light.cells
        self._s, self._t = (np.linspace(v[0], v[-1], SAMPLES) for v in (light.cells.s, light.cells.t))

    def __call__(self, perturbation: Perturbation) -> LensPath:
        if self._light.system.problem.source.profile == "image":
            still = np.zeros([n + 1 for n in self._cells.emitted.shape])
            return LensPath(still, still)
        s, t = self._s, self._t
        behind, ahead = (self._light.on_lens(a * perturbation, s, t) for a in (-STEP, STEP))
        slide = (ahead - behind) / (2 * STEP)
        (xs, xt), (ys, yt) = self._rates
        with np.errstate(divide="ignore", invalid="ignore"):  # where no light is
            back = np.stack([xt * slide[1] - yt * slide[0], ys * slide[0] - xs * slide[1]])
            back /= xs * yt - xt * ys
        back = np.where(np.isfinite(back).all(axis=0), back, 0.0)
        setting_off = np.clip(self._depth / max(GENTLE * np.abs(back).max(), self._border), 0.0, 1.0)
        ds, dt = (setting_off * RectBivariateSpline(s, t, b)(self._cells.s, self._cells.t) for b in back)
        return LensPath(ds, dt)

    @cached_property
    def _rates(self) -> list[tuple[Floats, ...]]:
        """du / d(s, t) of the design: rows x, y, columns s, t."""
        return [np.gradient(u, self._s, self._t) for u in self._light.on_lens(NOMINAL, self._s, self._t)]

    @property
    def _border(self) -> float:
        """Width of the border in which corners rest, in the unit of s and t."""
        return RESTING * float(max(self._steps))

    @property
    def _steps(self) -> list[float]:
        """Mean widths of the cells along s and t."""
        return [float(np.diff(v).mean()) for v in (self._cells.s, self._cells.t)]

    @cached_property
    def _depth(self) -> Floats:
        """How far corners lie behind the border in which they rest, (nx + 1, ny + 1)."""
        depth = distance_transform_edt(np.pad(self._cells.emitted > 0, 1), sampling=self._steps)
        corners = np.minimum(depth[1:], depth[:-1])
        return np.asarray(np.minimum(corners[:, 1:], corners[:, :-1]) - self._border)


def _middles(corners: Floats) -> Floats:
    return (corners[1:, 1:] + corners[1:, :-1] + corners[:-1, 1:] + corners[:-1, :-1]) / 4
