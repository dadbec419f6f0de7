"""Progress of a design on stderr: level, degrees of freedom, iteration, loss, time left."""

from __future__ import annotations

import sys

from tqdm import tqdm


class DesignProgress:
    """A progress line weighted by the rays traced, and one line per finished level.

    The line is shown on terminals only; finished levels are always logged.
    """

    def __init__(self, stages, level=0):
        work = sum(stage.work for stage in stages)
        before = sum(stage.work for stage in stages if stage.level < level)
        form = "{desc} {percentage:3.0f}% |{bar:20}| {elapsed} < {remaining} left"
        self._bar = tqdm(total=work, initial=before, bar_format=form, file=sys.stderr, disable=None)
        self._last = None
        self._in_level = 0

    def __call__(self, stage, row):
        if self._last is not None and row.level != self._last.level:
            self._log()
        self._last = row
        self._in_level += 1
        self._bar.set_description_str(
            f"level {row.level}  DOF {row.dof}  evaluation {self._in_level}/{stage.evaluations}  misfit {row.fit:.4f}", refresh=False
        )
        room = stage.work if self._in_level <= stage.evaluations else 0
        self._bar.update(room // stage.evaluations)

    def close(self):
        if self._last is not None:
            self._log()
        self._bar.close()

    def _log(self):
        row = self._last
        self._bar.write(
            f"level {row.level}: {row.dof} DOF, {self._in_level} evaluations, misfit {row.fit:.4f}, {row.seconds:.1f} s", file=sys.stderr
        )
        self._in_level = 0
