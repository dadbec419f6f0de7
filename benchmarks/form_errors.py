"""Form errors on the lens of the picture: the local formula against exact traces by period, and times.

Run: thbcad bench form_errors
"""

from __future__ import annotations

import tempfile
from functools import partial
from math import sqrt
from pathlib import Path
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from benchmarks.checkout import EXAMPLES
from benchmarks.designs.design_run import run_design
from benchmarks.rows.row import Row, median_seconds
from optics.base.runtime import Backend, load_backend
from optics.interface.api import Design
from optics.tolerancing.form_errors import (
    BandFormula,
    LocalFormula,
    form_errors_of,
    local_formula_of,
    pixel_mtf,
)
from optics.tolerancing.perturbations import HeightSum, Sine, random_field

PERIODS = (25.0, 10.0, 5.0, 2.0, 1.0)  # mm
CELLS = (1024, 1024)
DIRECTION, PHASE = 30.0, 0.3  # of ripples along no axis
TENTH = 0.1  # pixels, rms, by which a ripple moves the light
SHIFTS = (0.01, 0.03, 0.1, 0.3)  # pixels
FIRST_TERM = 0.037  # rms of the curvature term alone
COSTS = {25.0: 0.085, 10.0: 0.048, 5.0: 0.040}  # with transport, of an earlier lens of the same picture
DIRECTIONS = (10.0, 55.0, 100.0, 145.0)
MTF = {1.0: 0.79, 0.5: 0.31}  # at the mean magnification
RISE = 0.01
WITHIN = 0.1
REPEATS = 3
CHANGE, MOVED, LINEAR, TERMS = (
    "change of the irradiance",
    "landing points moved by the formula",
    "first order, exact pixels",
    "curvature and transport term",
)

Floats = NDArray[np.float64]


def rows() -> list[Row]:
    """Return the measured rows."""
    backend = load_backend("double")
    with tempfile.TemporaryDirectory() as folder:
        run_design(EXAMPLES / "pearl.toml", Path(folder) / "pearl")
        return _of_design(Design.load(Path(folder) / "pearl"), backend)


def _of_design(design: Design, backend: Backend) -> list[Row]:
    """Return the rows of a design, whose folder is still there."""
    formulas = {side: local_formula_of(design.system, side, backend, CELLS) for side in ("rear", "front")}
    rear = formulas["rear"]
    return [
        *(row for side, formula in formulas.items() for row in _by_period(side, formula)),
        *_times(rear),
        *_by_shift(rear),
        *_costs(rear),
        *_mtf(rear),
        *_allowed(design, backend),
        _field_time(),
    ]


def _by_period(side: str, formula: LocalFormula) -> list[Row]:
    """Return the error of the formula at a tenth of a pixel, by period."""
    out = []
    for period in PERIODS:
        error = _ripple(formula, period, TENTH)
        exact = formula.traced_irradiance(error) - formula.irradiance
        for method, limit in ((MOVED, WITHIN), (LINEAR, None), (TERMS, None)):
            found, name = _change(formula, error, method), f"{side}, period {period:g} mm, {method}"
            off, norm = _norm(found - exact) / _norm(exact), _norm(found) / _norm(exact)
            for what, value, most in (("error", off, limit), ("norm / traced norm", norm, None)):
                row = Row(
                    f"{name}: {what}", value, "", "exact trace", most, quantity=CHANGE, estimator=method
                )
                out.append(row)
    return out


def _times(formula: LocalFormula) -> list[Row]:
    """Return how long each method takes for one error, with as many cells as the errors have."""
    error = _ripple(formula, PERIODS[0], TENTH)
    out = [Row("exact trace: time", median_seconds(lambda: formula.traced_irradiance(error), REPEATS), "s")]
    for method in (MOVED, LINEAR, TERMS):
        seconds = median_seconds(partial(_change, formula, error, method), REPEATS)
        out.append(Row(f"{method}: time", seconds, "s"))
    return out


