"""The change of light at a fixed pixel by a small height error, place by place.

A height error dh moves a ray's landing point by

    d = M grad dh + m dh.

M is the landing point by the slope.  Of a rear it is L dtan/dslope, with the local throw L and Snell's
Jacobian at the local slope; that of a front contains the way through the rear.  m is the landing point by the
height.  Both are central differences of the exact trace.  Light of the irradiance E that moves by d changes
at a fixed point of the target by dE = -div(E d), or with the map T from the lens to the target

    dE / E = -tr(DT^-1 D d) - d . grad ln E,

the curvature term and the transport term.  `LocalFormula` has three ways from d to pixels:

    moved_irradiance  the cells of the source, moved by d: all orders in d, pixels are exact
    linear_change     -div(E d) of these cells, to first order in d; pixels are exact
    change            the two terms, of T and E as pixels see them: the first is pushed through T to the
                      pixels, the second uses the gradient of the pixels' own image
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.ndimage import gaussian_filter

from optics.base.runtime import Backend, UserError
from optics.scene.paths import HeightError
from optics.scene.receivers import Screen
from optics.scene.system import System
from optics.tolerancing.form_errors.form_trace import ConstantJet, Floats, FormTrace, Traced, form_trace

STEP = 1e-5  # of the source's extent, mm and slopes, in central differences: errors below 1e-8
INSIDE = 1e-4  # of the source's extent, by which cells end before its rim: rays beside it are traced too
SEEN = 1.0  # pixels: the Gaussian width to which T is smoothed; structure within a pixel folds light there
DARK = 1e-6  # of the mean irradiance: below it light has no relative change
SIDES = ("front", "rear")


@dataclass(frozen=True, eq=False)
class LocalFormula:
    """The local formula of front or rear on the cells of a source, see the module.

    by_source : D T, (2, 2, nx + 1, ny + 1), of landing points by the source's parameters.
    surface : U, of the surface's x and y by these.  by_slope, by_height : M and m, (2, 2, ...) and (2, ...).
    """

    side: str
    trace: FormTrace
    screen: Screen
    nominal: Traced
    by_source: Floats
    surface: Floats
    by_slope: Floats
    by_height: Floats

    @property
    def points(self) -> Floats:
        """x and y of the surface where the corners meet it, (2, nx + 1, ny + 1) mm."""
        return self.nominal.front if self.side == "front" else self.nominal.rear

    def displacement(self, error: HeightError) -> Floats:
        """Return d, (2, nx + 1, ny + 1), mm or degrees: how far landing points move."""
        x, y = self.points
        dh, by_x, by_y = error.jet(x.ravel(), y.ravel()).reshape(3, *x.shape)
        return self.by_slope[:, 0] * by_x + self.by_slope[:, 1] * by_y + self.by_height * dh

    @cached_property
    def shown(self) -> Floats:
        """Irradiance per picture, (rows, columns): in the far field intensities are compared."""
        return self.screen.projection()

    @cached_property
    def irradiance(self) -> Floats:
        """The irradiance without error, (rows, columns) W/mm^2."""
        return self.trace.irradiance(self.nominal, self.screen)

    def traced_irradiance(self, error: HeightError) -> Floats:
        """Return the irradiance with the error by an exact trace, (rows, columns) W/mm^2."""
        return self.trace.irradiance(self.trace.traced(**{self.side: error}), self.screen)

    def moved_irradiance(self, error: HeightError) -> Floats:
        """Return the irradiance of landing points that are moved by d, (rows, columns) W/mm^2."""
        moved = self.nominal.landing + self.displacement(error)
        return self.trace.irradiance(replace(self.nominal, landing=moved), self.screen)

    def linear_change(self, error: HeightError) -> Floats:
        """Return -div(E d) on pixels, (rows, columns) W/mm^2."""
        return self.trace.irradiance_change(self.nominal, self.screen, self.displacement(error))

    def change(self, error: HeightError) -> Floats:
        """Return dE by the curvature term and the transport term, (rows, columns) W/mm^2."""
        d, emitted = self.displacement(error), self.trace.cells.emitted
        cells = self.trace.cells
        by_s, by_t = differences(d, cells.s, cells.t)
        parts = np.stack([by_s, by_t], axis=1)  # D d, (2, 2, nx, ny)
        first = sum(solved(self.seen, parts[:, i])[i] for i in (0, 1))
        pushed = self.trace.irradiance(self.nominal, self.screen, -emitted * np.nan_to_num(first))
        carried = [
            self.trace.irradiance(self.nominal, self.screen, emitted * np.nan_to_num(middles(a))) for a in d
        ]
        by_x, by_y = gradient(self.irradiance, self.screen)
        lit = np.maximum(self.irradiance, DARK * self.irradiance.mean())
        return np.asarray(pushed - (carried[0] * by_x + carried[1] * by_y) / lit)

    @cached_property
    def seen(self) -> Floats:
        """DT on the cells as pixels see it, (2, 2, nx, ny): smoothed over the width of one on the source."""
        matrices, cells = middles(self.by_source), self.trace.cells
        known = np.isfinite(matrices).all(axis=(0, 1))
        area = np.abs(np.linalg.det(np.moveaxis(matrices, (0, 1), (-2, -1))[known]))
        wide = np.sqrt(self.screen.pixel_area / np.median(area))  # of a pixel, in the source's parameters
        width = [SEEN * wide / (a[1] - a[0]) for a in (cells.s, cells.t)]
        weight = gaussian_filter(known.astype(np.float64), width, mode="nearest")
        filled = np.where(known, matrices, 0.0)
        smooth = gaussian_filter(filled, (0, 0, *width), mode="nearest")
        return np.asarray(np.where(known, smooth / np.where(known, weight, 1.0), np.nan))


def local_formula_of(system: System, side: str, backend: Backend, counts: tuple[int, int]) -> LocalFormula:
    """Return the LocalFormula of a lens.

    side : "front" or "rear".  backend : of double precision.  counts : (nx, ny) cells of the source.

    Raises UserError : another side, an extended or blurred source.
    """
    if side not in SIDES:
        raise UserError(f'the side of a form error must be "front" or "rear", got {side!r}')
    trace, nominal = _traced_inside(form_trace(system, backend, counts))
    cells = trace.cells

    def derivative(before: Traced, after: Traced, step: float) -> Floats:
        lost = (before.passing == 0) | (after.passing == 0)
        moves = [after.landing - before.landing, getattr(after, side) - getattr(before, side)]
        return np.where(lost, np.nan, np.concatenate(moves) / (2 * step))

    def by_shift(s: float, t: float) -> Floats:
        return derivative(trace.moved(-s, -t).traced(), trace.moved(s, t).traced(), s + t)

    def by_jet(k: int) -> Floats:
        unit = STEP * np.eye(3)[k]
        before, after = (trace.traced(**{side: ConstantJet(*(sign * unit))}) for sign in (-1, 1))
        return derivative(before, after, STEP)[:2]

    steps = [STEP * float(np.ptp(a)) for a in (cells.s, cells.t)]
    moves = np.stack([by_shift(steps[0], 0.0), by_shift(0.0, steps[1])], axis=1)
    return LocalFormula(
        side=side,
        trace=trace,
        screen=system.target.screen(),
        nominal=nominal,
        by_source=moves[:2],
        surface=moves[2:],
        by_slope=np.stack([by_jet(1), by_jet(2)], axis=1),
        by_height=by_jet(0),
    )


def middles(corners: Floats) -> Floats:
    """Return the means over the four corners of cells, (..., nx, ny)."""
    along = corners[..., 1:, :] + corners[..., :-1, :]
    return np.asarray((along[..., 1:] + along[..., :-1]) / 4)


def differences(corners: Floats, s: Floats, t: Floats) -> tuple[Floats, Floats]:
    """Return the derivatives by s and t on cells, each (..., nx, ny), of values at their corners."""
    by_s = np.diff(corners, axis=-2) / np.diff(s)[:, None]
    by_t = np.diff(corners, axis=-1) / np.diff(t)
    return (by_s[..., 1:] + by_s[..., :-1]) / 2, (by_t[..., 1:, :] + by_t[..., :-1, :]) / 2


def gradient(image: Floats, screen: Screen) -> tuple[Floats, Floats]:
    """Return the derivatives by x and y of an image on a screen's pixels, by central differences."""
    by_row, by_column = np.gradient(image)
    return np.asarray(by_column / screen.pitch[0]), np.asarray(-by_row / screen.pitch[1])


