"""Progress of a design on stderr: its phase, the fraction done and the time left."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from math import prod
from time import perf_counter
from typing import cast

from optics.base.runtime import Phase, Progress, ProgressEvent
from optics.designing.optimisation import Row, Stage, stage_seconds
from optics.designing.progress.progress_bar import Bar, Lines, drawing
from optics.scene.keys import AUTO
from optics.scene.problem import FINEST_AUTO, Freeform, per_level
from optics.scene.system import System

SETUP, START = "setup", "start surface"
# in evaluations: what the first one of a stage takes more, for which programs are compiled, and what one that
# only estimates curvature takes
FIRST, PROBE = 2.0, 0.5
TRIES = 1.05  # evaluations per iteration: line searches take some
AHEAD = 1.05  # of the evaluations so far: what a stage takes that has more
SEARCHED = 1.35  # times the seconds of a stage, where rays are searched for
FURTHER = 0.6  # of the seconds of a stage, for every free surface but the first
LOADING = 0.7  # seconds, of packages
FLAT = 0.6  # of a start without a map
# how much the seconds of loading tell of the machine, and those with a transport map
DISK, MAPPING = 0.6, 0.6
MOST_GROWTH = 4.0  # of the degrees of freedom from level to level: all cells are refined
CELLS = 9  # per pixel, of a stage before it is planned
FOLLOWING = {
    SETUP: START,
    "optimise": "export",
    "export": "measure",
    "measure": "verify",
    "verify": "figures",
}


@dataclass(frozen=True)
class Size:
    """What the time of the phases depends on that have no stages.

    The times are seconds, as measured on the examples, for two quiet cores.

    pixels : of the target.  surfaces : that are free.
    extended, by_edges, blurred : of the system's source, light path and light.
    automatic : the transport map comes before all else, since it tells what is left to the program.
    flat : there is no such map.
    dof : degrees of freedom where every cell is refined; where the level is left to the program, up to the
        last but one.
    """

    pixels: int
    surfaces: int
    extended: bool
    by_edges: bool
    blurred: bool
    automatic: bool
    dof: float
    flat: bool = False

    @classmethod
    def of(cls, system: System) -> Size:
        columns, rows = system.target.settings.pixels
        free = system.problem.optic.free.values()
        return cls(
            pixels=columns * rows,
            surfaces=len(system.freeforms),
            extended=system.source.extended,
            by_edges=system.by_edges,
            blurred=system.blurred,
            automatic=system.problem.optic.automatic or any(f.max_level == AUTO for f in free),
            dof=sum(prod((n << _finest(f)) + f.degree for n in f.spans) for f in free),
            flat=system.problem.optimizer.start == "flat",
        )

    def stage(self, iterations: int) -> Phase:
        """Return the one stage that all are taken for before they are planned."""
        return Phase("level 0", stage_seconds(iterations, CELLS * self.pixels, self.dof))

    def earlier(self) -> list[Phase]:
        """Return the phases before the first stage."""
        alone, aiming = not self.by_edges, 10.0 if self.by_edges else 0.0  # past edges
        mapped = FLAT if self.flat else 0.2 + 1.9e-5 * self.pixels + aiming
        if self.automatic:
            return [Phase(SETUP, LOADING + mapped, MAPPING, alone), Phase(START, 0.1, on_one_core=True)]
        return [Phase(SETUP, LOADING, DISK, True), Phase(START, mapped, on_one_core=alone)]

    def later(self, dof: float) -> list[Phase]:
        """Return the phases behind the last stage, of a lens with so many degrees of freedom.

        As measured where another process drew most figures beside the measurement.  All phases work on one
        core, but for a measurement that traces much.
        """
        measure = 0.45 + (2.5e-5 if self.extended else 1.0e-5) * self.pixels + 2e-6 * dof
        if self.by_edges:  # all reflections are traced
            measure += (8.0 if self.blurred else 2.0) if self.extended else 3.0
        if self.blurred:  # by many directions
            measure += 6e-5 * self.pixels
        alone = not (self.by_edges or self.blurred or self.extended)
        verify = 0.85 + 0.7e-5 * dof
        if self.by_edges:
            verify += 1.0 if self.extended and not self.blurred else 2.3
        return [
            Phase("export", 0.05 + 2e-6 * dof, on_one_core=True),
            Phase("measure", measure, on_one_core=alone),
            Phase("verify", verify, on_one_core=True),
            Phase("figures", min(0.9, max(0.1, 3.0 - measure - verify)), on_one_core=True),
        ]


USUAL = Size(
    pixels=65536, surfaces=1, extended=False, by_edges=False, blurred=False, automatic=False, dof=50_000.0
)
USUAL_ITERATIONS = 60


class DesignProgress:
    """The progress of a design; its phases are named in the order of the run.

    show : called with every ProgressEvent; by default it is drawn on stderr.  clock : seconds.
    watch : called with every one too.
    """

    def __init__(
        self,
        show: Callable[[ProgressEvent], None] | None = None,
        clock: Callable[[], float] = perf_counter,
        watch: Callable[[ProgressEvent], None] | None = None,
    ) -> None:
        self._drawing = None if show else drawing(sys.stderr)
        self._size = USUAL
        phases = [*USUAL.earlier(), USUAL.stage(USUAL_ITERATIONS), *USUAL.later(USUAL.dof)]
        shows = (show or cast("Bar | Lines", self._drawing), watch)
        self._progress = Progress(phases, lambda event: [shown(event) for shown in shows if shown], clock)
        self._first = self._rows = 0  # of the present stage: its first evaluation, and rows so far

    def __enter__(self) -> DesignProgress:
        return self

    def __exit__(self, *error: object) -> None:
        if error[0] is None:
            self._progress.finish()
        if self._drawing:
            self._drawing.close()

    def asked(self, system: System) -> None:
        """Say what is asked for, before it is known what is left to the program."""
        self._size, problem = Size.of(system), system.problem
        iterations = per_level(problem.optimizer.iterations, max(map(_finest, system.freeforms)))
        ahead = [self._size.stage(iterations), *self._size.later(self._size.dof)]
        self._progress.expect([*self._size.earlier(), *ahead])

    def planned(self, size: Size, plan: Sequence[Stage]) -> None:
        """Say what will be done, as soon as it is known."""
        self._size = replace(size, automatic=self._size.automatic)
        self._progress.expect([*self._size.earlier(), *self._stages(plan, 0), *self._size.later(size.dof)])
        if self._drawing:
            self._drawing.keep_alive(self._progress.report)

    def over(self, phase: str) -> None:
        """Say that a phase of the run is over."""
        if phase in FOLLOWING:
            self._progress.begin(FOLLOWING[phase])

    def __call__(self, plan: Sequence[Stage], stage: Stage, dof: int, row: Row | None) -> None:
        """Say that a stage begins, where there is no row, or that an evaluation of it is over."""
        if row is None:
            rest = plan[plan.index(stage) :]
            last = dof * self._growth(rest, dof) ** (rest[-1].level - stage.level)
            self._progress.expect([*self._stages(rest, dof), *self._size.later(last)])
            self._progress.begin(_name(stage))
            self._first = self._rows = 0
            return
        self._first = self._first or row.evaluation
        self._rows += 1
        evaluations = row.evaluation - self._first + 1
        first = FIRST + stage.before * stage.evaluations / (stage.seconds(dof) - stage.before)
        done = first + self._rows + PROBE * (evaluations - self._rows)
        rows = max(TRIES * (stage.iterations + 1), AHEAD * self._rows)
        whole = first + rows + PROBE * (stage.evaluations - stage.iterations - 1)
        self._progress.advance(done / whole, f"{dof} DOF, {evaluations} evaluations, misfit {row.fit:.4f}")

    def _stages(self, stages: Sequence[Stage], dof: float) -> list[Phase]:
        """Return the phases of stages, the first of which has so many degrees of freedom; 0 if unknown."""
        growth = self._growth(stages, dof)
        if not dof:
            dof = self._size.dof / growth ** (stages[-1].level - stages[0].level)
        each = (SEARCHED if self._size.by_edges else 1.0) * (1 + FURTHER * (self._size.surfaces - 1))
        return [
            Phase(_name(s), each * s.seconds(dof * growth ** (s.level - stages[0].level))) for s in stages
        ]

    def _growth(self, stages: Sequence[Stage], dof: float) -> float:
        """Return the growth of the degrees of freedom from level to level, up to those of the whole mesh."""
        levels = stages[-1].level - stages[0].level
        return min(MOST_GROWTH, (self._size.dof / dof) ** (1 / levels)) if levels and dof else MOST_GROWTH


def _finest(freeform: Freeform) -> int:
    return FINEST_AUTO - 1 if freeform.max_level == AUTO else freeform.finest


def _name(stage: Stage) -> str:
    return stage.name if stage.iterations else f"mesh of {stage.name}"


class RunClock:
    """The phases of a run so far, seconds by name."""

    def __init__(self, progress: DesignProgress) -> None:
        self.progress = progress
        self._start = self._mark = perf_counter()
        self.phases: dict[str, float] = {}

    def lap(self, name: str) -> None:
        """End a phase."""
        now = perf_counter()
        self.phases[name] = now - self._mark
        self._mark = now
        self.progress.over(name)

    def total(self) -> dict[str, float]:
        """Return the seconds of every phase, and of the whole run."""
        return {**self.phases, "total": perf_counter() - self._start}


class Notes(list[str]):
    """Sentences in the order in which they came; call it to add one.

    listener : called with every new sentence.
    """

    def __init__(
        self, sentences: Iterable[str] = (), listener: Callable[[str], object] | None = None
    ) -> None:
        super().__init__(sentences)
        self._listener = listener

    def __call__(self, sentence: str) -> None:
        if sentence not in self:
            self.append(sentence)
            if self._listener is not None:
                self._listener(sentence)
