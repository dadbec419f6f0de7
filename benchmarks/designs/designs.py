"""Relative error against the seconds of a whole design, for every start, every optimiser and every engine.

Two problems: the square top hat, and the pearl on coarse levels.  A design runs in its own process, with a
few iterations and with many; its figure shows the curves.  The thesis's method optimises in
this process, batch by batch; to its seconds are added those that a design takes beside its optimisation.
Mitsuba's particle tracer takes 30 steps of Adam on its one level, the last.

Run: thbcad bench designs
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
from itertools import islice
from pathlib import Path
from statistics import median
from time import perf_counter

from benchmarks.checkout import BUILD, EXAMPLES
from benchmarks.designs.design_run import DesignRun, run_design
from benchmarks.page_picture import keep
from benchmarks.rows.row import Row
from benchmarks.thesis.chapter6.adam_batches import BOTH_FILTERED, adam_batches
from optics.interface.api import System
from optics.scene.keys import problem_to_toml
from optics.scene.problem import Problem, load_problem

FIGURE = BUILD / "designs.png"
STARTS = ("transport", "flat")
BUDGETS = (5, 20, 60)  # iterations of L-BFGS on every level that is optimised
BATCHES = 2  # of the thesis's six: each takes longer than all other designs
ENGINES = ("mitsuba-exact", "mitsuba-mesh")
PATHS_BUDGET = 30  # steps of Mitsuba's particle tracer: each takes seconds
PEARL_LEVEL = 3  # of the five in the example


@dataclass(frozen=True)
class Point:
    """A whole design.

    effort : what the method was given, in words.  seconds : from the start of the process to its end.
    """

    problem: str
    method: str
    effort: str
    seconds: float
    rel_l2: float


def rows() -> list[Row]:
    """Return the measured rows, and draw the curves."""
    points = [point for name, problem in problems() for point in _points(name, problem)]
    draw(points, FIGURE)
    out = []
    for p in points:
        out.append(Row(f"{p.problem}: {p.method}, {p.effort}: rel_l2", p.rel_l2))
        out.append(Row("  seconds of the whole design", p.seconds, "s"))
    return out


def problems() -> Iterator[tuple[str, Problem]]:
    """Yield names and problems."""
    yield "square top hat", load_problem(EXAMPLES / "tophat_square.toml")
    pearl = load_problem(EXAMPLES / "pearl.toml")
    freeform = replace(pearl.lens.rear.freeform, max_level=PEARL_LEVEL)
    rear = replace(pearl.lens.rear, freeform=freeform)
    yield f"pearl to level {PEARL_LEVEL}", replace(pearl, lens=replace(pearl.lens, rear=rear))


def _points(name: str, problem: Problem) -> Iterator[Point]:
    """Yield the designs of a problem, by start and effort, and those by the thesis's method."""
    beside = []
    for start in STARTS:
        for budget in BUDGETS:
            run = _run(problem, {"start": start}, budget)
            beside.append(run.seconds - run.metrics["wall_s"]["optimise"])
            method, effort = f"L-BFGS, {start} start", f"{budget} iterations a level"
            yield Point(name, method, effort, run.seconds, run.metrics["rel_l2"])
    for method, effort, run in _others(problem):
        yield Point(name, method, effort, run.seconds, run.metrics["rel_l2"])
    system = System(problem)
    seconds, start_time = median(beside), perf_counter()
    for k, batch in enumerate(islice(adam_batches(system, BOTH_FILTERED), BATCHES), 1):
        seconds += perf_counter() - start_time
        error = system.measure(batch.lens).metrics["rel_l2"]
        steps = f"{k * BOTH_FILTERED.iterations} steps"
        yield Point(name, "Adam of the thesis, flat start", steps, seconds, error)
        start_time = perf_counter()


def _others(problem: Problem) -> Iterator[tuple[str, str, DesignRun]]:
    """Yield (method, effort, design) by Adam and by the engines of Mitsuba, where it is installed."""
    for budget in BUDGETS:
        run = _run(problem, {"method": "adam"}, budget)
        yield "Adam, transport start", f"{budget} steps a level", run
    if find_spec("mitsuba") is None:
        return
    for engine in ENGINES:
        for budget in BUDGETS:
            run = _run(problem, {"engine": engine}, budget)
            yield f"L-BFGS, {engine}", f"{budget} iterations a level", run
    run = _run(problem, {"method": "adam"}, PATHS_BUDGET, "benchmarks.designs.camera_engine")
    yield "Adam, mitsuba-ptracer", f"{PATHS_BUDGET} steps", run


def _run(problem: Problem, changes: dict[str, str], budget: int, module: str = "") -> DesignRun:
    """Design a problem with other settings of the optimiser and number of iterations, as `run_design`."""
    optimizer = replace(problem.optimizer, **changes, iterations=(budget,))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "problem.toml"
        path.write_text(problem_to_toml(replace(problem, optimizer=optimizer)), "utf-8")
        return run_design(path, Path(folder) / "result", False, module)


def publish() -> None:
    """Keep the curves as docs/pictures/designs.webp."""
    keep(FIGURE, "designs")


def draw(points: Sequence[Point], path: Path) -> None:
    """Write the picture: one panel per problem, error against seconds."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.ticker import LogLocator, NullFormatter

    names = list(dict.fromkeys(p.problem for p in points))
    figure = Figure(figsize=(4.6 * len(names), 4.4), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(1, len(names), squeeze=False)[0]
    for name, axes in zip(names, panels):
        for method in dict.fromkeys(p.method for p in points):
            own = [(p.seconds, p.rel_l2) for p in points if (p.problem, p.method) == (name, method)]
            axes.loglog(*zip(*own), "o-", markersize=4, label=method)
        axes.set_title(name, fontsize=10)
        axes.set_xlabel("seconds of a whole design")
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_locator(LogLocator(subs=(1, 2, 4)))
            axis.set_major_formatter("{x:g}")
            axis.set_minor_formatter(NullFormatter())
        axes.grid(which="both", color="0.9")
    panels[0].set_ylabel("relative L2 error")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=8)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
