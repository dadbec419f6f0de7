"""The pictures of study 7."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from benchmarks.checkout import EXAMPLES
from benchmarks.thesis.chapter6.batch_pictures import (
    batch_rows,
    ends,
    last_lens,
    lens_views,
    loss_curves,
    plain_numbers,
    scene,
)
from benchmarks.thesis.drawing import plt, png
from benchmarks.thesis.records import Results
from optics.scene.problem import load_problem
from optics.scene.system import System

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CURVES = {
    "THB": "thb",
    "uniform": "uniform",
    "finest net from the start": "fixed",
    "the same, smallest step": "fixed, small steps",
}
COLUMNS = {
    "THB": "thb",
    "uniform": "uniform",
    "finest net": "fixed",
    "smallest step": "fixed, small steps",
    "THB, T filtered": "thb, filtered",
    "R as printed": "thb, as printed",
    "own, 5 mm": "own",
    "own, 6.5 mm": "own, wider bound",
}
OWN_UNIFORM = ("own, level 2 less", "own, level 1 less", "own, wider bound")
OWN_THB = ("own, alpha 2", "own, alpha 1", "own, alpha 0.3")


def pictures(results: Results) -> Iterator[tuple[str, bytes]]:
    """Yield names and PNG."""
    thb = results["thb"]
    yield "study7_thb", batch_rows(thb)
    yield "study7_uniform", batch_rows(results["uniform"])
    yield "study7_loss", _losses(results)
    wanted = thb.arrays["wanted"]
    yield "study7_controls", ends({title: results[name] for title, name in COLUMNS.items()}, wanted)
    pixels = list(wanted.shape[::-1])
    problem = load_problem(EXAMPLES / "thesis" / "pearl.toml").with_(**{"target.pixels": pixels})
    system = System(problem)
    yield "study7_lens", lens_views(system.base, last_lens(system, thb))
    yield "study7_scene", scene(system, thb)


def _losses(results: Results) -> bytes:
    figure, (by_step, by_dof, own) = plt.subplots(1, 3, figsize=(11, 3.6), layout="constrained")
    runs = {title: results[name] for title, name in CURVES.items()}
    loss_curves(by_step, runs, ("THB", "uniform"))
    _ends_of_batches(by_dof, results, "loss", "loss in the window")
    _ends_of_batches(own, results, "rel_l2", "rel_l2, box pixels")
    for names, mark, label in ((OWN_UNIFORM, "ks--", "own, uniform"), (OWN_THB, "kx:", "own, THB")):
        points = [(results[n].numbers["dof"], results[n].numbers["rel_l2"]) for n in names]
        own.loglog(*zip(*points), mark, ms=4, lw=1, label=label)
    own.legend(fontsize=7)
    plain_numbers(own.yaxis)
    return png(figure)


def _ends_of_batches(ax: Axes, results: Results, key: str, label: str) -> None:
    for title, mark in (("THB", "C0o-"), ("uniform", "C1s-")):
        numbers = results[CURVES[title]].numbers
        ax.loglog(numbers["dof"], numbers[key], mark, ms=4, lw=1, label=title)
    ax.grid(which="both", alpha=0.25)
    ax.set(xlabel="degrees of freedom", ylabel=label)
    ax.legend(fontsize=7)
    plain_numbers(ax.yaxis)
