"""Bounds and penalties of section 4.4 on one lens, with a bound that binds."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

import optics
from benchmarks.thesis.chapter4.constraint_page import BENDING, FREE, SQUASHED, label, section as section
from benchmarks.thesis.chapter4.search import Bench, Search, bench, searched
from benchmarks.thesis.drawing import curve_row, irradiance, panels, png
from benchmarks.thesis.lens_runs import merit
from benchmarks.thesis.records import Found, Results, Run
from examples.thesis.constraints import PENALTIES, RANGES
from optics.designing.penalties import Part, ShapePenalty, shape_penalty
from optics.scene.problem import Limits

NUMBER = 3
TITLE = "Constraints"

Floats = NDArray[np.float64]
Valued = Callable[[Floats], tuple[float, Floats]]

EVALUATIONS = {True: 60, False: 300}
PART = 0.5  # of the greatest coefficient of the free optimum: a bound that binds
AT_BOUND = 0.99  # of the bound
NEAR = 1.1  # times the final loss
REFUSED = 10.0  # stands for an infinite loss: a line search of L-BFGS needs a number, and this is above all
WEIGHTS = {  # mu: from hardly felt to dominant
    "Tikhonov": (1e-5, 1e-4, 1e-3, 1e-2, 1e-1),
    "smoothness": (1e-4, 1e-3, 1e-2, 1e-1, 1.0, 10.0),
    BENDING: (1e-3, 1e-2, 1e-1, 1.0, 10.0, 100.0),
    "barrier": (1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1.0),  # 1: (4.38) as printed, without mu
    "entropy": (1e-6, 1e-5, 1e-4, 1e-3, 1e-2),
}
UNCHARGED = (FREE, *(SQUASHED + kind for kind in RANGES))
TOP = 3.5  # of the pictures, over the mean: the light asked for has 1 / 0.36
WINDOW = np.linspace(-3, 3, 301)  # of the picture of the range functions


def runs(quick: bool) -> list[Run]:
    """Return the free search, one per range function, and one per penalty and mu (quick: every second)."""
    n, every = EVALUATIONS[quick], 2 if quick else 1
    squashed = [
        Run(SQUASHED + name, lambda done, name=name: _squashed(quick, name, _bound(done), n))
        for name in RANGES
    ]
    charged = [
        Run(label(name, mu), lambda done, name=name, mu=mu: _charged(quick, name, mu, _bound(done), n))
        for name, row in WEIGHTS.items()
        for mu in (*row[:-1:every], row[-1])
    ]
    return [Run(FREE, lambda _: _free(quick, n)), *squashed, *charged]


class _Misfits:
    """||E - T|| / ||T|| and its gradient by the coefficients; it notes what it returned."""

    def __init__(self, lens: Bench) -> None:
        self._lens, self._norm = lens, np.linalg.norm(lens.target)
        self.seen: list[float] = []

    def __call__(self, c: Floats) -> tuple[float, Floats]:
        irradiance, pull = self._lens.model.vjp(c)
        difference = irradiance - self._lens.target
        length = np.linalg.norm(difference)
        self.seen.append(float(length / self._norm))
        return self.seen[-1], pull(difference / (length * self._norm))


def _bound(done: Results) -> float:
    return PART * done[FREE].numbers["greatest"]


def _free(quick: bool, evaluations: int) -> Found:
    """Return the search without any bound; its variables are c in mm."""
    lens = bench(quick)
    misfit = _Misfits(lens)
    search = searched(misfit, np.zeros(lens.space.dim), optics.LBFGS(least_decrease=0.0), evaluations)
    return _found(lens, misfit, search, search.best, PART * float(np.abs(search.best).max()))


def _squashed(quick: bool, name: str, bound: float, evaluations: int) -> Found:
    """Return the search behind a range function."""
    lens = bench(quick)
    misfit = _Misfits(lens)

    def loss(w: Floats) -> tuple[float, Floats]:
        ratio, slope = RANGES[name](w)
        value, gradient = misfit(bound * ratio)
        return value, bound * slope * gradient

    search = searched(loss, np.zeros(lens.space.dim), optics.LBFGS(least_decrease=0.0), evaluations)
    return _found(lens, misfit, search, bound * RANGES[name](search.best)[0], bound)


def _charged(quick: bool, name: str, mu: float, bound: float, evaluations: int) -> Found:
    """Return the search with a penalty; its variables are c / b."""
    lens = bench(quick)
    misfit, penalty, refused = _Misfits(lens), _penalty(lens, name, mu, bound), []

    def loss(y: Floats) -> tuple[float, Floats]:
        charge, slope = penalty(bound * y)
        if not np.isfinite(charge):
            refused.append(charge)
            return REFUSED, np.zeros_like(y)
        value, gradient = misfit(bound * y)
        return value + charge, bound * (gradient + slope)

    search = searched(loss, np.zeros(lens.space.dim), optics.LBFGS(least_decrease=0.0), evaluations)
    found = _found(lens, misfit, search, bound * search.best, bound)
    return Found({**found.numbers, "refused": len(refused), "mu": mu}, found.arrays)


def _penalty(lens: Bench, name: str, mu: float, bound: float) -> Valued:
    """Return mu p(c) with its gradient."""
    if name == BENDING:
        flat = lens.system.lens(lens.space, np.zeros(lens.space.dim))
        shape = shape_penalty([Part(flat, Limits())], roughness=mu)
        assert isinstance(shape, ShapePenalty)
        return lambda c: (lambda value, slopes: (value, slopes[0]))(*shape([c]))

    def scaled(c: Floats) -> tuple[float, Floats]:
        value, gradient = PENALTIES[name](c, bound)
        return mu * value, mu * gradient

    return scaled


def _found(lens: Bench, misfit: _Misfits, search: Search, c: Floats, bound: float) -> Found:
    """Return what the page and the pictures need; the misfit is that of the least loss."""
    seen = np.array(misfit.seen)
    final, size = misfit(c)[0], np.abs(c)
    near = np.flatnonzero(seen <= NEAR * final)
    numbers = {
        "misfit": final,
        "greatest": float(size.max()),
        "ratio": float(size.max() / bound),
        "at_bound": float(np.mean(size > AT_BOUND * bound)),
        "size": float(np.sqrt(np.mean(c**2))),
        "least_p": float((c.min() + bound) / (2 * bound)),
        "near": int(near[0]) + 1,
        "evaluations": len(search.losses),
        "bound": bound,
        **merit(lens.system, lens.system.lens(lens.space, c)),
    }
    image = lens.model(c).astype(np.float32)
    return Found(numbers, {"misfits": seen.astype(np.float32), "image": image})


def pictures(results: Results) -> Iterator[tuple[str, bytes]]:
    """Yield the range functions (Fig. 4.6), trade-off curves, losses behind a bound, and the light."""
    yield "study3_ranges", _range_picture()
    yield "study3_tradeoff", _tradeoff_picture(results)
    yield "study3_losses", _loss_picture(results)
    yield "study3_irradiance", _light_picture(results)


def _range_picture() -> bytes:
    figure, axes = curve_row(2)
    for name, function in RANGES.items():
        value, slope = function(WINDOW)
        axes[0].plot(WINDOW, value, label=name)
        axes[1].plot(WINDOW, slope, label=name)
    axes[0].set(xlabel="w", ylabel="c / b")
    axes[1].set(xlabel="w", ylabel="slope")
    axes[0].legend(fontsize=8)
    return png(figure)


def _tradeoff_picture(results: Results) -> bytes:
    figure, axes = curve_row(2, 4.6)
    for name in WEIGHTS:
        rows = [found.numbers for label, found in results.items() if label.startswith(name)]
        for ax, key in zip(axes, ("roughness", "ratio")):
            ax.loglog(
                [row[key] for row in rows], [row["misfit"] for row in rows], "o-", ms=3, lw=1, label=name
            )
    for name, mark in zip(UNCHARGED, "*^vs"):
        row = results[name].numbers
        for ax, key in zip(axes, ("roughness", "ratio")):
            ax.loglog(row[key], row["misfit"], mark, ms=8, mec="k", mfc="none", label=name)
    axes[1].axvline(1, color="0.5", lw=0.8)
    axes[0].set(xlabel="roughness", ylabel="misfit")
    axes[1].set(xlabel="greatest |c| / b", ylabel="misfit")
    axes[0].legend(fontsize=6.5)
    return png(figure)


def _loss_picture(results: Results) -> bytes:
    figure, axes = curve_row(1, 6)
    for name in (*UNCHARGED, _best(results, "barrier")):
        misfits = np.minimum.accumulate(results[name].arrays["misfits"])
        axes[0].loglog(np.arange(1, len(misfits) + 1), misfits, lw=1.1, label=name)
    axes[0].set(xlabel="evaluations inside the bound", ylabel="least misfit so far")
    axes[0].legend(fontsize=8)
    return png(figure)


def _light_picture(results: Results) -> bytes:
    names = [*UNCHARGED, *(_best(results, name) for name in WEIGHTS)]
    figure, axes = panels(3, 3)
    for ax, name in zip(axes.ravel(), names):
        found = results[name]
        irradiance(ax, found.arrays["image"], f"{name}: {found.numbers['misfit']:.3f}", top=TOP)
    return png(figure)


def _best(results: Results, penalty: str) -> str:
    """Return the name of a penalty's run with the least misfit."""
    names = [name for name in results if name.startswith(penalty)]
    return min(names, key=lambda name: results[name].numbers["misfit"])
