"""Lines of text that a program prints."""

from __future__ import annotations

import sys
from typing import Any

from optics.runtime.errors import printable


def note(sentence: str) -> None:
    """Print a note on stderr, above a bar of progress where there is one."""
    line = f"thbcad: note: {printable(sentence)}"
    if "tqdm" in sys.modules:
        from tqdm import tqdm

        tqdm.write(line, file=sys.stderr)
    else:
        print(line, file=sys.stderr)


def check_lines(checked: dict[str, Any]) -> list[str]:
    """Return a line for every check of `verification`: passed or not, name, value, limit.

    Lines for notes and for everything that is left out follow.
    """
    lines = []
    for c in checked["checks"]:
        word = "ok    " if c["ok"] else "FAILED"
        lines.append(
            f"{word} {c['name']}: {c['value']:.3g} {c['unit']}".rstrip() + f" (at most {c['limit']:g})"
        )
    notes = [f"note: {sentence}" for sentence in checked.get("notes", ())]
    return lines + notes + [f"left out: {sentence}" for sentence in checked.get("left_out", ())]
