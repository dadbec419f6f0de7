"""What a command returns, and a metric in its lines."""

from __future__ import annotations

from typing import Any, NamedTuple


class Outcome(NamedTuple):
    """The result of a command.

    data : for --json
    lines : text for stdout
    ok : False where a check failed
    """

    data: Any
    lines: list[str]
    ok: bool = True


def number_text(value: float | None, form: str) -> str:
    """Return a metric as text, "-" where it is not defined."""
    return "-" if value is None else format(value, form)
