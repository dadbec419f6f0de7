"""Gradients by five methods: of a thin lens, and what they cost on a freeform lens (thesis 4.3)."""

from __future__ import annotations

from collections.abc import Iterator

from benchmarks.thesis.chapter4.gradient_page import section as section
from benchmarks.thesis.chapter4.lens_gradients import lens_gradient, noisy_gradient
from benchmarks.thesis.chapter4.thin_lens import D_O, thin_lens
from benchmarks.thesis.drawing import curve_row, curves, png
from benchmarks.thesis.records import Results, Run

NUMBER = 1
TITLE = "Gradients by five methods"
LEVELS = {True: (0, 2), False: (0, 2, 4)}  # of the pearl lens: 100, 961, 13 225 coefficients
DIRECTIONS = {True: 5, False: 20}
PATHS = {True: 1.0, False: 2.0}  # of ptracer, per pixel in each direction


def runs(quick: bool) -> list[Run]:
    """Return the runs: the thin lens, and per level the exact tracer and Mitsuba's particle tracer."""
    levels, count, paths = LEVELS[quick], DIRECTIONS[quick], PATHS[quick]
    exact = [Run(f"lens level {k}", lambda _, k=k: lens_gradient(k, count)) for k in levels]
    noisy = [Run(f"ptracer level {k}", lambda _, k=k: noisy_gradient(k, paths)) for k in levels]
    return [Run("thin lens", lambda _: thin_lens()), *exact, *noisy]


def pictures(results: Results) -> Iterator[tuple[str, bytes]]:
    """Yield the errors of differences over the step, and the cost of a gradient over its length."""
    yield "study1_differences", _differences(results)
    yield "study1_cost", _cost(results)


def _differences(results: Results) -> bytes:
    found = results["thin lens"]
    figure, axes = curve_row(2)
    for ax, method in zip(axes, ("forward", "central")):
        for d_o, errors in zip(D_O, found.arrays[f"{method} errors"]):
            ax.loglog(found.arrays["steps"], errors, lw=0.9, label=f"d_o = {d_o:g}")
        ax.set(xlabel="step", ylabel="|relative error| of dL/df", ylim=(1e-14, 1e2))
        ax.set_title(f"{method} difference", fontsize=9)
    axes[0].legend(fontsize=7)
    return png(figure)


def _cost(results: Results) -> bytes:
    rows = [found.numbers for name, found in results.items() if name.startswith("lens")]
    size = [row["coefficients"] for row in rows]
    figure, ax = curves()
    for key, label in (
        ("central", "central differences, extrapolated from some directions"),
        ("forward_mode", "forward mode, extrapolated from some directions"),
        ("reverse_mode", "reverse mode, measured"),
    ):
        ax.loglog(size, [row[key] / row["loss"] for row in rows], "o-", label=label)
    ax.set(xlabel="coefficients", ylabel="time of the loss with its gradient / time of the loss")
    ax.legend(fontsize=8)
    return png(figure)