def _by_shift(formula: LocalFormula) -> list[Row]:
    """Return where the first order breaks down: its error by how far the light moves."""
    out = []
    for shift in SHIFTS:
        error = _ripple(formula, 10.0, shift)
        exact = formula.traced_irradiance(error) - formula.irradiance
        for method in (MOVED, LINEAR):
            off = _norm(_change(formula, error, method) - exact) / _norm(exact)
            name = f"rear, period 10 mm, light moved by {shift:g} pixels, {method}: error"
            out.append(Row(name, off, "", "exact trace", quantity=CHANGE, estimator=method))
    return out


def _costs(formula: LocalFormula) -> list[Row]:
    """Return what ripples cost whose curvature term alone is the same, rms over directions."""
    out = []
    for period, reference in COSTS.items():
        change = BandFormula(formula).change((0.99 * period, 1.01 * period))
        amplitude = FIRST_TERM * sqrt(2 / change.curvature) / change.norm
        ripples = [Sine(amplitude, period, direction, PHASE) for direction in DIRECTIONS]
        costs = [_norm(formula.traced_irradiance(r) - formula.irradiance) for r in ripples]
        value = float(np.sqrt(np.mean(np.square(costs)))) / _norm(formula.irradiance)
        name = f"rear, period {period:g} mm, curvature term of 3.7 % alone: change of the light"
        out.append(Row(name, value, "", f"{reference:g} expected", quantity=CHANGE, estimator="exact trace"))
    return out


def _mtf(formula: LocalFormula) -> list[Row]:
    """Return what the pixels leave of short ripples, at the mean magnification and over the light."""
    size = np.ptp(formula.trace.cells.s)
    magnification = 2 * formula.screen.half_width[0] / size
    out = []
    for period, reference in MTF.items():
        middle = float(
            pixel_mtf((np.float64(1 / (period * magnification)), np.float64(0.0)), formula.screen.pitch)
        )
        out += [
            Row(f"MTF at {period:g} mm, mean magnification", middle, "", f"{reference:g} expected"),
            Row(
                f"MTF at {period:g} mm, rms over the light and all directions",
                BandFormula(formula).change((0.99 * period, 1.01 * period)).mtf,
            ),
        ]
    return out


def _allowed(design: Design, backend: Backend) -> list[Row]:
    """Return what each band may have, the formula beside the probes, and the rise that this brings."""
    start = perf_counter()
    errors = form_errors_of(design.system, backend, RISE)
    out = [Row("all bands of front and rear: time", perf_counter() - start, "s")]
    for cost in errors.sides:
        for band in cost.bands:
            name = f"{cost.side}, {band.band[0]:g} to {band.band[1]:g} mm"
            out += [
                Row(f"{name}: allowed rms", 1e6 * band.allowed_rms, "nm", f"rise of rel_l2 by {RISE:g}"),
                Row(f"{name}: formula / random probes", band.by_formula / band.change_per_mm),
                Row(
                    f"{name}: rise that the allowed rms brings",
                    band.traced_rel_l2 - errors.rel_l2,
                    "",
                    f"{RISE:g} asked for",
                    quantity="rel_l2",
                    estimator="exact trace of one field",
                ),
            ]
    return out


def _field_time() -> Row:
    """Return how long the jet of a random field takes."""
    field = random_field((2.0, 5.0), 1e-5, (50.0, 50.0), 0)
    x, y = np.random.default_rng(0).uniform(-50, 50, (2, 512 * 512))
    return Row(
        "jet of a random field at 512 x 512 points", median_seconds(lambda: field.jet(x, y), 5), "s", "", 0.05
    )


def _ripple(formula: LocalFormula, period: float, shift: float) -> HeightSum:
    """Return a ripple that moves the light by so many pixels, rms."""
    one = Sine(1e-3, period, DIRECTION, PHASE)
    moved = np.square(formula.displacement(one)).sum(axis=0).mean() / formula.screen.pixel_area
    return HeightSum(((shift / sqrt(moved), one),))


def _change(formula: LocalFormula, error: HeightSum, method: str) -> Floats:
    if method == MOVED:
        return formula.moved_irradiance(error) - formula.irradiance
    return formula.linear_change(error) if method == LINEAR else formula.change(error)


def _norm(image: Floats) -> float:
    return float(np.linalg.norm(image))
