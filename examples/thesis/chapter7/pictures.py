"""Draw the pictures of thesis chapter 7: Figures 7.4, 7.5 and 7.7 to 7.12.

Run: python -m examples.thesis.chapter7.pictures [folder]
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import matplotlib
import numpy as np
from numpy.typing import NDArray

from examples.thesis.chapter7.analytic import RectangleResponse
from examples.thesis.chapter7.comparison import CASES, Response, compare
from examples.thesis.chapter7.deconvolution import Case, figure_7_4
from examples.thesis.chapter7.two_source_landscape import MARKS, disk, landscape, square, two_sources
from optics.designing.etendue import Approximation

matplotlib.use("Agg")
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

EXTENT = (-1, 1, -1, 1)
COLOURS = ("red", "orange", "green")
TARGETS = {"square": square, "disk": disk}
FIGURES = {"square": "7_7", "disk": "7_8"}
SPLITS = (0, 1, 3)  # M of Figure 7.5
SOURCES = 2  # N_s of Figure 7.5

Floats = NDArray[np.float64]


def main(folder: Path) -> list[Path]:
    """Write the pictures; return their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    return [_saved(figure, folder / f"figure_{number}.png") for number, figure in figures()]


def figures() -> Iterator[tuple[str, Figure]]:
    """Compute and yield all figures with their numbers."""
    yield "7_4", deconvolution(figure_7_4())
    yield "7_5", rectangles()
    for name, number in FIGURES.items():
        yield number, best_positions(name)
    for case in CASES:
        best, responses = compare(case)
        print(f"figure {case.figure}: no light of a non-negative response comes below {best.lower_bound:.4f}")
        yield case.figure.replace(".", "_"), methods(responses)


def best_positions(name: str) -> Figure:
    """Compute the landscape of a target, and draw it."""
    target = TARGETS[name]()
    found = landscape(target)
    count, kkt = found.residual.size, found.kkt.max()
    print(f"figure {FIGURES[name]}: {count} positions, KKT residual at most {kkt:.0e}, ", end="")
    print(f"residual less its lower bound at most {(found.residual - found.lower_bound).max():.0e}")
    marks = {(m, n): two_sources(target, m, n) for m, n in MARKS[name]}
    return positions(target, found.residual, marks)


def deconvolution(cases: Iterable[Case]) -> Figure:
    """Draw targets and responses of regularised deconvolution."""
    figure, axes = plt.subplots(3, 2, figsize=(10, 8), layout="constrained")
    for (left, right), case in zip(axes, cases):
        sources = " and ".join(f"{position:+g}" for position in case.sources)
        left.plot(case.x, case.target, lw=1)
        left.vlines(case.sources, 0, 1, color="red", lw=1)
        left.set_title(f"half-width {case.half_width:g}, sources at {sources}", fontsize=10)
        right.plot(case.x, case.response, lw=0.4)
        right.set_title(f"response, {100 * case.negative:.0f} % of it negative", fontsize=10)
        left.set_xlim(-1, 1)
    return figure


def rectangles(splits: Sequence[int] = SPLITS) -> Figure:
    """Draw a rectangle of light, and the light of each of the sources that make it, by how often it is split.

    The first source is at 0, so that the pieces of its light are pieces of the rectangle.
    """
    figure, axes = plt.subplots(2, 2, figsize=(10, 5.5), sharex=True, sharey=True, layout="constrained")
    x = np.linspace(-0.6, 0.6, 4801)
    wanted, *panels = axes.ravel()
    wanted.fill_between(x, np.abs(x) <= 0.5, step="mid", color="0.6")
    wanted.set_title("light wanted", fontsize=10)
    for ax, m in zip(panels, splits):
        response = RectangleResponse(1.0, SOURCES, m)
        for k, position in enumerate(response.positions - response.positions[0]):
            light = response(x - position - response.positions[0]) / SOURCES
            ax.fill_between(x, light, step="mid", color=f"C{k}", lw=0, label=f"source at {position:g}")
        ax.set_title(f"M = {m}: {2**m} of {2**m * SOURCES} pieces by each source", fontsize=10)
        ax.legend(loc="upper right", fontsize=8)
    wanted.set_ylim(0, 1.45)
    return figure


def positions(
    target: Floats, residual: Floats, marks: Mapping[tuple[int, int], Approximation | Response]
) -> Figure:
    """Draw the target, the loss landscape, and image and response at marked positions of the second source.

    residual : at [n, m].  marks : by (m, n).
    """
    figure, axes = plt.subplots(2, 4, figsize=(15, 7.2), layout="constrained")
    _image(axes[0, 0], target, "wanted")
    end = len(residual) - 0.5
    shown = axes[1, 0].imshow(residual, origin="lower", extent=(-0.5, end, -0.5, end), cmap="viridis")
    figure.colorbar(shown, ax=axes[1, 0], label="least |E * F - G| / |G|")
    axes[1, 0].set(xlabel="m", ylabel="n", title="loss landscape")
    for (above, below), ((m, n), best), colour in zip(axes[:, 1:].T, marks.items(), COLOURS):
        axes[1, 0].plot(m, n, "o", color=colour)
        _image(above, best.image, f"({m}, {n}): residual {best.residual:.4f}")
        _image(below, best.light, "response")
        above.title.set_color(colour)
    return figure


def methods(responses: Mapping[str, Response]) -> Figure:
    """Draw image and response of the non-negative approximation and of three regularisations."""
    figure, axes = plt.subplots(4, 2, figsize=(7.5, 13), layout="constrained")
    for (left, right), (name, response) in zip(axes, responses.items()):
        _image(left, response.image, f"{name}: residual {response.residual:.3f}")
        _image(right, response.light, f"response, least {response.least:.2f} of the greatest")
    return figure


def _image(axes: Axes, values: Floats, title: str) -> None:
    shown = axes.imshow(values, origin="lower", extent=EXTENT, cmap="gray")
    axes.figure.colorbar(shown, ax=axes)
    axes.set_title(title, fontsize=10)


def _saved(figure: Figure, path: Path) -> Path:
    figure.savefig(path, dpi=110)
    plt.close(figure)
    return path


if __name__ == "__main__":
    for written in main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("exports/chapter7")):
        print(written)
