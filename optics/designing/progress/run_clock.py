"""Wall time of a run by phase, and the progress that is told of it."""

from __future__ import annotations

from time import perf_counter

from optics.designing.progress.design_progress import DesignProgress


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
