"""A loss of a script: minimised by scipy, and its gradient against central differences."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

from optics.interface.api import Model, System
from optics.scene.problem import load_problem
from thbcad.checks import Floats
from thbcad.surfaces import THBSurface

ITERATIONS = 6
DIRECTIONS = 3
STEP = 1e-6  # mm, of central differences of fourth order
OFF = 0.98  # of the coefficients of the start: where the loss has slopes

Loss = Callable[[Floats], tuple[float, Floats]]


def custom_loss(model: Model) -> Loss:
    """Return the loss L(c) = sum((E(c) - T)^2) / max(T)^2 of a model, with its gradient."""

    def loss(coefficients: Floats) -> tuple[float, Floats]:
        irradiance, pull = model.vjp(coefficients)
        difference = (irradiance - model.target) / model.target.max()
        return float((difference**2).sum()), np.asarray(pull(2 * difference / model.target.max()))

    return loss


def loss_results(problem: Path) -> tuple[float, float]:
    """Return rel_l2 after scipy has minimised a custom loss, and the error of its gradient.

    The error is the greatest |difference - g d| / ||g|| over random directions d of length 1.
    """
    system = System(load_problem(problem))
    space = system.space(level=1)
    sag = system.transport_start(space)
    assert isinstance(sag, THBSurface)  # one surface is free
    loss, start = custom_loss(system.model(space)), sag.coefficients
    best = minimize(loss, start, jac=True, method="L-BFGS-B", options={"maxiter": ITERATIONS})
    light = system.measure(system.lens(space, best.x))
    return light.metrics["rel_l2"], gradient_error(loss, OFF * start)


def gradient_error(loss: Loss, at: Floats) -> float:
    """Return the greatest error of the slopes of a loss at some coefficients, relative to ||gradient||."""
    _, gradient = loss(at)
    directions = np.random.default_rng(0).standard_normal((DIRECTIONS, at.size))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    errors = [abs(_slope(loss, at, d) - gradient @ d) for d in directions]
    return float(max(errors) / np.linalg.norm(gradient))


def _slope(loss: Loss, at: Floats, direction: Floats) -> float:
    """Return dL/dt at `at` + t direction, by differences of fourth order."""
    near, far = (loss(at + h * direction)[0] - loss(at - h * direction)[0] for h in (STEP, 2 * STEP))
    return (8 * near - far) / (12 * STEP)
