"""How far a job of several phases is, and how long it will still take.

Nothing is drawn here: a function that is called with every `ProgressEvent` does that.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import sqrt
from threading import RLock
from time import perf_counter

# of all work: with so much of it done, its speed counts as much as the expected one; later far more
PRIOR = 0.03
# of a phase: so much of it counts as done at the speed of the phases before, which steadies its first moments
STEADY = 0.05
OVERDUE = 0.1  # of its time so far: what is left of a phase that takes longer than expected


@dataclass(frozen=True)
class Phase:
    """A part of a job.

    work : expected seconds on some machine; how fast this one is turns out
    weight : how much its own seconds count for that, beside those of others: little of the disk's work
    on_one_core : its speed follows that of other such phases as much as that of all
    """

    name: str
    work: float
    weight: float = 1.0
    on_one_core: bool = False


@dataclass(frozen=True)
class ProgressEvent:
    """How far a job is.

    phase : its name.  seconds : that the phase has taken so far.  detail : of it, in words.
    fraction : of the time of the whole job, 0 to 1.  left : estimated seconds until the end of the job.
    """

    phase: str
    seconds: float
    detail: str
    fraction: float
    left: float


class Progress:
    """The phases of a job, one after the other.

    Time left: what the present phase needs by its own speed, and what the phases ahead need by the speed of
    all phases so far; for those on one core by the geometric mean of that and the speed of other such phases.
    The fraction never falls.

    show : called with a ProgressEvent when a phase begins and goes on, and at the end.  clock : seconds.
    """

    def __init__(
        self,
        phases: Sequence[Phase],
        show: Callable[[ProgressEvent], object],
        clock: Callable[[], float] = perf_counter,
    ) -> None:
        self._show, self._clock = show, clock
        self._now, *self._ahead = phases
        self._since = clock()
        self._done = 0.0  # work
        self._past = self._past_work = 0.0  # weighted seconds and work of the phases before
        self._single = self._single_work = 0.0  # the same of those on one core
        self._part, self._reported = 0.0, 0.0  # of the present phase, and its seconds at the last report
        self._detail = ""
        self._fraction = 0.0
        self._lock = RLock()

    def expect(self, phases: Sequence[Phase]) -> None:
        """Replace the phases ahead; where the first one is the present one, its work is replaced too."""
        with self._lock:
            if phases and phases[0].name == self._now.name:
                self._now, *phases = phases
            self._ahead = list(phases)

    def begin(self, name: str) -> None:
        """End the present phase and begin another one that is expected; those before it are left out.

        The present one begins again as a part of itself.

        Raises ValueError : it is not expected.
        """
        with self._lock:
            if name == self._now.name:
                return
            at = [phase.name for phase in self._ahead].index(name)
            self.report()
            self._done += self._now.work
            self._past += self._now.weight * (self._clock() - self._since)
            self._past_work += self._now.weight * self._now.work
            if self._now.on_one_core:
                self._single += self._now.weight * (self._clock() - self._since)
                self._single_work += self._now.weight * self._now.work
            self._now, *self._ahead = self._ahead[at:]
            self._since, self._part, self._reported, self._detail = self._clock(), 0.0, 0.0, ""
            self.report()

    def advance(self, part: float, detail: str = "") -> None:
        """Say how much of the present phase is done, 0 to 1."""
        with self._lock:
            self._part, self._reported = min(max(part, self._part), 1.0), self._clock() - self._since
            self._detail = detail
            self.report()

    def report(self) -> None:
        """Show how far the job is by now."""
        with self._lock:
            elapsed, now = self._clock() - self._since, self._now.work
            whole = self._done + now + sum(phase.work for phase in self._ahead)
            weight, past, known = self._now.weight, self._past, self._past_work
            # the second would be the speed if the present phase ended now
            speed = max(
                _speed(past + weight * self._reported, known + weight * self._part * now, whole),
                _speed(past + weight * elapsed, known + weight * now, whole),
            )
            # the speed of phases on one core, where there were some
            known = self._single_work
            alone = speed * (_speed(self._single / speed, known, whole) if known else 1.0)
            speeds = {False: speed, True: sqrt(speed * alone)}
            present = (self._reported + STEADY * speeds[self._now.on_one_core] * now) / (self._part + STEADY)
            present = max(present - elapsed, OVERDUE * (1 - self._part) * elapsed)
            ahead = sum(speeds[phase.on_one_core] * phase.work for phase in self._ahead)
            left, whole = present + ahead, speed * whole  # seconds, at the speed so far
            self._fraction = max(self._fraction, 1 - left / whole)
            seconds = self._clock() - self._since
            self._show(ProgressEvent(self._now.name, seconds, self._detail, self._fraction, left))

    def finish(self) -> None:
        """Say that the job is over."""
        with self._lock:
            self._fraction = 1.0
            self._show(ProgressEvent(self._now.name, self._clock() - self._since, self._detail, 1.0, 0.0))


def _speed(seconds: float, work: float, whole: float) -> float:
    """Return the seconds per expected second, in which little work counts little."""
    if not (seconds and work):
        return 1.0
    return float((seconds / work) ** (work**2 / (work**2 + (PRIOR * whole) ** 2)))
