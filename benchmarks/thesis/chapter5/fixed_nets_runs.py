"""The runs of study 4: Adam of two step sizes on fixed nets, and the controls that the thesis lacks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

import optics
from benchmarks.checkout import EXAMPLES
from benchmarks.thesis.chapter5.step_light import step_irradiance
from benchmarks.thesis.lens_runs import Misfit, Training, merit, trained, unfiltered_target
from benchmarks.thesis.records import Found, Results, Run
from optics.interface.api import System
from optics.scene.problem import Problem

PROBLEM = EXAMPLES / "thesis" / "fixed_nets.toml"
TARGETS = {
    "top hat": {},
    "pearl": {
        "target.kind": "image",
        "target.image": str(EXAMPLES / "pearl.png"),
        "target.encoding": "srgb",
        "target.lit": [0.75, 0.75],  # the default: a picture allows no other
    },
}
STEP, SMALL_STEP = 1e-3, 1e-4  # of Adam, in w
CONTROL_NET = 50  # the smallest that the thesis calls irregular
PASSES = (4, 2, 1)  # pixels that are merged in each direction, from coarse to fine
SURFACE = 161  # samples of a sag in each direction, for its picture


@dataclass(frozen=True)
class Size:
    """How large the study is.

    longest : iterations of the small step.  newton : of L-BFGS.  controlled : targets of the controls
    on CONTROL_NET.
    """

    nets: tuple[int, ...]
    pixels: int
    rays: int
    iterations: dict[str, int]
    longest: dict[str, int]
    newton: int
    controlled: tuple[str, ...]


FULL = Size(
    nets=(10, 25, 50, 75, 100),
    pixels=256,
    rays=385,  # 0.63 pixels apart at the start, for a Gaussian of 0.5 pixels
    iterations={"top hat": 250, "pearl": 1000},
    longest={"top hat": 2500, "pearl": 4000},  # ten times; four times keep a run within two minutes
    newton=200,
    controlled=("top hat", "pearl"),
)
QUICK = Size(
    nets=(10, 25, 50),
    pixels=64,
    rays=113,
    iterations={"top hat": 80, "pearl": 80},
    longest={"top hat": 240, "pearl": 240},
    newton=40,
    controlled=("top hat",),
)


@dataclass(frozen=True)
class Trial:
    """One lens.

    step : of Adam; None is L-BFGS.  sigma : of the Gaussian, pixels.  filtered : the target as the light.
    start : flat or transport.  freedom : z_freedom, mm; None is the problem's.  passes : pixels merged.
    """

    target: str
    net: int
    step: float | None = STEP
    sigma: float = 0.5
    filtered: bool = False
    start: str = "flat"
    freedom: float | None = None
    passes: tuple[int, ...] = (1,)


def runs(quick: bool) -> list[Run]:
    """Return the runs: 1e-3 before 1e-4, which marks where the first one's loss is reached."""
    size = QUICK if quick else FULL
    return [Run(name, _run(size, trial)) for name, trial in trials(size).items()]


def trials(size: Size) -> dict[str, Trial]:
    """Return the trials by the names of their runs."""
    out = {f"{t} {n} 1e-3": Trial(t, n) for t in TARGETS for n in size.nets}
    out |= {f"{t} {n} 1e-4": Trial(t, n, SMALL_STEP) for t in TARGETS for n in size.nets if n >= CONTROL_NET}
    for t in size.controlled:
        plain = Trial(t, CONTROL_NET)
        out[f"{t} {CONTROL_NET} filtered"] = replace(plain, filtered=True)
        out[f"{t} {CONTROL_NET} sigma 1"] = replace(plain, sigma=1.0)
        out[f"{t} {CONTROL_NET} coarse to fine"] = replace(plain, passes=PASSES)
        out |= {f"{t} {n} L-BFGS": Trial(t, n, None) for n in size.nets}
        out |= {f"{t} {n} transport": Trial(t, n, None, start="transport") for n in size.nets}
    ends = (size.nets[0], CONTROL_NET)
    return out | {f"top hat {n} z_freedom 5": Trial("top hat", n, freedom=5.0) for n in ends}


