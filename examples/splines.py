"""Splines from the knot vector to the THB surface: the pictures of docs/thesis/chapter3.md.

    python examples/splines.py [folder]

draws five pictures into the folder (examples/splines by default) and prints what they count.  They follow
figures 3.3-3.14 of A. N. M. Heemels, Composing Light (thesis, TU Delft); its splines here have degree 2.
Blue is level 0, orange level 1, purple level 2, teal a truncated function.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

import matplotlib
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array

from thbcad import KnotVector, THBSpace, THBSurface

matplotlib.use("Agg")
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import LightSource, to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle
from mpl_toolkits.mplot3d.art3d import Line3DCollection

Array = NDArray[np.float64]

LINES = ("#2f6690", "#d9701a", "#7d3c98")  # functions of level 0, 1, 2
CELLS = ("#e4edf4", "#f9cf9c", "#c79bd6")  # cells of level 0, 1, 2
SHADES = ("#16425b", "#3d7ea6", "#86b8da")
TRUNCATED, RED, ROSE, GREY, INK = "#128277", "#c1272d", "#edc3bf", "#bbbbbb", "#222222"
STYLE = {
    "font.size": 9,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
}

KNOTS = KnotVector.uniform(degree=2, spans=4)  # {0, 0, 0, 0.25, 0.5, 0.75, 1, 1, 1}
WANTED = [(0, 0), (1, 2)]  # the cells [0, 0.25] x [0, 0.25] and [0.25, 0.5] x [0.5, 0.75]
U = np.linspace(0, 1, 801)


def unclamped_functions(degree: int, breaks: Sequence[float], u: Array) -> Array:
    """Return the functions of one degree on knots that are not repeated (3.5, 3.6), (len(u), len(breaks) - 1
    - degree).

    For degree 0 they say which span holds u.  For higher degrees they are the functions of the
    clamped knot vector that do not reach a repeated knot.
    """
    if degree == 0:
        return 1.0 * (np.searchsorted(breaks, u, side="right")[:, None] - 1 == np.arange(len(breaks) - 1))
    clamped = KnotVector(degree, np.pad(breaks, degree, mode="edge"))
    return clamped.collocation(u).toarray()[:, degree : len(breaks) - 1]


def strip_space(*refined: Iterable[int]) -> THBSpace:
    """Return a one-dimensional THB space: strips of the square, one span wide in v.

    refined : for each level in turn, the spans in u that are bisected.
    """
    space = THBSpace(KNOTS, KnotVector.uniform(degree=1, spans=1))
    for level, spans in enumerate(refined):
        space = space.refine({level: [(i, j) for i in spans for j in range(2**level)]})
    return space


def strip_bases(space: THBSpace, u: Array) -> tuple[Array, Array]:
    """Return the truncated and the hierarchical basis in u, both (len(u), functions of u), level by level.

    Over strips a function (level, i, j) is T_i(u) M_j(v), and the M_j sum to one: so does the sum over j.
    """
    _, group = np.unique(space.functions[:, :2], axis=0, return_inverse=True)
    over_j = csr_array((np.ones(space.dim), (np.arange(space.dim), group)))
    values = space.collocation(u, np.zeros_like(u))
    return (values @ over_j).toarray(), (values @ space.hierarchical() @ over_j).toarray()


def refinements() -> dict[str, THBSpace]:
    """Return {what was done: space} of figure 3.6: knots through the whole surface, then cells alone."""
    space, block = THBSpace(KNOTS, KNOTS), [(i, j) for i in (1, 2) for j in (1, 2)]
    both = space.refine({0: WANTED})
    return {
        "two cells to refine": space,
        "a knot at $u$ = 0.4": THBSpace(KNOTS.insert(0.4), KNOTS),
        "a second knot at $v$ = 0.1": THBSpace(KNOTS.insert(0.4), KNOTS.insert(0.1)),
        "THB: both cells": both,
        "THB: the inner cell twice": both.refine({1: [(i, j) for i in (2, 3) for j in (4, 5)]}),
        "THB: a block of 2 x 2 cells": space.refine({0: [WANTED[0], *block]}),
    }


def cut_cells(space: THBSpace) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return for each leaf cell the cell (i, j) of KNOTS x KNOTS that holds it, (n, 2), and whether that one
    is cut, (n,)."""
    u0, u1, v0, v1 = space.boxes.T
    parents = np.column_stack([u0 + u1, v0 + v1]) / 2 * KNOTS.spans
    return parents.astype(np.int64), (u1 - u0) * (v1 - v0) < 1 / KNOTS.spans**2


