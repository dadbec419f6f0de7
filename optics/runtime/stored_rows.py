"""Rows of benchmarks that are kept: one file per benchmark, with its machine, and the page of all of them.

A row is kept as it is printed.  A row whose name is indented belongs to the last row before it
that is not; its full name is "name of that row > its own name".
"""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from optics.runtime.errors import UserError
from thbcad.io import json_text, write_text

KEYS = ("name", "value", "unit", "reference", "limit", "ok", "basis")
OPTIONAL = ("quantity", "estimator", "error")  # of some rows, and columns of their tables
INTRODUCTION = """\
# Benchmarks

Every table below is the result of one benchmark.
`thbcad bench NAME --store` measures it and keeps the rows in `docs/data/NAME.json`.
`thbcad bench --markdown` writes this page from these files.
Each row has a limit or none; `ok` says whether the limit is met.
The column `basis` says whether the value was measured, or extrapolated by the law that `reference` names.
Where there are such columns, `quantity` is what the `estimator` computes, and `error` is its relative error.
Of a value that is itself an error, `error` is that of the light it was measured against.
The column `reference` names another code in the same run, or the thesis.
"""


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

    Raises
    ------
    UserError : a file that `store_rows` did not write.
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


def rows_page(stored: Sequence[StoredRows], sentences: Mapping[str, str]) -> str:
    """Return the page of all stored rows as Markdown; sentences : what each benchmark measures, by name."""
    return "\n".join([INTRODUCTION, *(_section(s, sentences[s.name]) for s in stored)])


def _section(stored: StoredRows, sentence: str) -> str:
    m = stored.machine
    extra = [key for key in OPTIONAL if any(key in row for row in stored.rows)]
    lines = [
        f"## {stored.name}",
        "",
        sentence,
        "",
        f"Measured on {stored.date}: {m['processor']}, {m['cores']} cores, {m['memory_gib']} GiB, "
        f"{m['system']}, Python {m['python']}.",
        "",
        "| " + " | ".join(["row", "value", "unit", "limit", "ok", "basis", *extra, "reference"]) + " |",
        "|---|---:|---|---|---|---|" + "---|" * (len(extra) + 1),
    ]
    for row in stored.rows:
        ok = "" if row["limit"] is None else "yes" if row["ok"] else "**no**"
        cells = [
            _indented(row["name"]),
            shown(row["value"]),
            row["unit"],
            row["limit"] or "",
            ok,
            row["basis"],
        ]
        cells += [_text(row.get(key, "")) for key in extra]
        lines.append("| " + " | ".join(_escaped(cell) for cell in [*cells, row["reference"]]) + " |")
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
        "cores": len(os.sched_getaffinity(0)),
        "memory_gib": round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30),
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