def solved(matrix: Floats, vector: Floats) -> Floats:
    """Return the solutions of 2 x 2 systems, (2, ...); not finite at folds."""
    (a, b), (c, d) = matrix
    x, y = vector
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.stack([d * x - b * y, a * y - c * x]) / (a * d - b * c)


def _traced_inside(trace: FormTrace) -> tuple[FormTrace, Traced]:
    """Return a trace and where its corners go; cells that reach to a rim of the lens end a little before it.

    They do where corners that are moved outwards no longer arrive.
    """
    nominal, beyond = trace.traced(), _scaled(trace, 1 + INSIDE).traced()
    arriving = (trace.cells.emitted > 0) & (middles(nominal.passing) > 0)
    along = np.minimum(beyond.passing[1:], beyond.passing[:-1])
    least = np.minimum(along[:, 1:], along[:, :-1])  # of the four corners of cells
    if not (arriving & (least == 0)).any():
        return trace, nominal
    inside = _scaled(trace, 1 - INSIDE)
    return inside, inside.traced()


def _scaled(trace: FormTrace, factor: float) -> FormTrace:
    """Return the trace of cells whose parameters are larger or smaller."""
    s, t = (factor * a for a in (trace.cells.s, trace.cells.t))
    return replace(trace, cells=replace(trace.cells, s=s, t=t))
