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
    quantity : what is computed, and estimator : by which method; blank for times and counts without one.
    error : of the quantity by the estimator, relative; of a value that is such an error, that of the
        reference.  None where there is none to state.
    extrapolated : the value was not reached, it follows from less by a law that `reference` names.
    """

    name: str
    value: float
    unit: str = ""
    reference: str = ""
    limit: float | None = None
    sense: str = "<="
    quantity: str = ""
    estimator: str = ""
    error: float | None = None
    extrapolated: bool = False

    @property
    def basis(self) -> str:
        return "extrapolated" if self.extrapolated else "measured"

    @property
    def ok(self) -> bool:
        if self.limit is None:
            return True
        return bool(self.value <= self.limit if self.sense == "<=" else self.value >= self.limit)

    def plain(self) -> dict[str, str | float | bool | None]:
        """Return the row as data; quantity, estimator and error where it has them."""
        limit = None if self.limit is None else f"{self.sense} {self.limit:g}"
        optional = {"quantity": self.quantity, "estimator": self.estimator, "error": self.error}
        return {
            "name": self.name,
            "value": self.value,
            "unit": self.unit,
            "reference": self.reference,
            "limit": limit,
            "ok": self.ok,
            "basis": self.basis,
            **{key: value for key, value in optional.items() if value not in (None, "")},
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
    lines = [f"{'row':<66} {'value':>12} {'unit':<6} {'limit':<10} {'ok':<4} {'basis':<12} reference"]
    for row in rows:
        limit = "" if row.limit is None else f"{row.sense} {row.limit:g}"
        error = "" if row.error is None else f"error {row.error:.1e}"
        notes = "; ".join(filter(None, (row.quantity, row.estimator, error, row.reference)))
        lines.append(
            f"{row.name:<66} {row.value:>12.4g} {row.unit:<6} {limit:<10} {'yes' if row.ok else 'NO':<4} "
            f"{row.basis:<12} {notes}"
        )
    return lines
