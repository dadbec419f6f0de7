"""Lines of text for people."""

from __future__ import annotations

import sys
from typing import Any


def note(sentence: str) -> None:
    """Tell people something on stderr."""
    print(f"thbcad: note: {sentence}", file=sys.stderr)


def check_lines(checked: dict[str, Any]) -> list[str]:
    """Return a line for every check of `verification`: passed or not, name, figure, limit."""
    lines = []
    for c in checked["checks"]:
        word = "ok    " if c["ok"] else "FAILED"
        lines.append(
            f"{word} {c['name']}: {c['value']:.3g} {c['unit']}".rstrip() + f" (at most {c['limit']:g})"
        )
    return lines
