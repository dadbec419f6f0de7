"""Fit a THB-spline to a height map, with the refinement of thesis section 6.2: degree 3, 10 x 10 control
points, levels 0 to 4.

Instead of 150 steps of an optimiser every level is one least-squares fit, which is the minimum of (6.4).
The thesis shows its height map in a figure only; this one is a formula.

Run: python examples/height_map.py [picture.png]
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from io import BytesIO
from pathlib import Path

import matplotlib
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from thbcad import KnotVector, Samples, THBSpace, THBSurface, least_squares

matplotlib.use("Agg")
from matplotlib import pyplot as plt
from matplotlib.collections import PatchCollection
from matplotlib.colors import LightSource, LogNorm
from matplotlib.patches import Rectangle

GRID = np.linspace(0, 1, 225)  # N = M vertices (6.1)
LEVELS = 5
ALPHA = 0.5  # threshold of (6.3)
Mean = Callable[[THBSpace, NDArray[np.float64]], NDArray[np.float64]]  # the indicators' mean, for every cell


def height_map(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a broad hill with a crater, a knoll beside it, and a valley."""
    r = np.hypot(x - 0.36, y - 0.44)
    hill = 0.35 * np.exp(-((r / 0.5) ** 2))
    rim = 0.08 * np.exp(-(((r - 0.15) / 0.022) ** 2))
    knoll = 0.12 * np.exp(-((np.hypot(x - 0.8, y - 0.22) / 0.035) ** 2))
    valley = -0.12 * np.exp(-(((x + y - 1.6) / 0.05) ** 2))
    return hill + rim + knoll + valley


def indicator(surface: THBSurface, samples: Samples) -> NDArray[np.float64]:
    """Return the sums of the vertex gradients in the leaf cells (6.2), (cells,), times the loss.

    The gradient of the loss (6.4) by a vertex height is the residual there over the loss.
    """
    residual = np.abs(surface(samples.u, samples.v) - samples.values)
    return np.bincount(surface.space.locate(samples.u, samples.v), residual, len(surface.space.cells))


def leaf_mean(space: THBSpace, sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the mean over all leaf cells, for every cell."""
    return np.full(len(space.cells), sums.mean())


def mark(
    surface: THBSurface, samples: Samples, alpha: float = ALPHA, mean: Mean = leaf_mean
) -> dict[int, NDArray[np.int64]]:
    """Return the leaf cells whose indicator exceeds alpha times a mean (6.3)."""
    space, sums = surface.space, indicator(surface, samples)
    chosen = space.cells[sums > alpha * mean(space, sums)]
    return {level: chosen[chosen[:, 0] == level, 1:] for level in np.unique(chosen[:, 0]).tolist()}


def error(surface: THBSurface, samples: Samples) -> float:
    """Return the root mean square error: the loss (6.4) over the square root of the number of vertices."""
    return float(np.sqrt(np.mean((surface.grid(GRID, GRID).ravel() - samples.values) ** 2)))


def refined(samples: Samples) -> list[THBSurface]:
    """Return the THB fits of all levels."""
    kv = KnotVector.uniform(3, 7)
    fits = [least_squares(THBSpace(kv, kv), samples)]
    while len(fits) < LEVELS:
        fits.append(least_squares(fits[-1].space.refine(mark(fits[-1], samples)), samples))
    return fits


def uniform(samples: Samples) -> list[THBSurface]:
    """Return the fits with all cells refined."""
    knots = (KnotVector.uniform(3, 7 << level) for level in range(LEVELS))
    return [least_squares(THBSpace(kv, kv), samples) for kv in knots]


def draw(samples: Samples, fits: list[THBSurface], others: list[THBSurface], path: Path) -> None:
    """Write the picture: target and convergence above; surface, mesh and error of every level below."""
    figure = plt.figure(figsize=(12, 10.4), layout="constrained")
    above, below = figure.subfigures(2, 1, height_ratios=[1, 2.35])
    target, curves = above.subplots(1, 2, width_ratios=[1, 2])
    relief(target, samples.values.reshape(len(GRID), -1), "height map")
    convergence(curves, samples, fits, others)
    axes = below.subplots(3, LEVELS)
    for (top, middle, bottom), (level, surface) in zip(axes.T, enumerate(fits)):
        heights = surface.grid(GRID, GRID)
        relief(top, heights, f"level {level}: {surface.space.dim} control points")
        mesh(middle, surface.space, f"{len(surface.space.cells)} cells")
        residual = np.maximum(np.abs(heights - samples.values.reshape(heights.shape)), 1e-6).T
        image = bottom.imshow(
            residual,
            origin="lower",
            extent=(0, 1, 0, 1),
            cmap=plt.get_cmap("magma", 10),
            norm=LogNorm(1e-6, 1e-1),
        )
        bottom.set_title(f"rms error {error(surface, samples):.1e}", fontsize=10)
    for ax in (target, *axes.ravel()):
        ax.set(xticks=[], yticks=[])
    below.colorbar(image, ax=axes[2, :], label="|error|", aspect=12, pad=0.01)
    buffer = BytesIO()
    figure.savefig(buffer, dpi=88)
    plt.close(figure)
    Image.open(buffer).convert("RGB").quantize(256).save(path, optimize=True)


def relief(ax: plt.Axes, heights: NDArray[np.float64], title: str) -> None:
    """Draw heights as a shaded relief."""
    shade = LightSource(azdeg=315, altdeg=40).shade(
        heights.T, plt.get_cmap("gist_earth"), blend_mode="soft", vmin=-0.25, vmax=0.6, vert_exag=120
    )
    ax.imshow(shade, origin="lower", extent=(0, 1, 0, 1))
    ax.set_title(title, fontsize=10)


def mesh(ax: plt.Axes, space: THBSpace, title: str) -> None:
    """Draw the leaf cells, darker by level."""
    patches = [Rectangle((u0, v0), u1 - u0, v1 - v0) for u0, u1, v0, v1 in space.boxes]
    cells = PatchCollection(patches, edgecolor="0.25", linewidth=0.25, cmap="Blues", clim=(-0.5, LEVELS))
    cells.set_array(space.cells[:, 0])
    ax.add_collection(cells)
    ax.set(xlim=(0, 1), ylim=(0, 1), aspect="equal")
    ax.set_title(title, fontsize=10)


def convergence(ax: plt.Axes, samples: Samples, fits: list[THBSurface], others: list[THBSurface]) -> None:
    """Draw error over degrees of freedom."""
    for surfaces, label, style in ((others, "uniform refinement", "s--"), (fits, "THB refinement", "o-")):
        ax.loglog([s.space.dim for s in surfaces], [error(s, samples) for s in surfaces], style, label=label)
    ax.set(xlabel="control points", ylabel="rms error")
    ax.grid(which="both", alpha=0.25)
    ax.legend(frameon=False)


def main(path: Path) -> list[tuple[int, float, int, float]]:
    """Print and return (control points, error, the same of uniform refinement) per level, and write the
    picture."""
    samples = Samples.grid(GRID, GRID, height_map(GRID[:, None], GRID))
    fits, others = refined(samples), uniform(samples)
    table = [(a.space.dim, error(a, samples), b.space.dim, error(b, samples)) for a, b in zip(fits, others)]
    print("level   THB  rms error   uniform  rms error")
    for level, row in enumerate(table):
        print("{:5d} {:5d}  {:9.2e}   {:7d}  {:9.2e}".format(level, *row))
    draw(samples, fits, others, path)
    return table


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_suffix(".png"))