def wave_spaces() -> list[THBSpace]:
    """Return spaces of one, two and three levels along the curve v = 0.5 + 0.28 sin(2 pi u).

    Omega_1 holds the cells of level 0 with centres less than 0.25 above or below it, Omega_2 those of level 1
    less than 0.1.
    """
    kv = KnotVector.uniform(degree=2, spans=8)
    spaces = [THBSpace(kv, kv)]
    for level, reach in enumerate((0.25, 0.1)):
        cells = spaces[-1].cells[spaces[-1].cells[:, 0] == level, 1:]
        u, v = (cells.T + 0.5) / (kv.spans * 2**level)
        spaces.append(spaces[-1].refine({level: cells[abs(v - 0.5 - 0.28 * np.sin(2 * np.pi * u)) < reach]}))
    return spaces


def draw_functions(
    axes: Axes, u: Array, values: Array, colours: Sequence[str], names: Sequence[str] = ()
) -> None:
    """Draw the columns of `values` over u where they are not zero, each with its name at its top."""
    for k, column in enumerate(values.T):
        axes.plot(
            u,
            np.where(column > 0, column, np.nan),
            color=colours[k % len(colours)],
            lw=1.7,
            solid_capstyle="round",
        )
        if names:
            middle = np.flatnonzero(column == column.max()).mean() / (len(u) - 1)
            place = {0.0: "left", 1.0: "right"}.get(middle, "center")
            at = (u[0] + middle * (u[-1] - u[0]), column.max())
            axes.annotate(
                names[k],
                at,
                (0, 4.5),
                textcoords="offset points",
                color=colours[k % len(colours)],
                ha=place,
                fontsize=8.5,
            )


def draw_sums(plots: Iterable[tuple[int, Axes]], finer: KnotVector, old: str, new: str, top: float) -> None:
    """Draw functions i of KNOTS as sums of functions of finer knots: N_i = sum_j R_ij N~_j (3.22)."""
    whole, parts = KNOTS.collocation(U).toarray(), finer.collocation(U).toarray()
    r = KNOTS.prolongation(finer).T.toarray()
    for i, axes in plots:
        terms = np.flatnonzero(r[i])
        for part in (r[i, terms] * parts[:, terms]).T:
            axes.fill_between(U, part, color=LINES[1], alpha=0.22, lw=0)
            draw_functions(axes, U, part[:, None], LINES[1:2])
        draw_functions(axes, U, whole[:, i : i + 1], LINES[:1])
        formula = " + ".join(rf"{r[i, j]:.2g}\,{new.format(j)}".removeprefix("1") for j in terms)
        frame(
            axes,
            finer.breaks if len(finer.breaks) < 7 else KNOTS.breaks,
            top,
            f"${old.format(i)} = {formula}$",
        )


def frame(axes: Axes, ticks: ArrayLike, top: float, title: str) -> None:
    """Give a plot of functions its knots as ticks, its range and its title."""
    axes.set_xticks(ticks, [f"{t:g}".replace("0.", "." if len(ticks) > 6 else "0.") for t in ticks])
    axes.set_yticks([0, 0.5, 1])
    axes.set(ylim=(0, top), xlim=(ticks[0] - 0.01 * ticks[-1], 1.01 * ticks[-1]))
    axes.grid(axis="x", color="0.9", lw=0.8)
    axes.set_axisbelow(True)
    axes.set_title(title)


def draw_basis() -> Figure:
    """Figure 3.3: the functions of degree 0, 1 and 2 on {0, 0.1, 0.2, 0.3}."""
    breaks, u = [0, 0.1, 0.2, 0.3], np.linspace(0, 0.3, 901)
    figure, plots = plt.subplots(1, 3, figsize=(9, 2.3), layout="constrained")
    for degree, axes in enumerate(plots):
        values = unclamped_functions(degree, breaks, u)
        draw_functions(axes, u, values, SHADES, [f"$N_{{{i},{degree}}}$" for i in range(values.shape[1])])
        frame(axes, breaks, 1.22, f"degree {degree}")
    return figure


def draw_insertion() -> Figure:
    """Figures 3.4 and 3.5: a knot at 0.4, and the old functions as sums of new ones (3.24)."""
    finer, figure = KNOTS.insert(0.4), plt.figure(figsize=(9, 4.6), layout="constrained")
    top, bottom = figure.subfigures(2, 1)
    cases = ((KNOTS, LINES[0], "N", ""), (finer, LINES[1], r"\tilde N", ": a knot at 0.4"))
    for axes, (kv, colour, letter, why) in zip(top.subplots(1, 2), cases):
        draw_functions(
            axes, U, kv.collocation(U).toarray(), [colour], [f"${letter}_{i}$" for i in range(kv.dim)]
        )
        frame(axes, kv.breaks, 1.22, f"{kv.dim} functions{why}")
    draw_sums(enumerate(bottom.subplots(1, 3), start=1), finer, "N_{}", r"\tilde N_{}", 0.9)
    return figure


