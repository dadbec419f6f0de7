"""Rows of a benchmark: a result beside its reference and limit."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import median
from time import perf_counter


@dataclass(frozen=True)
class Row:
    """One result.

    sense : the value must not be above the limit ("<=") or below it (">=").  limit : None is no limit.
    """

    name: str
    value: float
    unit: str = ""
    reference: str = ""
    limit: float | None = None
    sense: str = "<="

    @property
    def ok(self) -> bool:
        if self.limit is None:
            return True
        return bool(self.value <= self.limit if self.sense == "<=" else self.value >= self.limit)

    def plain(self) -> dict[str, str | float | bool | None]:
        """Return the row as data."""
        limit = None if self.limit is None else f"{self.sense} {self.limit:g}"
        return {
            "name": self.name,
            "value": self.value,
            "unit": self.unit,
            "reference": self.reference,
            "limit": limit,
            "ok": self.ok,
        }


def median_seconds(function: Callable[[], object], repeats: int) -> float:
    """Return the median wall time of a function after one warm-up call."""
    function()
    times = []
    for _ in range(repeats):
        start = perf_counter()
        function()
        times.append(perf_counter() - start)
    return median(times)


def table(rows: Sequence[Row]) -> list[str]:
    """Return the rows as lines of text."""
    lines = [f"{'quantity':<66} {'value':>12} {'unit':<6} {'limit':<10} {'ok':<4} reference"]
    for row in rows:
        limit = "" if row.limit is None else f"{row.sense} {row.limit:g}"
        lines.append(
            f"{row.name:<66} {row.value:>12.4g} {row.unit:<6} {limit:<10} {'yes' if row.ok else 'NO':<4} "
            f"{row.reference}"
        )
    return lines