def _run(size: Size, trial: Trial):
    return lambda results: _found(size, trial, results)


def _found(size: Size, trial: Trial, results: Results) -> Found:
    """Return what a trial found."""
    system, rays = optics.System(_problem(size, trial)), (size.rays, size.rays)
    space = system.space()
    mark = results[f"{trial.target} {trial.net} 1e-3"].numbers["loss"] if trial.step == SMALL_STEP else 0.0
    misfit, training, evaluations = _trained(size, trial, system, mark)
    c = misfit.coefficients(training.w)
    lens, image = system.lens(space, c), misfit.model(c)
    by_step = step_irradiance(system, lens, rays, trial.sigma)
    u = np.linspace(-1, 1, SURFACE) * space.kv_u.stop
    numbers = {
        "target": trial.target,
        "net": trial.net,
        "loss": misfit(training.w)[0],
        "evaluations": evaluations,
        "step_difference": float(np.linalg.norm(by_step - image) / np.linalg.norm(image)),
        "at_mark": _at_mark(system, misfit, training, mark),
        **merit(system, lens),
    }
    arrays = {"model": image, "step": by_step, "sag": lens.sags[-1].grid(u, u), "losses": training.losses}
    return Found(numbers, {name: np.asarray(a, np.float32) for name, a in arrays.items()})


def _at_mark(system: System, misfit: Misfit, training: Training, mark: float) -> dict[str, float] | None:
    """Return evaluations and figures of merit where the loss first fell to the mark, None where never."""
    if training.crossed is None:
        return None
    evaluations = int(np.argmax(training.losses <= mark)) + 1
    lens = system.lens(system.space(), misfit.coefficients(training.crossed))
    return {"evaluations": evaluations, **merit(system, lens)}


def _trained(size: Size, trial: Trial, system: System, mark: float) -> tuple[Misfit, Training, int]:
    """Return the loss and the training of the last pass, and the evaluations of all."""
    space, rays, bound = system.space(), (size.rays, size.rays), system.problem.lens.rear.freeform.freedom
    c = np.zeros(space.dim) if trial.start == "flat" else system.transport_start(space).coefficients
    method = optics.LBFGS() if trial.step is None else optics.Adam(trial.step)
    iterations = size.newton if trial.step is None else size.iterations[trial.target]
    if trial.step == SMALL_STEP:
        iterations = size.longest[trial.target]
    evaluations = 0
    for merged in trial.passes:
        at = system if merged == 1 else optics.System(_merged(system.problem, merged))
        model = at.model(space, rays)
        misfit = Misfit(model, model.target if trial.filtered else unfiltered_target(at), bound)
        w = misfit.variables(c)
        training = trained(misfit, w, method, iterations // len(trial.passes), mark=mark)
        c = misfit.coefficients(training.w)
        evaluations += len(training.losses)
    return misfit, training, evaluations


def _problem(size: Size, trial: Trial) -> Problem:
    problem = optics.load_problem(PROBLEM)
    spans = trial.net - problem.lens.rear.freeform.degree
    changes = {
        "lens.rear.freeform.spans": (spans, spans),
        "target.pixels": (size.pixels, size.pixels),
        "optimizer.sigma": trial.sigma,
        **TARGETS[trial.target],
    }
    if trial.freedom is not None:
        changes["lens.rear.freeform.z_freedom"] = trial.freedom
    return problem.with_(**changes)


def _merged(problem: Problem, by: int) -> Problem:
    return problem.with_(**{"target.pixels": tuple(n // by for n in problem.target.pixels)})


def trial_names(results: Results, target: str, kind: str) -> Sequence[str]:
    """Return the names of the runs of a target and a kind ("1e-3", "transport" ...), by net."""
    names = [n for n in results if n.startswith(f"{target} ") and n.endswith(f" {kind}")]
    return sorted(names, key=lambda name: results[name].numbers["net"])