def draw_cells(axes: Axes, boxes: Array, colours: Sequence[str], ticks: ArrayLike = ()) -> None:
    """Draw cells [u0, u1, v0, v1], (n, 4), each in its colour."""
    corners = np.stack([boxes[:, [0, 1, 1, 0]], boxes[:, [2, 2, 3, 3]]], axis=-1)
    axes.add_collection(PolyCollection(corners, facecolors=colours, edgecolors="0.3", linewidths=0.6))
    axes.set(xlim=(-0.01, 1.01), ylim=(-0.01, 1.01), aspect="equal")
    axes.set_xticks(ticks, [f"{t:g}" for t in ticks])
    axes.set_yticks(ticks, [f"{t:g}" for t in ticks])
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)


def draw_refinement() -> Figure:
    """Figure 3.6: what knots and what cells refine, and how many functions they give."""
    figure, plots = plt.subplots(2, 3, figsize=(9, 6.8), layout="constrained")
    for axes, (title, space) in zip(plots.flat, refinements().items()):
        parents, cut = cut_cells(space)
        wanted = (parents[:, None] == np.array(WANTED)).all(axis=2).any(axis=1)
        draw_cells(
            axes,
            space.boxes,
            np.where(cut, np.where(wanted, CELLS[1], ROSE), CELLS[0]).tolist(),
            KNOTS.breaks,
        )
        for i, j in WANTED:
            axes.add_patch(Rectangle((i / 4, j / 4), 0.25, 0.25, fill=False, edgecolor=RED, lw=2.2, zorder=3))
        axes.set_title(f"{title}\n{space.dim} functions, {len(np.unique(parents[cut], axis=0))} cells cut")
    kinds = {"to refine": ("none", RED), "cut": (CELLS[1],) * 2, "cut, but not asked for": (ROSE,) * 2}
    handles = [
        Patch(facecolor=face, edgecolor=edge, lw=2, label=label) for label, (face, edge) in kinds.items()
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False)
    return figure


def draw_levels(plots: Sequence[Axes]) -> None:
    """Figures 3.7 and 3.9: the bases of levels 0 and 1, and the functions of level 0 with support in [0,
    0.5]."""
    inside = [LINES[0] if end <= 0.5 else GREY for end in KNOTS.knots[KNOTS.degree + 1 :]]
    cases = ((KNOTS, LINES[:1], 0), (KNOTS.bisect(), LINES[1:2], 1), (KNOTS, inside, 0))
    for axes, (kv, colours, level) in zip(plots, cases):
        draw_functions(
            axes, U, kv.collocation(U).toarray(), colours, [f"$N_{i}^{level}$" for i in range(kv.dim)]
        )
        frame(axes, kv.breaks, 1.22, f"level {level}: {kv.dim} functions")
    plots[2].set_title(r"level 0: support in $\Omega_1$ = [0, 0.5]")


def draw_hierarchy(plots: Sequence[Axes]) -> None:
    """Figures 3.10-3.13: the hierarchical basis, the truncation of N_2^0 (3.32) and the truncated basis."""
    space = strip_space([0, 1])
    truncated, hierarchical = strip_bases(space, U)
    names = [f"$N_{i}^{level}$" for level, i in np.unique(space.functions[:, :2], axis=0)]
    short, colours = r"trunc $N_2^0$", [LINES[0]] * 4 + [LINES[1]] * 4
    draw_functions(plots[0], U, hierarchical, colours, names)
    draw_functions(plots[2], U, truncated, [TRUNCATED, *colours[1:]], [short, *names[1:]])
    for axes, values in ((plots[0], hierarchical), (plots[2], truncated)):
        axes.plot(U, values.sum(axis=1), color=INK, lw=1.2, ls=(0, (4, 2)))
        axes.annotate(f"sum, at most {values.sum(axis=1).max():.3g}", (0.72, 1.05), color=INK, ha="center")
    finer = KNOTS.bisect()
    parts = finer.collocation(U).toarray() * KNOTS.prolongation(finer).toarray()[:, 2]
    plots[1].plot(U, np.where(parts > 0, parts, np.nan)[:, 2:4], color=RED, lw=1.4, ls=(0, (4, 2)))
    for values, colour in (
        (parts[:, 4:6], LINES[1]),
        (hierarchical[:, :1], LINES[0]),
        (truncated[:, :1], TRUNCATED),
    ):
        draw_functions(plots[1], U, values, [colour])
    for name, at, colour in (
        ("$N_2^0$", (0.375, 0.79), LINES[0]),
        (short, (0.53, 0.6), TRUNCATED),
        ("set to zero", (0.015, 0.66), RED),
    ):
        plots[1].annotate(name, at, color=colour, fontsize=8.5)
    for axes, title in zip(plots, ("hierarchical basis", "truncation", "truncated basis")):
        axes.axvspan(0, 0.5, color=CELLS[1], alpha=0.4, lw=0, zorder=0)
        frame(axes, KNOTS.breaks, 1.75, title)


