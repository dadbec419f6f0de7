"""Lines of text that a program prints."""

from __future__ import annotations

import sys
from typing import Any


def note(sentence: str) -> None:
    """Print a note on stderr, above a bar of progress where there is one."""
    line = f"thbcad: note: {sentence}"
    if "tqdm" in sys.modules:
        from tqdm import tqdm

        tqdm.write(line, file=sys.stderr)
    else:
        print(line, file=sys.stderr)


def check_lines(checked: dict[str, Any]) -> list[str]:
    """Return a line for every check of `verification`: passed or not, name, value, limit.

    A line for everything that is left out follows.
    """
    lines = []
    for c in checked["checks"]:
        word = "ok    " if c["ok"] else "FAILED"
        lines.append(
            f"{word} {c['name']}: {c['value']:.3g} {c['unit']}".rstrip() + f" (at most {c['limit']:g})"
        )
    return lines + [f"left out: {sentence}" for sentence in checked.get("left_out", ())]
