"""Progress of a design on stderr: its phase, the fraction done and the time left."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import TYPE_CHECKING, cast

from optics.progress.progress_bar import drawing
from optics.runtime import Phase, Progress

if TYPE_CHECKING:
    from optics.optimisation import Row, Stage
    from optics.progress.progress_bar import Bar, Lines
    from optics.runtime import Moment
    from optics.system import OpticalSystem

SETUP, START = "setup", "start surface"
# in evaluations: what the first one of a stage takes more, for which programs are compiled, and what one that
# only estimates curvature takes
FIRST, PROBE = 2.0, 0.5
GROWTH = 2.5  # of the degrees of freedom from level to level
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
    extended, by_edges : of the system's source and light path
    """

    pixels: int
    surfaces: int
    extended: bool
    by_edges: bool

    @classmethod
    def of(cls, system: OpticalSystem) -> Size:
        columns, rows = system.target.settings.pixels
        return cls(columns * rows, len(system.freeforms), system.source.extended, system.path.by_edges)

    def earlier(self) -> list[Phase]:
        """Return the phases before the first stage."""
        start = 0.2 + 1.9e-5 * self.pixels + (10.0 if self.by_edges else 0.0)
        return [Phase(SETUP, 0.7), Phase(START, start)]

    def later(self) -> list[Phase]:
        """Return the phases behind the last stage."""
        measure = 0.45 + (2.5e-5 if self.extended else 1.0e-5) * self.pixels
        if self.by_edges:  # all reflections are traced
            measure += (8.0 if self.extended else 3.0) * self.surfaces
        return [
            Phase("export", 0.08),
            Phase("measure", measure),
            Phase("verify", 3.1 if self.by_edges else 0.8),
            Phase("figures", 0.1 if self.by_edges else 0.9),
        ]


USUAL = Size(pixels=65536, surfaces=1, extended=False, by_edges=False)


class DesignProgress:
    """The progress of a design; its phases are named in the order of the run.

    show : called with every Moment; by default it is drawn on stderr.  clock : seconds.
    """

    def __init__(
        self, show: Callable[[Moment], None] | None = None, clock: Callable[[], float] = perf_counter
    ) -> None:
        self._drawing = None if show else drawing(sys.stderr)
        self._size = USUAL
        phases = [*USUAL.earlier(), Phase("level 0", 3.0), *USUAL.later()]
        self._progress = Progress(phases, show or cast("Bar | Lines", self._drawing), clock)
        self._first = self._rows = 0  # of the present stage: its first evaluation, and rows so far

    def __enter__(self) -> DesignProgress:
        return self

    def __exit__(self, *error: object) -> None:
        if error[0] is None:
            self._progress.finish()
        if self._drawing:
            self._drawing.close()

    def planned(self, size: Size, plan: Sequence[Stage]) -> None:
        """Say what will be done, as soon as it is known."""
        self._size = size
        self._progress.expect([*size.earlier(), *_stage_phases(plan, 0), *size.later()])
        if self._drawing:
            self._drawing.keep_alive(self._progress.tell)

    def over(self, phase: str) -> None:
        """Say that a phase of the run is over."""
        if phase in FOLLOWING:
            self._progress.begin(FOLLOWING[phase])

    def __call__(self, plan: Sequence[Stage], stage: Stage, dof: int, row: Row | None) -> None:
        """Say that a stage begins, where there is no row, or that an evaluation of it is over."""
        if row is None:
            rest = plan[plan.index(stage) :]
            self._progress.expect([*_stage_phases(rest, dof), *self._size.later()])
            self._progress.begin(_name(stage))
            self._first = self._rows = 0
            return
        self._first = self._first or row.evaluation
        self._rows += 1
        evaluations = row.evaluation - self._first + 1
        first = FIRST + stage.before * stage.evaluations / (stage.seconds(dof) - stage.before)
        done = first + self._rows + PROBE * (evaluations - self._rows)
        whole = first + stage.iterations + 1 + PROBE * (stage.evaluations - stage.iterations - 1)
        self._progress.advance(done / whole, f"{dof} DOF, {evaluations} evaluations, misfit {row.fit:.4f}")


def _name(stage: Stage) -> str:
    return stage.name if stage.iterations else f"mesh of {stage.name}"


def _stage_phases(stages: Sequence[Stage], dof: int) -> list[Phase]:
    """Return the phases of stages, the first of which has so many degrees of freedom."""
    first = stages[0].level if stages else 0
    return [Phase(_name(stage), stage.seconds(dof * GROWTH ** (stage.level - first))) for stage in stages]
