"""The runs of study 5: heights by networks, by Adam of three step sizes, and the controls."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import optics
from benchmarks.thesis.lens_runs import Training, merit, trained, unfiltered_target
from benchmarks.thesis.records import Found, Run
from examples.thesis.networks import PROBLEM, loss_through
from optics.interface.api import System
from optics.scene.problem import Problem
from thbcad import THBSurface

Floats = NDArray[np.float64]

STEPS = {"1e-3": 1e-3, "1e-4": 1e-4, "1e-5": 1e-5}  # of the thesis
TUNING = {"3e-3": 3e-3, "1e-2": 1e-2, "3e-2": 3e-2, "1e-1": 1e-1}  # the larger ones, of the controls
KINDS = ("NN", "RS", "US", "UD")
SEEDED = ("1e-3", "1e-4")  # steps with more than one seed
SHOWN = "1e-4"  # the step whose lenses and irradiances are drawn
MARKS = 0.95 ** np.arange(100)  # losses, down to 0.006
SURFACE = 121  # samples of a sag in each direction, for its picture
MOMENTS = (0, 50, 100)  # iterations that are drawn, and the last one


@dataclass(frozen=True)
class Size:
    """How large the study is.  net : control points in each direction.  newton : iterations of L-BFGS."""

    net: int
    pixels: int
    rays: int
    iterations: int
    seeds: int
    newton: int


FULL = Size(net=24, pixels=128, rays=161, iterations=1000, seeds=5, newton=200)
QUICK = Size(net=12, pixels=48, rays=65, iterations=100, seeds=2, newton=40)


@dataclass(frozen=True)
class Trial:
    """kind : NN, RS, US, UD, or smooth.  step : of Adam, None is L-BFGS.  start : flat or transport.

    seed : of a network's start; NN is flat with seed 0, and within SMALL of it with others.
    """

    kind: str
    step: float | None
    seed: int = 0
    start: str = "flat"


def runs(quick: bool) -> list[Run]:
    """Return the runs: those of the thesis, then the controls."""
    size = QUICK if quick else FULL
    return [Run(name, _run(size, trial)) for name, trial in trials(size).items()]


def trials(size: Size) -> dict[str, Trial]:
    """Return the trials by the names of their runs."""
    out = {f"{k} {s}": Trial(k, step) for k in KINDS for s, step in STEPS.items()}
    for seed in range(1, size.seeds):
        out |= {f"{k} {s} seed {seed}": Trial(k, STEPS[s], seed) for k in KINDS for s in SEEDED}
    out |= {f"NN {s}": Trial("NN", step) for s, step in TUNING.items()}
    out |= {f"smooth {s}": Trial("smooth", step) for s, step in {**STEPS, **TUNING}.items() if step < 0.1}
    return out | {"NN L-BFGS": Trial("NN", None), "NN transport": Trial("NN", None, start="transport")}


class Direct:
    """No network: the heights themselves."""

    def __init__(self, count: int) -> None:
        self.parameters = count

    def __call__(self, theta: Floats) -> tuple[Floats, Any]:
        return theta, lambda slope: slope


class Smooth:
    """A fixed smoothing of the wiring of US: z = t0 + S t1 + S^2 t2, S the mean of the neighbours."""

    def __init__(self, n: int, degree: int) -> None:
        from examples.thesis.sparse_layers import neighbours

        near, exist = neighbours((n, n), (degree, degree))
        self._near, self._share = near, exist / exist.sum(axis=1, keepdims=True)
        self.parameters = 3 * n * n

    def __call__(self, theta: Floats) -> tuple[Floats, Any]:
        """Return the heights, and the function that maps dL/dz to dL/d(theta)."""
        first, second, third = np.split(theta, 3)

        def pull(slope: Floats) -> Floats:
            once = self._spread(slope)
            return np.concatenate([slope, once, self._spread(once)])

        return first + self._mean(second + self._mean(third)), pull

    def _mean(self, values: Floats) -> Floats:
        return (values[self._near] * self._share).sum(axis=1)

    def _spread(self, slope: Floats) -> Floats:
        return np.bincount(self._near.ravel(), (slope[:, None] * self._share).ravel(), len(slope))


def _run(size: Size, trial: Trial):
    return lambda _: _found(size, trial)


def _found(size: Size, trial: Trial) -> Found:
    """Return what a trial found."""
    system = optics.System(_problem(size))
    space, bound = system.space(), system.problem.lens.rear.freeform.freedom
    heights, start = _parametrisation(size, trial, system)
    model = system.model(space, (size.rays, size.rays))
    moved = _Moves(heights)
    loss = loss_through(moved, model, unfiltered_target(system), bound)
    method = optics.LBFGS() if trial.step is None else optics.Adam(trial.step)
    iterations = size.newton if trial.step is None else size.iterations
    keep = MOMENTS if trial.step == STEPS[SHOWN] and trial.seed == 0 else ()
    training = trained(loss, start, method, iterations, keep)
    c = bound * heights(training.w)[0]
    lens = system.lens(space, c)
    steps = bound * np.array(moved.steps or [0.0])
    numbers = {
        "kind": trial.kind,
        "parameters": heights.parameters,
        "loss": float(training.losses[-1]),
        "best": float(training.losses.min()),
        "evaluations": len(training.losses),
        "greatest_move": float(steps.max()),
        "usual_move": float(np.median(steps)),
        "passed": _passed(training.losses),
        **merit(system, lens),
    }
    arrays = {"losses": training.losses, **_moments(system, model, heights, training, keep)}
    return Found(numbers, {name: np.asarray(a, np.float32) for name, a in arrays.items()})


def _passed(losses: Floats) -> list[int | None]:
    """Return the first evaluation below every mark of MARKS, None where none is."""
    below = losses <= MARKS[:, None]
    return [int(row.argmax()) if row.any() else None for row in below]


class _Moves:
    """Heights that remember the greatest change of a height since the evaluation before."""

    def __init__(self, heights: Any) -> None:
        self._heights, self._last, self.steps = heights, None, []

    def __call__(self, theta: Floats) -> tuple[Floats, Any]:
        z, pull = self._heights(theta)
        if self._last is not None:
            self.steps.append(float(np.abs(z - self._last).max()))
        self._last = z.copy()
        return z, pull


def _parametrisation(size: Size, trial: Trial, system: System) -> tuple[Any, Floats]:
    """Return heights as a function of their parameters, and the start."""
    from examples.thesis.height_network import SMALL, Network  # System has found a version of LLVM that works

    space, freeform = system.space(), system.problem.lens.rear.freeform
    if trial.kind == "NN":
        start = np.random.default_rng(trial.seed).uniform(-SMALL, SMALL, space.dim) * (trial.seed > 0)
        if trial.start == "transport":
            start = system.transport_start(space).coefficients / freeform.freedom
        return Direct(space.dim), start
    if trial.kind == "smooth":
        smooth = Smooth(size.net, freeform.degree)
        return smooth, np.zeros(smooth.parameters)
    network = Network("dense" if trial.kind == "UD" else "sparse", size.net, freeform.degree)
    return network, network.start(trial.seed, ordinary=trial.kind == "RS")


def _moments(
    system: System, model: optics.Model, heights: Any, training: Training, keep: tuple[int, ...]
) -> dict[str, Floats]:
    """Return the irradiances and the sags at the kept iterations and at the last one."""
    if not keep:
        return {}
    bound, space = system.problem.lens.rear.freeform.freedom, system.space()
    nets = [bound * heights(w)[0] for w in (*(training.kept[k] for k in keep), training.w)]
    u = np.linspace(-1, 1, SURFACE) * space.kv_u.stop
    return {
        "images": np.array([model(c) for c in nets]),
        "sags": np.array([THBSurface(space, c).grid(u, u) for c in nets]),
        "wanted": unfiltered_target(system),
    }


def _problem(size: Size) -> Problem:
    problem = optics.load_problem(PROBLEM)
    spans = size.net - problem.lens.rear.freeform.degree
    changes = {"lens.rear.freeform.spans": (spans, spans), "target.pixels": (size.pixels, size.pixels)}
    return problem.with_(**changes)
