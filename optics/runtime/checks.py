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
