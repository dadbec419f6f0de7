"""The optimisers of section 4.2 on one lens, each at its best step, cut at the same number of evaluations."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import optics
from benchmarks.thesis.chapter4.optimiser_page import SCAN, TENTH, better_steps, section as section
from benchmarks.thesis.chapter4.search import Bench, Loss, Search, bench, searched
from benchmarks.thesis.drawing import curve_row, irradiance, panels, png
from benchmarks.thesis.lens_runs import Misfit, merit
from benchmarks.thesis.records import Found, Results, Run
from examples.thesis.own_optimiser import AcceptedSteps
from optics.designing.optimisation import PROBES, BoundedVariables
from thbcad import THBSurface

NUMBER = 2
TITLE = "Optimisers"

Floats = NDArray[np.float64]

EVALUATIONS = {True: 100, False: 1000}
TRIALS = {True: 25, False: 100}  # evaluations of every step of the scan
SMALL, LARGE = (-5, -4, -3, -2, -1, 0), (-3, -2, -1, 0, 1, 2)  # decades of steps
LAST = 0.01  # of the first step: where the decaying step ends
SEED = 2


@dataclass(frozen=True)
class Stepped:
    """A method of fixed step: (step, evaluations) -> optimiser, and the decades of steps to try."""

    made: Callable[[float, int], optics.Optimiser]
    decades: tuple[int, ...]


STEPPED = {
    "constant step": Stepped(lambda step, _: optics.GradientDescent(step), LARGE),
    "decaying step": Stepped(lambda step, n: optics.GradientDescent(step, LAST ** (1 / n)), LARGE),
    "momentum": Stepped(lambda step, _: optics.Momentum(step), LARGE),
    "RMSProp": Stepped(lambda step, _: optics.RMSProp(step), SMALL),
    "Adam": Stepped(lambda step, _: optics.Adam(step), SMALL),
}
FREE = {
    "line search": optics.LineSearch(),
    "steps kept by the loss": AcceptedSteps(),
    "L-BFGS": optics.LBFGS(least_decrease=0.0),
}
OWN = "this project"


def runs(quick: bool) -> list[Run]:
    """Return one scan per method of fixed step, and one search per method."""
    n, trials = EVALUATIONS[quick], TRIALS[quick]
    scans = [
        Run(SCAN + name, lambda _, method=method: _scanned(quick, method, n, trials))
        for name, method in STEPPED.items()
    ]
    fixed = [
        Run(name + tail, lambda done, name=name, part=part: _at_step(quick, name, part, done, n))
        for name in STEPPED
        for tail, part in (("", 1.0), (TENTH, 0.1))
    ]
    free = [
        Run(name, lambda _, optimiser=optimiser: _by_thesis(quick, optimiser, n))
        for name, optimiser in FREE.items()
    ]
    return [*scans, *fixed, *free, Run(OWN, lambda _: _own(quick, n))]


def _scanned(quick: bool, method: Stepped, evaluations: int, trials: int) -> Found:
    """Return the least loss of a short search with every step."""
    lens, steps = bench(quick), [10.0**k for k in method.decades]
    loss, start = Misfit(lens.model, lens.target, lens.bound), np.zeros(lens.space.dim)
    found = [searched(loss, start, method.made(step, evaluations), trials) for step in steps]
    return Found({"steps": steps, "losses": [float(s.losses.min()) for s in found], "trials": trials})


def _at_step(quick: bool, name: str, part: float, results: Results, evaluations: int) -> Found:
    """Return the search at a part of the best step of the scan."""
    scan = results[SCAN + name].numbers
    step = part * scan["steps"][int(np.argmin(scan["losses"]))]
    found = _by_thesis(quick, STEPPED[name].made(step, evaluations), evaluations)
    return Found({**found.numbers, "step": step}, found.arrays)


def _by_thesis(quick: bool, optimiser: optics.Optimiser, evaluations: int) -> Found:
    """Return a search behind the arctangent, from the flat lens."""
    lens = bench(quick)
    loss = Misfit(lens.model, lens.target, lens.bound)
    search = searched(loss, np.zeros(lens.space.dim), optimiser, evaluations)
    return _found(lens, search, search.losses, loss.coefficients(search.best))


def _own(quick: bool, evaluations: int) -> Found:
    """Return the search in this project's variables: multilevel, scaled by the Gauss-Newton diagonal."""
    lens = bench(quick)
    flat = THBSurface(lens.space, np.zeros(lens.space.dim))
    plain, norm = BoundedVariables([flat], [lens.bound]), np.linalg.norm(lens.target)
    _, pull = lens.model.vjp(flat.coefficients)
    rng = np.random.default_rng(SEED)
    signs = rng.choice((-1.0, 1.0), (PROBES, *lens.model.shape))
    variables = plain.preconditioned([[pull(sign / norm)] for sign in signs])
    loss = _squared(lens, variables)
    search = searched(loss, variables.zeros(), optics.LBFGS(least_decrease=0.0), evaluations - PROBES)
    (coefficients,), _ = variables.coefficients(search.best)
    return _found(lens, search, np.sqrt(search.losses), coefficients)


