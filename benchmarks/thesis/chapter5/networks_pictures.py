"""The pictures of study 5, arranged as figures 5.12 to 5.17 of the thesis."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from benchmarks.thesis.chapter5.networks_runs import MOMENTS, SHOWN, STEPS
from benchmarks.thesis.drawing import curves, irradiance, panels, plt, png, relief
from benchmarks.thesis.records import Results

KINDS = ("RS", "NN", "US", "UD")  # in the order of figure 5.12
COLOURS = dict(zip((*KINDS, "smooth"), ("tab:red", "black", "tab:blue", "tab:green", "tab:orange")))
LINES = dict(zip(STEPS, ("-", "--", ":")))
SLOW = ("1e-4", "1e-5")  # steps that are left out of the controls' curves
SIZE = 1.6  # inches of a panel
BRIGHT, WRONG = 4.0, 2.0  # of the scales of irradiance and error, times the mean


def pictures(results: Results) -> Iterator[tuple[str, bytes]]:
    """Yield the name and the PNG of every picture."""
    yield "study5_losses", _losses(results)
    yield "study5_lenses", _lenses(results)
    yield "study5_irradiance", _irradiances(results)


def _losses(results: Results) -> bytes:
    figure, first = curves((10.0, 4.2))
    first.remove()
    left, right = (figure.add_subplot(1, 2, k) for k in (1, 2))
    for kind in KINDS:
        for step, line in LINES.items():
            losses = results[f"{kind} {step}"].arrays["losses"]
            left.loglog(
                _counted(losses), losses, line, color=COLOURS[kind], label=f"{kind} {step}", linewidth=1
            )
    controls = [
        n for n in results if n.startswith(("NN ", "smooth ")) and not n.endswith(SLOW) and "seed" not in n
    ]
    shades = plt.get_cmap("turbo")(np.linspace(0.05, 0.95, len(controls)))
    for name, shade in zip(controls, shades):
        line = "--" if name.startswith("smooth") else "-"
        losses = results[name].arrays["losses"]
        right.loglog(_counted(losses), losses, line, color=shade, label=name, linewidth=1)
    dense = results["UD 1e-4"].arrays["losses"]
    right.loglog(_counted(dense), dense, ":", color=COLOURS["UD"], label="UD 1e-4", linewidth=2)
    for ax, title in ((left, "as in the thesis"), (right, "controls")):
        ax.set(title=title, xlabel="evaluation", ylabel="||E - T|| / ||T||")
        ax.grid(which="both", alpha=0.25)
        ax.legend(fontsize=6, loc="upper left", bbox_to_anchor=(1, 1))
    return png(figure)


def _counted(losses):
    return np.arange(1, len(losses) + 1)


def _lenses(results: Results) -> bytes:
    figure, axes = panels(len(KINDS), len(MOMENTS) + 1, SIZE)
    for row, kind in zip(axes, KINDS):
        for ax, heights, moment in zip(row, _shown(results, kind).arrays["sags"], _moments(results)):
            relief(ax, heights, f"iteration {moment}, {np.ptp(heights):.2g} mm")
        row[0].set_ylabel(kind)
    return png(figure)


def _irradiances(results: Results) -> bytes:
    figure, axes = panels(2 * len(KINDS), len(MOMENTS) + 1, SIZE)
    for k, kind in enumerate(KINDS):
        found = _shown(results, kind)
        wanted = found.arrays["wanted"]
        for m, (image, moment) in enumerate(zip(found.arrays["images"], _moments(results))):
            light, error = axes[2 * k, m], axes[2 * k + 1, m]
            irradiance(light, image, f"iteration {moment}", top=BRIGHT)
            difference = (image - wanted) / wanted.mean()
            error.imshow(difference, cmap="RdBu", vmin=-WRONG, vmax=WRONG)
            misfit = np.linalg.norm(image - wanted) / np.linalg.norm(wanted)
            error.set_title(f"loss {misfit:.3f}", fontsize=8)
        axes[2 * k, 0].set_ylabel(kind)
        axes[2 * k + 1, 0].set_ylabel("error")
    return png(figure)


def _shown(results: Results, kind: str):
    return results[f"{kind} {SHOWN}"]


def _moments(results: Results) -> tuple[int, ...]:
    return (*MOMENTS, results[f"NN {SHOWN}"].numbers["evaluations"] - 1)
