"""Perturbed lenses: what is predicted beside what is traced, and the time of exact traces.

Run: thbcad bench tolerances
"""

from __future__ import annotations

import resource
import tempfile
from collections.abc import Iterator
from pathlib import Path
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from benchmarks.checkout import EXAMPLES
from benchmarks.designs.design_run import run_design
from optics import Design, Front, LensSpec, Problem, Rear, Source, Target
from optics.analysis import rel_l2
from optics.runtime import Backend, Row, load_backend, median_seconds
from optics.system import OpticalSystem
from optics.tolerancing import LinearLight, Perturbation, PerturbedLight, Tolerance, tolerances_of

Floats = NDArray[np.float64]

TENTH, THOUSANDTH = 0.1, 0.001  # of a pixel
CLOSE = 0.02  # of the norm of a change: what a prediction may miss of it
TRACES, TIMED, MOST_SECONDS, MOST_MB = 512, 64, 120.0, 1000.0
SUMS = 8  # of all tolerances, with random signs
FINE = 16  # cells in a pixel, of the smooth light
TURNS = ("tilt_z", "target.tilt")  # move round light not at all, or by the square of the angle


def rows() -> list[Row]:
    """Return the measured rows."""
    backend = load_backend("double", 1)
    out = _smooth_rows(backend)
    with tempfile.TemporaryDirectory() as folder:
        run_design(EXAMPLES / "pearl.toml", Path(folder) / "pearl")
        design = Design.load(Path(folder) / "pearl")
        out += _pearl_rows(design, backend)
    return out


def _smooth_rows(backend: Backend) -> list[Row]:
    """Return the errors of predictions for a Gaussian beam through a paraboloid."""
    system = OpticalSystem(
        Problem(
            source=Source(kind="collimated", half_width=(6.5, 6.5), profile="gaussian", sigma=(0.25, 0.25)),
            lens=LensSpec(
                index=1.5,
                thickness=6.0,
                front=Front(half_width=(10.0, 10.0)),
                rear=Rear(half_width=(10.0, 10.0), radius=40.0, conic=-1.0),
            ),
            target=Target(kind="tophat", distance=60.0, half_width=(15.0, 15.0), pixels=(48, 48)),
        )
    )
    light = PerturbedLight(system, system.lens, backend, FINE)
    linear, out = LinearLight(light), []
    for tolerance in tolerances_of(system):
        if not any(turn in tolerance.name for turn in TURNS):
            p = _moving(light, tolerance, TENTH)
            out.append(_derivative_row("smooth light", tolerance, light, linear, p, CLOSE))
    return out


def _pearl_rows(design: Design, backend: Backend) -> list[Row]:
    system, target = design.system, design.measurement.target
    light = PerturbedLight(system, design.lens, backend)
    linear = LinearLight(light)
    own, measured = rel_l2(linear.irradiance, target), design.metrics["rel_l2_sequential"]
    error = abs(own - measured)
    out = [Row("pearl: rel_l2 without perturbation", own, "", f"measure() {measured:.5f}", error=error)]
    chosen = tolerances_of(system)
    for tolerance in chosen:
        out.append(
            _derivative_row("pearl", tolerance, light, linear, _moving(light, tolerance, TENTH), CLOSE)
        )
    small = _moving(light, chosen[0], THOUSANDTH)
    difference = (light(small)[0] - light(-small)[0]) / 2
    derivative = linear.derivative(small)
    assert derivative is not None
    out.append(
        Row(
            f"pearl: J p of {chosen[0].name} at a thousandth of a pixel",
            _off(derivative.first, difference),
            "",
            "symmetric difference of exact traces",
            CLOSE,
            quantity="change of the image",
        )
    )
    return [*out, *_sums(light, linear, chosen, target), *_times(light, chosen)]


def _derivative_row(
    of: str,
    tolerance: Tolerance,
    light: PerturbedLight,
    linear: LinearLight,
    p: Perturbation,
    limit: float,
) -> Row:
    """Return the error of the predicted change of the image, relative to the traced change."""
    change = linear.derivative(p)
    assert change is not None
    traced = light(p)[0] - linear.irradiance
    return Row(
        f"{of}: change by {tolerance.name} at a tenth of a pixel",
        _off(change.at(1.0), traced),
        "",
        f"J p alone {_off(change.first, traced):.3f}",
        limit,
        quantity="change of the image, error relative to the traced change",
        estimator="J p + S p^2 by the derivative of mapped cells",
    )


def _sums(
    light: PerturbedLight, linear: LinearLight, chosen: tuple[Tolerance, ...], target: Floats
) -> Iterator[Row]:
    """Yield how well changes through finite traces add up to rel_l2 of lenses with everything wrong."""
    scaled = linear.irradiance / linear.irradiance.mean()
    parts = []
    for tolerance in chosen:
        p = _moving(light, tolerance, TENTH)
        behind, ahead = ((e := light(s * p)[0]) / e.mean() - scaled for s in (-1, 1))
        parts.append((p, (ahead - behind) / 2, (ahead + behind) / 2))
    fresh, errors = np.random.default_rng(1), []
    for _ in range(SUMS):
        amounts = fresh.uniform(-1, 1, len(parts))
        p = sum((a * part[0] for a, part in zip(amounts, parts)), Perturbation())
        predicted = scaled + sum(a * part[1] + a**2 * part[2] for a, part in zip(amounts, parts))
        traced = rel_l2(light(p)[0], target)
        errors.append(abs(rel_l2(predicted, target) / traced - 1))
    yield Row(
        f"pearl: rel_l2 of {SUMS} random sums of all, each within a tenth of a pixel, greatest error",
        max(errors),
        "",
        "exact traces",
        quantity="rel_l2, relative",
        estimator="changes through finite traces, added",
    )


def _times(light: PerturbedLight, chosen: tuple[Tolerance, ...]) -> Iterator[Row]:
    shift = Perturbation(lens_shift=(0.05, 0.02, 0.01), index=1e-4)
    tilt = Perturbation(lens_tilt=(1e-3, 1e-3, 1e-3))
    yield Row(
        "pearl: one exact trace, shifted lens, 1 thread", 1e3 * median_seconds(lambda: light(shift), 5), "ms"
    )
    yield Row(
        "pearl: one exact trace, tilted lens, 1 thread", 1e3 * median_seconds(lambda: light(tilt), 5), "ms"
    )
    both = PerturbedLight(light.system, light.lens, load_backend("double", 2))
    fresh, start = np.random.default_rng(2), perf_counter()
    for _ in range(TIMED):
        both(sum((t.at(fresh.uniform(-1, 1) * t.amount) for t in chosen), Perturbation()))
    seconds = (perf_counter() - start) * TRACES / TIMED
    yield Row(
        f"pearl: {TRACES} exact traces with everything wrong, 2 threads",
        seconds,
        "s",
        f"{TIMED} of them, in proportion",
        MOST_SECONDS,
        extrapolated=True,
    )
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    yield Row("  peak memory of this process", peak, "MB", "", MOST_MB)


def _moving(light: PerturbedLight, tolerance: Tolerance, pixels: float) -> Perturbation:
    """Return the perturbation by a tolerance that moves the light so far."""
    p = tolerance.at(tolerance.amount)
    return p * (pixels * float(np.mean(light.screen.pitch)) / light.moved_by(p))


def _off(found: Floats, traced: Floats) -> float:
    return float(np.linalg.norm(found - traced) / np.linalg.norm(traced))