def _squared(lens: Bench, variables: BoundedVariables) -> Loss:
    """Return the squared misfit by the variables, as this project's designs have it."""
    norm = np.square(lens.target).sum()

    def loss(w: Floats) -> tuple[float, Floats]:
        (coefficients,), slopes = variables.coefficients(w)
        irradiance, pull = lens.model.vjp(coefficients)
        difference = irradiance - lens.target
        gradient = variables.gradient([pull(2 * difference / norm)], slopes)
        return float(np.square(difference).sum() / norm), gradient

    return loss


def _found(lens: Bench, search: Search, misfits: Floats, coefficients: Floats) -> Found:
    """Return what the page and the pictures need of a search; misfits : ||E - T|| / ||T||."""
    n = len(misfits)
    marks = {f"at_{part}": float(misfits[: max(n // part, 1)].min()) for part in (10, 3, 1)}
    numbers = {
        **marks,
        "first": float(misfits[0]),
        "evaluations": n,
        "steps": search.steps,
        "search_seconds": float(search.seconds[-1]),
        "rising": float(np.mean(np.diff(misfits) > 0)),
        **merit(lens.system, lens.system.lens(lens.space, coefficients)),
    }
    curves = {"misfits": misfits.astype(np.float32), "times": search.seconds.astype(np.float32)}
    return Found(numbers, {**curves, "image": lens.model(coefficients).astype(np.float32)})


def pictures(results: Results) -> Iterator[tuple[str, bytes]]:
    """Yield the losses over evaluations and seconds, the scans, and the light of every lens."""
    names = better_steps({name: found.numbers for name, found in results.items()})
    searches = {name: results[label] for name, label in names.items()}
    yield "study2_losses", _losses(searches)
    yield "study2_steps", _steps(results, searches)
    yield "study2_irradiance", _images(searches)


def _losses(searches: Results) -> bytes:
    figure, axes = curve_row(2, 4.6)
    for name, found in searches.items():
        misfits, style = found.arrays["misfits"], "-" if name in STEPPED else "--"
        best = np.minimum.accumulate(misfits)
        axes[0].loglog(np.arange(1, len(best) + 1), best, style, lw=1.1, label=name)
        axes[1].loglog(found.arrays["times"], best, style, lw=1.1)
    for ax, label in zip(axes, ("evaluations", "seconds")):
        ax.set(xlabel=label, ylabel="least loss so far")
    axes[0].legend(fontsize=6.5, loc="lower left")
    return png(figure)


def _steps(results: Results, searches: Results) -> bytes:
    figure, axes = curve_row(2, 4.6)
    for name in STEPPED:
        scan = results[SCAN + name].numbers
        axes[0].semilogx(scan["steps"], scan["losses"], "o-", ms=3, lw=1, label=name)
        losses = searches[name].arrays["misfits"]
        axes[1].loglog(np.arange(1, len(losses) + 1), losses, lw=0.7, label=name)
    axes[0].set(xlabel="step", ylabel="least loss of the scan")
    axes[1].set(xlabel="evaluations", ylabel="loss at the best step")
    axes[0].legend(fontsize=7)
    return png(figure)


def _images(searches: Results) -> bytes:
    columns = 3
    figure, axes = panels(-(-len(searches) // columns), columns)
    top = 3.5  # over the mean: the light asked for has 1 / 0.36
    for ax, (name, found) in zip(axes.ravel(), searches.items()):
        irradiance(ax, found.arrays["image"], f"{name}, loss {found.numbers['at_1']:.3f}", top=top)
    return png(figure)
