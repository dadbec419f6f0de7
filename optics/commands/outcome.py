"""What a command returns."""

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
