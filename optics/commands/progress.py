"""Progress of a design on stderr: level, degrees of freedom, iteration, loss, time left."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from tqdm import tqdm

if TYPE_CHECKING:
    from optics.optimisation import Row, Stage


class DesignProgress:
    """A progress line weighted by the rays traced, and one line per finished level.

    The line is shown on terminals only; finished levels are always logged.
    """

    def __init__(self) -> None:
        form = "{desc} {percentage:3.0f}% |{bar:20}| {elapsed} < {remaining} left"
        self._bar = tqdm(total=1, bar_format=form, file=sys.stderr, disable=None)
        self._last: Row | None = None
        self._in_level = 0

    def __call__(self, plan: Sequence[Stage], stage: Stage, row: Row) -> None:
        if self._last is None:
            self._bar.total = sum(s.work for s in plan)
            self._bar.initial = self._bar.n = sum(s.work for s in plan if s.level < stage.level)
        elif row.level != self._last.level:
            self._log(self._last)
        self._last = row
        self._in_level += 1
        self._bar.set_description_str(
            f"level {row.level}  DOF {row.dof}  evaluation {self._in_level} of about {stage.evaluations}  "
            f"misfit {row.fit:.4f}",
            refresh=False,
        )
        room = stage.work if self._in_level <= stage.evaluations else 0
        self._bar.update(room // stage.evaluations)

    def close(self) -> None:
        if self._last is not None:
            self._log(self._last)
        self._bar.close()

    def _log(self, row: Row) -> None:
        self._bar.write(
            f"level {row.level}: {row.dof} DOF, {self._in_level} evaluations, misfit {row.fit:.4f}, "
            f"{row.seconds:.1f} s",
            file=sys.stderr,
        )
        self._in_level = 0
