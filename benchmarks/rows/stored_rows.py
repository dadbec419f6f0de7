"""Rows of benchmarks that are kept: one file per benchmark, with its machine, and the page of all of them.

A row is kept as it is printed.  A row whose name is indented belongs to the last row before it
that is not; its full name is "name of that row > its own name".
"""

from __future__ import annotations

import json
import platform
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from optics.base.runtime import UserError, machine_memory, usable_cores
from thbcad.io import json_text, write_text

KEYS = ("name", "value", "unit", "reference", "limit", "ok", "basis")
OPTIONAL = ("quantity", "estimator", "error")  # of some rows, and columns of their tables
OVERVIEW = ("row", "value", "unit", "limit", "ok", "reference")  # columns of the page of all
INTRODUCTION = """\
# Benchmarks

`thbcad bench NAME --store` measures a benchmark, and keeps rows and machine in `docs/data/NAME.json`.
`thbcad bench --markdown` writes this page: some rows that pages quote, and all whose limits are missed.
Limits in seconds were set on faster machines.
`reference` names another code in the same run, or the thesis.
"""
COLUMNS = """\
The column `basis` says whether the value was measured, or extrapolated by the law that `reference` names.
Where there are such columns, `quantity` is what the `estimator` computes, and `error` is its relative error.
Of a value that is itself an error, `error` is that of the light it was measured against.
"""
SHOWN = 3  # rows of a benchmark on the page of all: quoted ones first; missed limits besides


@dataclass(frozen=True)
class StoredRows:
    """The rows of one run of a benchmark, its date (ISO 8601) and the facts of the machine."""

    name: str
    date: str
    machine: Mapping[str, str | int]
    rows: Sequence[Mapping[str, Any]]

    def named(self) -> Iterator[tuple[str, Mapping[str, Any]]]:
        """Yield each row with its full name."""
        head = ""
        for row in self.rows:
            name = row["name"].strip()
            if row["name"] == name:
                head = name
                yield name, row
            else:
                yield f"{head} > {name}", row


def store_rows(stored: StoredRows, folder: Path) -> Path:
    """Write the rows to folder/NAME.json, atomically, and return the path."""
    path = folder / f"{stored.name}.json"
    data = {"date": stored.date, "machine": dict(stored.machine), "rows": [dict(r) for r in stored.rows]}
    folder.mkdir(exist_ok=True)
    write_text(path, json_text(data))
    return path


def read_rows(folder: Path) -> dict[str, StoredRows]:
    """Return what is stored in a folder, by the names of the benchmarks.

    Raises UserError : a file that `store_rows` did not write.
    """
    return {path.stem: _read(path) for path in sorted(folder.glob("*.json"))}


def _read(path: Path) -> StoredRows:
    try:
        data = json.loads(path.read_text("utf-8"))
        stored = StoredRows(path.stem, data["date"], data["machine"], data["rows"])
        if not all(set(KEYS) <= set(row) <= {*KEYS, *OPTIONAL} for row in stored.rows):
            raise KeyError("rows")
    except (ValueError, KeyError, TypeError):
        raise UserError(
            f"{path} holds no rows of a benchmark; measure them again: thbcad bench {path.stem} --store"
        ) from None
    return stored


def overview_page(stored: Sequence[tuple[StoredRows, str]], quoted: Collection[tuple[str, str]]) -> str:
    """Return the page of all benchmarks with a few rows of each, as Markdown.

    stored : each with the sentence that says what it measures.  quoted : (benchmark, full name of a row) that
        pages quote.
    """
    parts = [INTRODUCTION]
    for one, sentence in stored:
        rows = list(one.named())
        chosen = [r for r in rows if (one.name, r[0]) in quoted][:SHOWN]
        limited = [r for r in rows if r[1]["limit"] is not None and r not in chosen]
        chosen += limited[: max(0, SHOWN - len(chosen))]
        chosen += [r for r in limited if _missed(r[1]) and r not in chosen]
        when = f"Measured on {one.date}, {one.machine['processor']}.\n"
        parts += [f"## {one.name}\n", f"{sentence}\n", when]
        parts.append(_table(OVERVIEW, [], chosen or rows[:SHOWN]))
        parts.append(f"[All {len(rows)} rows](data/{one.name}.json).\n")
    return "\n".join(parts)


def rows_page(stored: StoredRows, sentence: str) -> str:
    """Return the page of all rows of a benchmark as Markdown.  sentence : what it measures."""
    extra = [key for key in OPTIONAL if any(key in row for row in stored.rows)]
    rows = [(_indented(row["name"]), row) for row in stored.rows]
    columns = ["row", "value", "unit", "limit", "ok", "basis", *extra, "reference"]
    m = stored.machine
    when = (
        f"Measured on {stored.date}: {m['processor']}, {m['cores']} cores, {m['memory_gib']} GiB, "
        f"{m['system']}, Python {m['python']}.\n"
    )
    return "\n".join([f"# {stored.name}\n", f"{sentence}\n", when, COLUMNS, _table(columns, extra, rows)])


def _missed(row: Mapping[str, Any]) -> bool:
    return row["limit"] is not None and not row["ok"]


def _table(
    columns: Sequence[str], extra: Sequence[str], rows: Sequence[tuple[str, Mapping[str, Any]]]
) -> str:
    """Return rows, each with the name to show, as a table of the columns that are not blank."""
    cells = [
        {
            "row": name,
            "value": shown(row["value"]),
            "unit": row["unit"],
            "limit": row["limit"] or "",
            "ok": "**no**" if _missed(row) else "",
            "basis": row["basis"],
            "reference": row["reference"],
        }
        | {key: _text(row.get(key, "")) for key in extra}
        for name, row in rows
    ]
    columns = [column for column in columns if any(row[column] for row in cells)]
    lines = [
        "| " + " | ".join(columns) + " |",
        "|" + "|".join("---:" if column == "value" else "---" for column in columns) + "|",
        *("| " + " | ".join(_escaped(row[column]) for column in columns) + " |" for row in cells),
    ]
    return "\n".join([*lines, ""])


def _text(value: str | float) -> str:
    return value if isinstance(value, str) else f"{value:.1e}"


def shown(value: float | None) -> str:
    """Return a value with four digits, a whole number with all of its digits.

    None stands for a value that is not finite.
    """
    if value is None:
        return "-"
    return f"{value:,}".replace(",", " ") if isinstance(value, int) else f"{value:.4g}"


def _indented(name: str) -> str:
    return name if name == name.strip() else "&nbsp;&nbsp;" + name.strip()


def _escaped(cell: str) -> str:
    return cell.replace("|", "\\|").replace("<", "&lt;").replace("*", "\\*") if cell != "**no**" else cell


def machine_facts() -> dict[str, str | int]:
    """Return processor, cores (that this process may use), memory in GiB, system and Python."""
    return {
        "processor": _processor(),
        "cores": usable_cores(),
        "memory_gib": round(machine_memory() / 2**30),
        "system": _system(),
        "python": platform.python_version(),
    }


def machine() -> str:
    """Return one line that names the machine."""
    facts = machine_facts()
    return f"{facts['processor']}, {facts['cores']} cores, Python {facts['python']}"


def _processor() -> str:
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            return next(line.split(":", 1)[1].strip() for line in file if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()


def _system() -> str:
    try:
        return platform.freedesktop_os_release()["PRETTY_NAME"]
    except (OSError, KeyError):
        return platform.system()
