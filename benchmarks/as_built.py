"""As built: a known error of form, recovered from noisy points, and the light of the made lens.

The made lens is examples/pearl.toml and a sum of sines of periods 2.5 to 40 mm on its rear.  What is "true"
is traced on a spline of cells of 0.22 mm, whose own distance from the sines is a row.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, radians, sin
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

import optics
from benchmarks.rows.row import Row
from optics.base.runtime import Backend, load_backend
from optics.light.analysis import Measurement, measure
from optics.scene.problem import load_problem
from optics.tolerancing.metrology import (
    AsBuilt,
    FileFrame,
    MeasuredPoints,
    best_fit,
    by_datums,
    light_as_built,
    made_surface,
    read_measured,
)
from optics.tolerancing.perturbations import NOMINAL, Perturbation, PerturbedLight
from thbcad.fitting import quasi_interpolate
from thbcad.lens import FreeformSurface, Lens
from thbcad.poses import Pose
from thbcad.surfaces import THBSurface

Floats = NDArray[np.float64]

PEARL = Path(__file__).resolve().parents[1] / "examples" / "pearl.toml"
POINTS = 100_000
NOISES = (10.0, 100.0)  # nm
FINEST = 6  # level of the "true" lens: eleven cells on the shortest wave
NM = 1e-6  # mm
MOTION = Pose.at((0.1, -0.05, 0.02), np.radians([0.02, -0.01, 0.05]))


@dataclass(frozen=True)
class Waves:
    """A sum of sines, mm.  waves : (period mm, amplitude nm, direction degrees); the phase is the number."""

    waves: tuple[tuple[float, float, float], ...] = (
        (2.5, 100.0, 20.0),
        (4.0, 120.0, 75.0),
        (8.0, 150.0, -30.0),
        (16.0, 300.0, 50.0),
        (40.0, 400.0, 110.0),
    )

    def jet(self, x: Floats, y: Floats) -> Floats:
        """Return dh, its derivatives by x and by y, (3, n)."""
        total = np.zeros((3, np.size(x)))
        for number, (period, amplitude, direction) in enumerate(self.waves):
            kx, ky = (2 * pi / period * f(radians(direction)) for f in (cos, sin))
            phase = kx * x + ky * y + number
            total += amplitude * NM * np.stack([np.sin(phase), kx * np.cos(phase), ky * np.cos(phase)])
        return total

    def __call__(self, x: Floats, y: Floats) -> Floats:
        result: Floats = self.jet(x, y)[0]
        return result


def rows() -> list[Row]:
    """Return the measured rows."""
    design = optics.design(load_problem(PEARL))
    backend = load_backend("double", design.problem.run.threads)
    true, found = _true_lens(design, backend)
    light = measure(design.system.with_lens(true), backend)
    goal = light.metrics["rel_l2"]
    found.append(
        Row(
            "true lens: rel_l2",
            goal,
            reference=f"{design.metrics['rel_l2']:.4f} as designed",
            quantity="rel_l2 of the true lens",
            estimator="exact cells",
        )
    )
    for noise in NOISES:
        found += _recovered(design, backend, noise, light)
    return [*found, *_aligned(design.lens.rear)]


def _true_lens(design: optics.Design, backend: Backend) -> tuple[Lens, list[Row]]:
    """Return the lens with the waves, and how far it is from them."""
    rear = design.lens.rear
    assert rear.sag is not None
    space = rear.sag.space
    for level in range(FINEST):
        cells = space.cells[space.cells[:, 0] == level, 1:]
        space = space.refine({level: cells}) if len(cells) else space
    waves = Waves()
    added = quasi_interpolate(space, waves)
    sag = rear.sag.space.prolongation(space) @ rear.sag.coefficients
    true = design.lens.with_rear(rear.with_sag(THBSurface(space, sag + added.coefficients)))
    x, y = _places(rear, 20_000, seed=1)
    apart = np.stack([true.rear(x, y, d) - rear(x, y, d) for d in ((0, 0), (1, 0), (0, 1))]) - waves.jet(x, y)
    plain, _ = PerturbedLight(design.system, backend)(Perturbation(rear_error=waves))
    refit, _ = PerturbedLight(design.system.with_lens(true), backend)(NOMINAL)
    return true, [
        Row("true lens: greatest distance from the waves", float(np.abs(apart[0]).max()) / NM, "nm"),
        Row(
            "true lens: its light against waves added at the rays",
            float(np.linalg.norm(refit - plain) / np.linalg.norm(plain)),
            limit=0.01,
            quantity="irradiance",
            estimator="exact cells, 3 x 3 a pixel",
        ),
    ]


def _recovered(design: optics.Design, backend: Backend, noise: float, true: Measurement) -> list[Row]:
    """Return how well points with noise tell the light of the true lens."""
    rear = design.lens.rear
    x, y = _places(rear, POINTS, seed=5)
    heights = rear(x, y) + Waves()(x, y)
    heights += noise * NM * np.random.default_rng(6).standard_normal(POINTS)
    with TemporaryDirectory() as folder:
        file = Path(folder) / "measured.xyz"
        np.savetxt(file, np.column_stack([x, y, heights]), "%.10f")
        start = perf_counter()
        measured = read_measured(file, rear, FileFrame())
        reading = perf_counter() - start
    start = perf_counter()
    made = made_surface(rear, by_datums(rear, measured.points))
    fitting = perf_counter() - start
    start = perf_counter()
    built = _built(design, backend, measured)
    tracing = perf_counter() - start
    goal, light = true.metrics["rel_l2"], built.light_error
    there = _places(rear, 20_000, seed=7)
    error = float(np.sqrt(np.mean((made.correction(*there) - Waves()(*there)) ** 2))) / NM
    name = f"{noise:g} nm"
    return [
        Row(f"{name}: points read", reading, "s", f"{POINTS:,} points"),
        Row(f"{name}: correction fitted", fitting, "s", f"{made.fit.freedom:,.0f} degrees of freedom"),
        Row(f"{name}: both alignments, light and its error", tracing, "s"),
        Row(f"{name}: noise, estimated", made.fit.noise / NM, "nm", f"{noise:g} nm were added"),
        Row(f"{name}: error of the made surface, RMS", error, "nm"),
        Row(
            f"{name}: rel_l2 of the fitted lens against the true one",
            abs(built.measurement.metrics["rel_l2"] / goal - 1),
            quantity="rel_l2 of the true lens",
            estimator="light of the fit",
            error=0.0,
        ),
        Row(
            f"{name}: rel_l2 as made against the true one",
            abs(light.rel_l2 / goal - 1),
            limit=0.02 if noise == NOISES[0] else None,
            reference=f"{light.rel_l2:.4f} +- {light.error:.4f}",
            quantity="rel_l2 of the true lens",
            estimator="fit, less the noise that it carries",
            error=0.0,
        ),
        Row(f"{name}: that, in printed errors", abs(light.rel_l2 - goal) / light.error, limit=1.0),
    ]


def _built(design: optics.Design, backend: Backend, measured: MeasuredPoints) -> AsBuilt:
    return light_as_built(
        design.system,
        measured,
        backend,
        "rear",
        nominal=design.measurement,
        correct=False,
    )


def _aligned(rear: FreeformSurface) -> list[Row]:
    """Return how well a known motion is found, without noise."""
    x, y = _places(rear, POINTS, seed=8, inside=0.99)
    start = perf_counter()
    found = best_fit(rear, MOTION.points(np.stack([x, y, rear(x, y)])))
    seconds = perf_counter() - start
    shift = float(np.abs(found.motion.shift - MOTION.shift).max())
    tilt = float(np.abs(found.motion.rotation_vector - MOTION.rotation_vector).max())
    return [
        Row("best fit: error of a known shift", shift, "mm", "without noise", 1e-9),
        Row("best fit: error of a known tilt", tilt, "rad", "without noise", 1e-9),
        Row("best fit: time", seconds, "s", f"{POINTS:,} points"),
    ]


def _places(surface: FreeformSurface, count: int, seed: int, inside: float = 1.0) -> tuple[Floats, Floats]:
    hx, hy = surface.half_width
    x, y = np.random.default_rng(seed).uniform(-inside, inside, (2, count))
    return hx * x, hy * y
