"""Results with limits, as every verification lists them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class Check:
    """One result with its limit; `ok` is value <= limit."""

    name: str
    value: float
    limit: float
    unit: str

    @property
    def ok(self) -> bool:
        return bool(self.value <= self.limit)


def verification(checks: Sequence[Check]) -> dict[str, Any]:
    """Return the checks as plain data for JSON files."""
    return {"ok": all(c.ok for c in checks), "checks": [asdict(c) | {"ok": c.ok} for c in checks]}


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