def draw_truncation() -> Figure:
    """Figures 3.7-3.13: two levels, the refinement of [0, 0.5], and truncation."""
    figure, plots = plt.subplots(3, 3, figsize=(10, 6.8), layout="constrained")
    draw_levels(plots[0])
    draw_sums(enumerate(plots[1]), KNOTS.bisect(), "N_{}^0", "N_{}^1", 1.22)
    draw_hierarchy(plots[2])
    return figure


def draw_relief(axes: Axes, surface: THBSurface) -> None:
    """Draw the surface as a graph over the square, its cells coloured by level and edged."""
    space, steps = surface.space, 128
    grid = np.linspace(0, 1, steps + 1)
    u, v = np.meshgrid(grid, grid, indexing="ij")
    z, middle = surface.grid(grid, grid), (grid[:-1] + grid[1:]) / 2
    leaf = space.locate(np.repeat(middle, steps), np.tile(middle, steps)).reshape(steps, steps)
    colours = np.array([to_rgb(colour) for colour in CELLS])[space.cells[leaf, 0]]
    light = LightSource(azdeg=300, altdeg=50).shade_rgb(
        colours, z[:-1, :-1], vert_exag=0.5, dx=1 / steps, dy=1 / steps, blend_mode="soft"
    )
    axes.computed_zorder = False
    axes.plot_surface(u, v, z, facecolors=light, rstride=1, cstride=1, shade=False, antialiased=False)
    around = np.linspace(0, 1, 9)
    low, high = np.zeros(9), np.ones(9)
    loop = np.stack([np.r_[around, high, around[::-1], low], np.r_[low, around, high, around[::-1]]], axis=-1)
    at = space.boxes[:, None, [0, 2]] + loop * (space.boxes[:, None, [1, 3]] - space.boxes[:, None, [0, 2]])
    height = surface(*at.reshape(-1, 2).T).reshape(*at.shape[:2], 1)
    axes.add_collection3d(
        Line3DCollection(np.concatenate([at, height], axis=2), colors="0.25", linewidths=0.45, zorder=3)
    )
    axes.set_axis_off()
    axes.set(xlim=(0, 1), ylim=(0, 1), zlim=(-0.8, 0.8))
    axes.set_box_aspect((1, 1, 0.18))
    axes.view_init(elev=46, azim=-62)


def draw_surface() -> Figure:
    """Figure 3.14: nested domains, the hierarchical mesh, and a surface with random z of its control
    points."""
    spaces = wave_spaces()
    space = spaces[-1]
    sizes = 0.5 ** space.functions[:, 0]
    surface = THBSurface(space, sizes * np.random.default_rng(5).uniform(-1, 1, space.dim))
    figure = plt.figure(figsize=(10, 4.9), layout="constrained")
    grid = figure.add_gridspec(2, 4)
    mesh = figure.add_subplot(grid[0, 0])
    draw_cells(mesh, space.boxes, [CELLS[k] for k in space.cells[:, 0]])
    mesh.set_title(f"{len(space.cells)} cells, {space.dim} functions")
    for level, coarser in enumerate(spaces):
        domain = coarser.boxes[coarser.cells[:, 0] == level]
        axes = figure.add_subplot(grid[divmod(level + 1, 2)])
        draw_cells(axes, domain, [CELLS[level]] * len(domain))
        axes.set_title(rf"$\Omega_{level}$: {len(domain)} cells")
    draw_relief(figure.add_subplot(grid[:, 2:], projection="3d"), surface)
    return figure


def main(folder: Path) -> None:
    """Draw every picture into the folder and print what they count."""
    folder.mkdir(parents=True, exist_ok=True)
    pictures = {"basis": draw_basis, "insertion": draw_insertion, "refinement": draw_refinement}
    pictures |= {"truncation": draw_truncation, "surface": draw_surface}
    with plt.rc_context(STYLE):
        for name, draw in pictures.items():
            figure = draw()
            figure.savefig(
                folder / f"{name}.png", dpi=100, metadata={"Software": None}, pil_kwargs={"optimize": True}
            )
            plt.close(figure)
    print("functions:", *(space.dim for space in refinements().values()))
    truncated, hierarchical = (basis.sum(axis=1).max() for basis in strip_bases(strip_space([0, 1]), U))
    print(f"largest sum: truncated basis {truncated:.6f}, hierarchical basis {hierarchical:.6f}")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_suffix(""))
