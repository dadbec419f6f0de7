"""Reported errors against the true spread: small scenes, each measured with 96 seeds.

Of every number that has an error, the standard deviation over all seeds is divided by the reported error, the
root mean square over all seeds.  A right program gives 1 within 7 %, the error of 96 seeds.  The bias is the
mean over all seeds minus a reference, in reported errors.  Light by cells has no noise, so there the
difference from a finer grid is divided by the reported error.

Run: thbcad bench reported_errors
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import hypot, sqrt

import numpy as np

from benchmarks.rows.row import Row
from benchmarks.tracing.repeated_scenes import BY_CELLS, SCENES, Sample, Scene, coarser
from optics.base.runtime import NumericalError, load_backend
from optics.base.workers import WorkerPool, run_tasks, worker_pool
from optics.light.analysis import rel_l2, unit_mean
from thbcad.checks import Floats

SEEDS, WORKERS = 96, 2
LOW, HIGH = 0.8, 1.25  # of spread over reported error
ONE_IN = 35  # numbers, of which one may be outside by chance
FINER = 4  # pixels of a reference in one of the scene's, in each direction, with 16 times the rays
REFERENCES = 4  # independent ones, of seeds from FIRST on
FIRST = 1_000_000
BIASED, SURE = 0.5, 3.0  # of a reported error; standard deviations by which a bias is known
GRID = 4.0  # times its reported error, that light by cells may be off
MOST_MARGIN = 1e6  # of a zone, in its errors
MOST = 1e3  # a greater ratio, or one to no error at all, is reported as this
ROUNDING = 1e-12  # of a value, or of 1 where it is less: what differs less is the same
WITH_ERRORS = "rel_l2_debiased", "efficiency", "lit_efficiency", "stray"  # what every measurement has
# other pixels make other numbers of these, so that their reference is light on the scene's own pixels
OF_PIXELS = "rel_l2_debiased", "contrast_error", "lit_efficiency"
NO_REFERENCE = "rel_l2_sequential", "beam."


@dataclass(frozen=True)
class Spread:
    """A number as it was measured with many seeds.

    known : how many seeds gave a value.  mean, spread : of these.  reported : root mean square of the errors.
    """

    known: int
    mean: float
    spread: float
    reported: float

    @property
    def ratio(self) -> float:
        """Spread over reported error, at most MOST."""
        return min(self.spread / self.reported, MOST) if self.reported else MOST

    @property
    def outside(self) -> bool:
        return not LOW <= self.ratio <= HIGH

    @property
    def constant(self) -> bool:
        """Whether it is the same every time and has no error."""
        return self.reported <= ROUNDING and _same(self.spread, self.mean)


@dataclass(frozen=True)
class Bias:
    """How far a mean over seeds is from a reference, and how well that is known, in reported errors."""

    value: float
    error: float

    @property
    def counts(self) -> bool:
        return abs(self.value) > max(BIASED, SURE * self.error)


@dataclass(frozen=True)
class GridError:
    """A number by cells.  off : its difference from that of a finer grid.  error : as reported."""

    name: str
    value: float
    off: float
    error: float

    @property
    def ratio(self) -> float:
        """Difference over reported error, at most MOST."""
        return min(self.off / self.error, MOST) if self.error else MOST


def rows() -> list[Row]:
    """Return the measured rows."""
    out, spreads, biases, missing = list[Row](), list[Spread](), list[Bias](), list[str]()
    with worker_pool(WORKERS) as pool:
        for scene in SCENES:
            samples = samples_of(scene, SEEDS, pool)
            reference = references_of(scene, pool)
            missing += _without_errors(scene, samples)
            for name, spread in spreads_of(samples).items():
                bias = _bias(spread, reference.get(name, ()))
                out.extend(_rows_of(f"{scene.name}: {name}", spread, bias))
                spreads.append(spread)
                biases += [bias] if bias else []
        for scene in BY_CELLS:
            usual, fine = _done(scene, [(0, 1), (0, FINER)], pool)
            out.extend(_rows_by_cells(scene.name, usual, grid_errors(scene, usual, fine)))
    outside, biased = sum(s.outside for s in spreads), sum(b.counts for b in biases)
    summary = [
        Row(
            "numbers whose spread is outside 0.8 to 1.25 of the error",
            outside,
            "",
            "",
            len(spreads) // ONE_IN,
        ),
        Row("  of so many numbers", len(spreads)),
        Row(f"numbers with a bias above {BIASED} errors", biased, "", "", len(biases) // ONE_IN),
        Row("  of so many numbers with a reference", len(biases)),
        Row("numbers that have no error", len(missing), "", ", ".join(missing), 0),
    ]
    return [*summary, *out]


def samples_of(scene: Scene, seeds: int, pool: WorkerPool) -> list[Sample]:
    """Return measurements of a scene with the seeds from 0 on."""
    return _done(scene, [(seed, 1) for seed in range(seeds)], pool)


def spreads_of(samples: Sequence[Sample]) -> dict[str, Spread]:
    """Return the spread of every number that at least half of the seeds know, and that is not constant."""
    out = {}
    for name in dict.fromkeys(name for sample in samples for name in sample.numbers):
        pairs = [sample.numbers[name] for sample in samples if name in sample.numbers]
        known = np.array([pair for pair in pairs if pair[0] is not None], np.float64)
        if 2 * len(known) < len(samples):
            continue
        values, errors = known.T
        reported = sqrt(float(np.mean(errors**2)))
        spread = Spread(len(known), float(values.mean()), float(values.std(ddof=1)), reported)
        if not spread.constant:
            out[name] = spread
    return out


def references_of(scene: Scene, pool: WorkerPool) -> dict[str, list[float]]:
    """Return independent reference values of the numbers of a scene that have some, by name."""
    seeds = range(FIRST, FIRST + REFERENCES)
    fine = _done(scene, [(seed, 0 if scene.by_rays else FINER) for seed in seeds], pool)
    out = dict[str, list[float]]()
    if not scene.by_rays:
        names = set.intersection(*(set(sample.numbers) for sample in fine))
        for name in names:
            values = [value for sample in fine if (value := sample.numbers[name][0]) is not None]
            if len(values) == len(fine) and name not in OF_PIXELS and not name.startswith(NO_REFERENCE):
                out[name] = values
    images = [sample.irradiance for sample in fine if sample.irradiance is not None]
    return out | (_on_own_pixels(scene, images) if images else {})


def _on_own_pixels(scene: Scene, images: Sequence[Floats]) -> dict[str, list[float]]:
    """Return reference values of OF_PIXELS from images on the pixels of the scene or on finer ones.

    The mean product of two independent residuals is free of their noise, so that ||E - T||^2 is not biased.
    Of the pairs of all images as many are taken as there are images.
    """
    system = scene.system
    screen = system.target.screen()
    shown, target = screen.projection(), system.target.irradiance(screen, 1.0)
    fine = system.target.screen().finer(images[0].shape[0] // screen.shape[0])
    light = [coarser(image, fine.projection(), screen.shape) for image in images]
    t = unit_mean(target / shown)
    left = [unit_mean(image) - t for image in light]
    squares = [float(np.sum(a * b)) for a, b in zip(left, [*left[1:], left[0]])]
    off = [sqrt(max(square, 0.0)) / float(np.linalg.norm(t)) for square in squares]
    lit = [float((image * shown)[target > 0].sum()) * screen.pixel_area for image in light]
    contrast = rel_l2(np.ones_like(t), t)
    found = {"rel_l2_debiased": off, "lit_efficiency": [flux / system.problem.flux for flux in lit]}
    if system.target.as_picture:
        found["contrast_error"] = [value / contrast for value in off]
    return found


def measured(scene: Scene, task: tuple[int, int]) -> Sample:
    """Return a measurement of a scene; a task of a worker.

    task : (seed, pixels in one of the scene's in each direction, 0 for a reference by rays).
    """
    (seed, finer), backend = task, load_backend("double", 1)
    return scene.sample(seed, backend, finer) if finer else Sample({}, scene.by_many_rays(seed, backend))


def _same(difference: float, value: float) -> bool:
    """Return whether a difference is rounding."""
    return difference <= ROUNDING * max(abs(value), 1.0)


def _done(scene: Scene, tasks: Sequence[tuple[int, int]], pool: WorkerPool) -> list[Sample]:
    """Return what workers measured, in the order of the tasks."""
    _ = scene.lens  # made once, and sent with the scene
    found = dict[int, Sample]()
    for result in run_tasks(measured, tasks, pool, scene):
        if result.failure:
            raise NumericalError(f"{scene.name}: {result.failure}")
        found[result.index] = result.value
        print(
            f"\r{scene.name}: {len(found)} of {len(tasks)} measurements", end="", file=sys.stderr, flush=True
        )
    print(file=sys.stderr)
    return [found[k] for k in range(len(tasks))]


def _bias(spread: Spread, reference: Sequence[float]) -> Bias | None:
    """Return the bias of a number; None without a reference or without a reported error."""
    if not reference or not spread.reported:
        return None
    error = hypot(spread.spread / sqrt(spread.known), float(np.std(reference, ddof=1)) / sqrt(len(reference)))
    return Bias((spread.mean - float(np.mean(reference))) / spread.reported, error / spread.reported)


def _rows_of(name: str, spread: Spread, bias: Bias | None) -> Iterator[Row]:
    """Yield the rows of a number in a scene."""
    numbers = f"{spread.mean:.4g}, spread {spread.spread:.2g}, reported {spread.reported:.2g}"
    remark = "; outside" if spread.outside else ""
    yield Row(name, spread.ratio, "", f"{LOW} to {HIGH} of {spread.known} seeds{remark}; {numbers}")
    if bias is not None:
        yield Row("  bias, in reported errors", bias.value, "", f"known to {bias.error:.2g}")


def _without_errors(scene: Scene, samples: Sequence[Sample]) -> list[str]:
    """Return the numbers of a scene that have no error and should have one."""
    if scene.road:
        return []
    return [f"{scene.name}: {name}" for name in WITH_ERRORS if name not in samples[0].numbers]


def grid_errors(scene: Scene, usual: Sample, fine: Sample) -> list[GridError]:
    """Return how far numbers by cells are from those of a finer grid, where that is no rounding."""
    assert fine.irradiance is not None
    truth = {name: value for name, (value, _) in fine.numbers.items() if not name.startswith(NO_REFERENCE)}
    truth |= {name: values[0] for name, values in _on_own_pixels(scene, [fine.irradiance]).items()}
    out = []
    for name, (value, error) in usual.numbers.items():
        true = truth.get(name)
        if value is None or true is None:
            continue
        found = GridError(name, value, abs(value - true), error)
        if error > ROUNDING or not _same(found.off, true):
            out.append(found)
    return out


def _rows_by_cells(scene: str, usual: Sample, errors: Sequence[GridError]) -> Iterator[Row]:
    """Yield the rows of a scene by cells."""
    for found in errors:
        numbers = f"{found.value:.4g}, off by {found.off:.2g}, reported {found.error:.2g}"
        yield Row(f"{scene}: {found.name}, difference over error", found.ratio, "", numbers, GRID)
    if usual.margin:
        yield Row(f"{scene}: greatest margin of a zone, in errors", usual.margin, "", "", MOST_MARGIN)
