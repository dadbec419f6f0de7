"""Draw the pictures of thesis chapter 7: Figures 7.4 and 7.7 to 7.12.

Run: python examples/chapter7.py [folder]
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib
import numpy as np
from numpy.typing import NDArray

from optics.deconvolution import (
    CASES,
    MARKS,
    STEPS,
    Case,
    compare,
    disk,
    figure_7_4,
    landscape,
    square,
    two_sources,
)

matplotlib.use("Agg")
from matplotlib import pyplot as plt
from matplotlib.axes import Axes

EXTENT = (-1, 1, -1, 1)
COLOURS = ("red", "orange", "green")


def main(folder: Path) -> list[Path]:
    """Write the pictures; return their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = [deconvolution(folder / "figure_7_4.png")]
    paths += [
        positions(name, folder / f"figure_{number}.png")
        for name, number in (("square", "7_7"), ("disk", "7_8"))
    ]
    paths += [methods(case, folder / f"figure_{case.figure.replace('.', '_')}.png") for case in CASES]
    return paths


def deconvolution(path: Path) -> Path:
    """Draw targets and responses of regularised deconvolution."""
    figure, axes = plt.subplots(3, 2, figsize=(10, 8), layout="constrained")
    for (left, right), case in zip(axes, figure_7_4()):
        sources = " and ".join(f"{position:+g}" for position in case.sources)
        left.plot(case.x, case.target, lw=1)
        left.vlines(case.sources, 0, 1, color="red", lw=1)
        left.set_title(f"half-width {case.half_width:g}, sources at {sources}", fontsize=10)
        right.plot(case.x, case.response, lw=0.4)
        right.set_title(f"response, {100 * case.negative:.0f} % of it negative", fontsize=10)
        left.set_xlim(-1, 1)
    return _saved(figure, path)


def positions(name: str, path: Path) -> Path:
    """Draw the target, the loss landscape, and image and response at the marked positions of the second
    source."""
    target = {"square": square, "disk": disk}[name]()
    found = landscape(target)
    figure, axes = plt.subplots(2, 4, figsize=(15, 7.2), layout="constrained")
    _image(axes[0, 0], target, "wanted")
    shown = axes[1, 0].imshow(
        found.residual, origin="lower", extent=(-0.5, STEPS + 0.5, -0.5, STEPS + 0.5), cmap="viridis"
    )
    figure.colorbar(shown, ax=axes[1, 0], label="least |E * F - G| / |G|")
    axes[1, 0].set(xlabel="m", ylabel="n", title="loss landscape")
    for (above, below), (m, n), colour in zip(axes[:, 1:].T, MARKS[name], COLOURS):
        best = two_sources(target, m, n)
        axes[1, 0].plot(m, n, "o", color=colour)
        _image(above, best.image, f"({m}, {n}): residual {best.residual:.4f}")
        _image(below, best.light, "response")
        above.title.set_color(colour)
    print(
        f"{path.name}: {found.residual.size} positions, KKT residual at most {found.kkt.max():.0e}, ", end=""
    )
    print(f"residual less its lower bound at most {(found.residual - found.lower_bound).max():.0e}")
    return _saved(figure, path)


def methods(case: Case, path: Path) -> Path:
    """Draw image and response of the non-negative approximation and of three regularisations."""
    best, responses = compare(case)
    figure, axes = plt.subplots(4, 2, figsize=(7.5, 13), layout="constrained")
    for (left, right), (name, response) in zip(axes, responses.items()):
        _image(left, response.image, f"{name}: residual {response.residual:.3f}")
        _image(right, response.light, f"response, least {response.least:.2g} of the greatest")
    print(f"{path.name}: no light of a non-negative response comes below {best.lower_bound:.4f}")
    return _saved(figure, path)


def _image(axes: Axes, values: NDArray[np.float64], title: str) -> None:
    shown = axes.imshow(values, origin="lower", extent=EXTENT, cmap="gray")
    axes.figure.colorbar(shown, ax=axes)
    axes.set_title(title, fontsize=10)


def _saved(figure: plt.Figure, path: Path) -> Path:
    figure.savefig(path, dpi=110)
    plt.close(figure)
    return path


if __name__ == "__main__":
    for written in main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("exports/chapter7")):
        print(written)
