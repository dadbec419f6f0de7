"""What `thbcad bench` does in a checkout: run a benchmark beside its limits, store it, or write the pages."""

from __future__ import annotations

from argparse import Namespace
from datetime import date
from inspect import signature
from pathlib import Path
from types import ModuleType
from typing import Any

from benchmarks.rows.pages import loaded, modules_of, write_pages
from benchmarks.rows.row import Row, table
from benchmarks.rows.stored_rows import StoredRows, machine, machine_facts, store_rows
from optics.base.runtime import UserError

PARTS = ("quick", "only", "resume")  # options of benchmarks that can be run in part


def bench(root: Path, options: Namespace) -> tuple[Any, list[str], bool]:
    """Return the data and the lines of a run, and whether all limits are met."""
    modules = modules_of(root)
    if options.markdown:
        if options.name or options.store:
            raise UserError("--markdown runs no benchmark: give it without a name and without --store")
        return *write_pages(root), True
    if options.name not in modules:
        wrong = f"there is no benchmark {options.name!r}" if options.name else "bench needs a name"
        raise UserError(f"{wrong}; this installation has: {', '.join(sorted(modules))}")
    rows = _measured(options, loaded(root, modules[options.name]))
    plain, lines = [row.plain() for row in rows], [machine(), *table(rows)]
    if options.store:
        stored = StoredRows(options.name, date.today().isoformat(), machine_facts(), plain)
        lines.append(f"stored in {store_rows(stored, root / 'docs' / 'data')}")
    return plain, lines, all(row.ok for row in rows)


def _measured(options: Namespace, module: ModuleType) -> list[Row]:
    """Return the rows of a benchmark, and let one with own pages write them where rows are stored."""
    given = {name: getattr(options, name) for name in PARTS}
    given = {name: value for name, value in given.items() if value is not None and value is not False}
    unknown = [f"--{name}" for name in given if name not in signature(module.rows).parameters]
    if unknown:
        raise UserError(f"bench {options.name} has no parts: leave out {', '.join(unknown)}")
    if options.store and given.keys() & {"quick", "only"}:
        raise UserError("--store keeps a whole run: leave out --quick and --only")
    rows: list[Row] = module.rows(**given)
    if options.store and hasattr(module, "publish"):
        module.publish()
    return rows
