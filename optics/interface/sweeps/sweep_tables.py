"""The rows of a sweep as CSV and Parquet."""

from __future__ import annotations

import csv
import io
import json
from importlib.util import find_spec
from typing import Any

from optics.interface.sweeps.sweep_rows import Sweep


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
