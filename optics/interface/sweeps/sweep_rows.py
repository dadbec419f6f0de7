"""What came of a sweep: a row for every variant, and the rows as CSV and Parquet."""

from __future__ import annotations

import csv
import io
import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import Any

JUDGED = "rel_l2_debiased"  # the metric by which the best variant is named
FIRST = (
    "grade",
    JUDGED,
    "uniformity.min_over_mean",
    "contrast_error",
    "lit_efficiency",
    "efficiency",
    "stray",
    "dof",
    "verdict",
    "notes",
)  # of the metrics in tables
DONE, FAILED, KILLED, INVALID = "done", "failed", "killed", "invalid"  # status of a row


@dataclass(frozen=True)
class SweepRow:
    """One variant.

    values : of the varied keys.  metrics : numbers and words by name, none unless it is "done".
    seconds : of the design.  peak_mb : the most memory that its worker had held until then.
    status : "done", "failed", "killed" (its worker ended, twice) or "invalid" (no problem has these values).
    sentence : why it is not "done".  picture : PNG of the light on the target.

    >>> SweepRow((400,), "failed", "no light reaches the target").metrics
    {}
    """

    values: tuple[Any, ...]
    status: str
    sentence: str = ""
    metrics: Mapping[str, Any] = field(default_factory=dict)
    seconds: float = 0.0
    peak_mb: float = 0.0
    picture: bytes = b""


@dataclass(frozen=True)
class Sweep:
    """A finished sweep.  keys : that were varied.  rows : in the order of the combinations.

    >>> rows = [SweepRow((k,), "done", metrics={"rel_l2_debiased": 1 / k}) for k in (20, 40)]
    >>> found = Sweep(Path("distances"), ("target.distance",), rows)
    >>> found.best.values, found.counts()["done"]
    ((40,), 2)
    """

    folder: Path
    keys: tuple[str, ...]
    rows: Sequence[SweepRow]

    @property
    def metrics(self) -> list[str]:
        """Names of all metrics that a row has, what a reader looks for first."""
        known = dict.fromkeys(name for row in self.rows for name in row.metrics)
        return [*(name for name in FIRST if name in known), *(name for name in known if name not in FIRST)]

    @property
    def best(self) -> SweepRow | None:
        """The row of least error, of those that are made where there are any; None without a finished one."""
        judged = [row for row in self.rows if row.metrics.get(JUDGED) is not None]
        order = ((row.metrics.get("grade") != "made", row.metrics[JUDGED], k) for k, row in enumerate(judged))
        return judged[min(order)[-1]] if judged else None

    def grades(self) -> dict[str, int]:
        """Return the number of finished rows by grade."""
        return dict(Counter(str(row.metrics["grade"]) for row in self.rows if "grade" in row.metrics))

    def counts(self) -> dict[str, int]:
        """Return the number of rows by status."""
        return {s: sum(r.status == s for r in self.rows) for s in (DONE, FAILED, KILLED, INVALID)}

    def table(self) -> list[dict[str, Any]]:
        """Return a dict for every row: keys, metrics, seconds, peak_mb, status, sentence."""
        metrics = self.metrics  # of all rows: looked up once
        return [
            dict(zip(self.keys, row.values))
            | {name: row.metrics.get(name) for name in metrics}
            | {name: getattr(row, name) for name in ("seconds", "peak_mb", "status", "sentence")}
            for row in self.rows
        ]


def csv_text(sweep: Sweep) -> str:
    """Return the table as CSV: a header, and a line for every variant; lists are JSON."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns(sweep))
    writer.writerows([cell(value) for value in row.values()] for row in sweep.table())
    return text.getvalue()


def parquet_bytes(sweep: Sweep) -> bytes | None:
    """Return the table as Parquet; None where pyarrow is not installed (extra `cluster`).

    Lists are JSON; a column that holds texts and numbers holds texts.
    """
    if find_spec("pyarrow") is None:
        return None
    from pyarrow import Table, parquet

    table = sweep.table()
    arrays = {name: _column([row[name] for row in table]) for name in columns(sweep)}
    buffer = io.BytesIO()
    parquet.write_table(Table.from_pydict(arrays), buffer)
    return buffer.getvalue()


def columns(sweep: Sweep) -> list[str]:
    """Return the names of the columns."""
    return [*sweep.keys, *sweep.metrics, "seconds", "peak_mb", "status", "sentence"]


def cell(value: Any) -> Any:
    """Return a value as it stands in a table: nothing for None, JSON for lists."""
    if value is None:
        return ""
    return json.dumps(value) if isinstance(value, list | tuple | dict | bool) else value


def _column(values: list[Any]) -> list[Any]:
    """Return the values with one type for all."""
    plain = [json.dumps(v) if isinstance(v, list | tuple | dict) else v for v in values]
    kinds = {type(value) for value in plain if value is not None}
    if kinds <= {int, float} and float in kinds:
        return [None if value is None else float(value) for value in plain]
    return plain if len(kinds) <= 1 else [None if value is None else str(value) for value in plain]
