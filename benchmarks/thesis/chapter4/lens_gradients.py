"""What gradients cost, and how well they agree, on the lens of the pearl (thesis 1.3, 4.3).

The loss is ||E - T|| / ||T||; lens half way between the flat one and that of optimal transport.
"""

from __future__ import annotations

from time import perf_counter

import numpy as np
from numpy.typing import NDArray

import optics
from benchmarks.checkout import EXAMPLES
from benchmarks.designs.camera_engine import camera_engine
from benchmarks.rows.row import median_seconds
from benchmarks.thesis.records import Found
from optics.base.runtime import UserError
from optics.interface.api import Model, System
from optics.light.engines import Engine

Floats = NDArray[np.float64]

RAYS = (449, 449)
WINDOW = "gaussian"
REPEATS = 5
STEP = 1e-6  # mm, of central differences: best here, see the error
STRONG = 0.1  # of the greatest entry of the gradient: such directions are taken
HALF = 0.5  # of the sag that optimal transport asks for
SEED = 1


def lens_gradient(level: int, count: int) -> Found:
    """Return times and disagreements; count : directions of forward mode and of central differences."""
    system = optics.System(optics.load_problem(EXAMPLES / "pearl.toml"))
    model, c = _at(system, level)
    target = model.target
    scale = np.linalg.norm(target)

    def loss(c: Floats) -> float:
        return float(np.linalg.norm(model(c) - target) / scale)

    gradient, slope = _gradient(model, c)
    strong = np.flatnonzero(np.abs(gradient) > STRONG * np.abs(gradient).max())
    chosen = np.random.default_rng(SEED).choice(strong, min(count, len(strong)), replace=False)
    units = [np.arange(len(c)) == k for k in chosen]
    begun = perf_counter()
    forward = np.array([np.vdot(slope, model.jvp(c, unit)[1]) for unit in units])
    middle = perf_counter()
    central = np.array([loss(c + STEP * u) - loss(c - STEP * u) for u in units]) / (2 * STEP)
    ended, n = perf_counter(), len(c) / len(units)
    greatest = np.abs(gradient).max()
    return Found(
        {
            "coefficients": len(c),
            "pixels": target.size,
            "directions": len(units),
            "loss": median_seconds(lambda: loss(c), REPEATS),
            "reverse_mode": median_seconds(lambda: _gradient(model, c), REPEATS),
            "forward_mode": n * (middle - begun),
            "central": n * (ended - middle),
            "forward_apart": float(np.abs(forward - gradient[chosen]).max() / greatest),
            "central_apart": float(np.abs(central - gradient[chosen]).max() / greatest),
        }
    )


def noisy_gradient(level: int, paths: float) -> Found:
    """Return how far a gradient by Mitsuba's particle tracer is from the exact one.

    paths : per pixel, in each direction.
    """
    problem = optics.load_problem(EXAMPLES / "pearl.toml").with_(**{"optimizer.rays_per_pixel": paths})
    system = optics.System(problem)
    model, c = _at(system, level)
    exact, _ = _gradient(model, c)
    numbers = {"coefficients": len(c), "paths": paths**2}
    try:
        noisy_model, _ = _at(system, level, camera_engine())
    except UserError:
        return Found({**numbers, "installed": False})
    noisy, _ = _gradient(noisy_model, c)
    lengths = np.linalg.norm(noisy), np.linalg.norm(exact)
    return Found({**numbers, "installed": True, "cosine": float(noisy @ exact / np.prod(lengths))})


def _at(system: System, level: int, engine: Engine | None = None) -> tuple[Model, Floats]:
    """Return the model and the coefficients at a level."""
    space = system.space(level)
    return system.model(space, RAYS, WINDOW, engine), HALF * system.transport_start(space).coefficients


def _gradient(model: Model, c: Floats) -> tuple[Floats, Floats]:
    """Return dL/dc and dL/dE."""
    irradiance, pull = model.vjp(c)
    difference = irradiance - model.target
    slope = difference / (np.linalg.norm(difference) * np.linalg.norm(model.target))
    return pull(slope), slope
