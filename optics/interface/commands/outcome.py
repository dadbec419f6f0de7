"""What a command returns, and a metric in its lines."""

from __future__ import annotations

from typing import Any, NamedTuple

from optics.base.runtime import Grade
from optics.interface.screens import Screen

DONE, MISSED, PART_FAILS = 0, 1, 4  # exit codes of what was done
OF_GRADES: dict[Grade, int] = {
    "made": DONE,
    "light misses": MISSED,
    "not decided": MISSED,
    "file or part fails": PART_FAILS,
}


class Outcome(NamedTuple):
    """The result of a command.

    data : for --json.  lines : everything that can be said, for stdout.  code : the exit code.
    screen : what is shown in their place unless --full asks for all lines; None for commands without one.
    """

    data: Any
    lines: list[str]
    code: int = DONE
    screen: Screen | None = None


def number_text(value: float | None, form: str) -> str:
    """Return a metric as text, "-" where it is not defined."""
    return "-" if value is None else format(value, form)
