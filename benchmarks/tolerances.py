"""Perturbed lenses: what is predicted beside what is traced, and the time of exact traces.

Run: thbcad bench tolerances
"""

from __future__ import annotations

import resource
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from benchmarks.checkout import EXAMPLES
from benchmarks.designs.design_run import run_design
from benchmarks.rows.row import Row, median_seconds
from optics import Design
from optics.base.runtime import Backend, load_backend
from optics.light.analysis import rel_l2
from optics.tolerancing.perturbations import (
    LinearLight,
    Perturbation,
    PerturbedLight,
    Tolerance,
    tolerances_of,
)

Floats = NDArray[np.float64]

TENTH, THOUSANDTH = 0.1, 0.001  # of a pixel
CLOSE = 0.02  # of the norm of a change: what a prediction may miss of it
FINE = 12  # cells per pixel in each direction, which leave a hundredth of such a change open
TRACES, TIMED, MOST_SECONDS, MOST_MB = 512, 64, 120.0, 1000.0
SUMS = 8  # of all tolerances, with random signs


def rows() -> list[Row]:
    """Return the measured rows."""
    backend = load_backend("double", 1)
    with tempfile.TemporaryDirectory() as folder:
        for name in ("pearl", "folded"):
            run_design(EXAMPLES / f"{name}.toml", Path(folder) / name)
        pearl, folded = (Design.load(Path(folder) / name) for name in ("pearl", "folded"))
        return [*_pearl_rows(pearl, backend), *_folded_rows(folded, backend)]


def _pearl_rows(design: Design, backend: Backend) -> list[Row]:
    system, target = design.system, design.measurement.target
    light = PerturbedLight(system.with_lens(design.lens), backend)
    linear = LinearLight(light)
    own, measured = rel_l2(linear.irradiance, target), design.metrics["rel_l2_sequential"]
    error = abs(own - measured)
    out = [Row("pearl: rel_l2 without perturbation", own, "", f"measure() {measured:.5f}", error=error)]
    chosen = tolerances_of(system)
    out.extend(_prediction_row(tolerance, light, linear) for tolerance in chosen)
    small = _moving(light, chosen[0], THOUSANDTH)
    difference = (light(small)[0] - light(-small)[0]) / 2
    out.append(
        Row(
            f"pearl: J p of {chosen[0].name} at a thousandth of a pixel",
            _off(linear.derivative(small), difference),
            "",
            "symmetric difference of exact traces",
            CLOSE,
            quantity="change of the image",
        )
    )
    sliding = [t for t in chosen if _slides(light, linear, t)]
    return [*out, *_sums(light, linear, chosen, target), *_times(light, chosen), *_fine_rows(light, sliding)]


def _folded_rows(design: Design, backend: Backend) -> Iterator[Row]:
    """Yield the rows of a lens before a plane mirror, each element by itself."""
    light = PerturbedLight(design.system, backend)
    linear = LinearLight(light)
    for tolerance in tolerances_of(design.system):
        yield _prediction_row(tolerance, light, linear, "folded")


def _prediction_row(
    tolerance: Tolerance, light: PerturbedLight, linear: LinearLight, name: str = "pearl"
) -> Row:
    """Return the error of the predicted change of the image, relative to the traced change."""
    p = _moving(light, tolerance, TENTH)
    traced = _change(linear.traced(p), linear)
    return Row(
        f"{name}: change by {tolerance.name} at a tenth of a pixel",
        _off(_change(_ahead(linear, p), linear), traced),
        "",
        f"exact trace of the same cells; J p {_off(linear.derivative(p), traced):.3f}",
        CLOSE,
        quantity="change of the image, error relative to the traced change",
        estimator="landing points by their derivatives, exact pixels",
    )


def _slides(light: PerturbedLight, linear: LinearLight, tolerance: Tolerance) -> bool:
    """Whether cells that slide over the lens are too large to tell so small a change."""
    p = _moving(light, tolerance, TENTH)
    return _off(_change(linear.traced(p), linear), _change(light(p)[0], linear)) > CLOSE / 2


def _fine_rows(usual: PerturbedLight, sliding: Sequence[Tolerance]) -> Iterator[Row]:
    """Yield predictions beside exact traces of other cells, which are as many as such changes ask for."""
    light = PerturbedLight(usual.system, load_backend("double", 2), FINE)
    linear = LinearLight(light)
    for tolerance in sliding:
        p = _moving(light, tolerance, TENTH)
        yield Row(
            f"pearl: change by {tolerance.name} at a tenth of a pixel, {FINE} cells per pixel",
            _off(_change(_ahead(linear, p), linear), _change(light(p)[0], linear)),
            "",
            "exact trace of cells that slide over the lens",
            CLOSE,
            quantity="change of the image, error relative to the traced change",
            estimator="landing points by their derivatives, exact pixels",
        )


def _ahead(linear: LinearLight, p: Perturbation) -> Floats | None:
    """Return the light that is predicted for a perturbation."""
    moved = linear.moved(p)
    return None if moved is None else moved[1]


def _change(image: Floats | None, linear: LinearLight) -> Floats:
    """Return what is added to the light of the design."""
    assert image is not None
    return image - linear.irradiance


def _sums(
    light: PerturbedLight, linear: LinearLight, chosen: tuple[Tolerance, ...], target: Floats
) -> Iterator[Row]:
    """Yield how well rel_l2 of lenses with everything wrong is predicted."""
    scaled = linear.irradiance / linear.irradiance.mean()
    parts = []
    for tolerance in chosen:
        p = _moving(light, tolerance, TENTH)
        behind, ahead = ((e := light(s * p)[0]) / e.mean() - scaled for s in (-1, 1))
        parts.append((p, (ahead - behind) / 2, (ahead + behind) / 2))
    fresh, added, moved = np.random.default_rng(1), [], []
    for _ in range(SUMS):
        amounts = fresh.uniform(-1, 1, len(parts))
        p = sum((a * part[0] for a, part in zip(amounts, parts)), Perturbation())
        predicted = scaled + sum(a * part[1] + a**2 * part[2] for a, part in zip(amounts, parts))
        traced = rel_l2(light(p)[0], target)
        added.append(abs(rel_l2(predicted, target) / traced - 1))
        moved.append(abs(rel_l2(_change(_ahead(linear, p), linear) + linear.irradiance, target) / traced - 1))
    for name, errors, estimator in (
        (
            f"pearl: rel_l2 of {SUMS} random sums of all, each within a tenth of a pixel, greatest error",
            moved,
            "landing points by their derivatives, exact pixels",
        ),
        ("  by the changes of single tolerances, added", added, "changes through finite traces"),
    ):
        yield Row(name, max(errors), "", "exact traces", quantity="rel_l2, relative", estimator=estimator)


def _times(light: PerturbedLight, chosen: tuple[Tolerance, ...]) -> Iterator[Row]:
    shift = Perturbation(lens_shift=(0.05, 0.02, 0.01), index=1e-4)
    tilt = Perturbation(lens_tilt=(1e-3, 1e-3, 1e-3))
    yield Row(
        "pearl: one exact trace, shifted lens, 1 thread", 1e3 * median_seconds(lambda: light(shift), 5), "ms"
    )
    yield Row(
        "pearl: one exact trace, tilted lens, 1 thread", 1e3 * median_seconds(lambda: light(tilt), 5), "ms"
    )
    both = PerturbedLight(light.system, load_backend("double", 2))
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


def _off(found: Floats | None, traced: Floats) -> float:
    assert found is not None
    return float(np.linalg.norm(found - traced) / np.linalg.norm(traced))
