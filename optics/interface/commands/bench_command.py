"""`thbcad bench`: the results of a benchmark beside their limits, stored and written into the pages."""

from __future__ import annotations

import ast
import sys
from argparse import Namespace
from datetime import date
from importlib import import_module
from inspect import signature
from pathlib import Path
from types import ModuleType

from optics.base.runtime import (
    Row,
    StoredRows,
    UserError,
    machine,
    machine_facts,
    overview_page,
    quoted_rows,
    read_rows,
    refreshed,
    rows_page,
    store_rows,
    table,
)
from optics.interface.commands.outcome import DONE, MISSED, Outcome
from thbcad.io import write_text

PARTS = ("quick", "only", "resume")  # options of benchmarks that can be run in part


def bench(options: Namespace) -> Outcome:
    """Run a benchmark of the checkout this package was installed from, or write the pages of stored rows."""
    modules = _modules(checkout())
    if options.markdown:
        if options.name or options.store:
            raise UserError("--markdown runs no benchmark: give it without a name and without --store")
        return _write_pages(checkout(), modules)
    if options.name not in modules:
        names = ", ".join(sorted(modules)) or "none, run from a checkout"
        wrong = f"there is no benchmark {options.name!r}" if options.name else "bench needs a name"
        raise UserError(f"{wrong}; this installation has: {names}")
    rows = _measured(options, _loaded(modules[options.name]))
    plain, lines = [row.plain() for row in rows], [machine(), *table(rows)]
    if options.store:
        stored = StoredRows(options.name, date.today().isoformat(), machine_facts(), plain)
        lines.append(f"stored in {store_rows(stored, checkout() / 'docs' / 'data')}")
    return Outcome(plain, lines, DONE if all(row.ok for row in rows) else MISSED)


def _loaded(path: Path) -> ModuleType:
    """Return a module of the checkout."""
    sys.path.insert(0, str(checkout()))
    return import_module(".".join(path.relative_to(checkout()).with_suffix("").parts))


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


def checkout() -> Path:
    """Return the folder that holds the packages, and in a checkout `benchmarks` and `docs`."""
    return Path(__file__).resolve().parents[3]


def benchmark_page(root: Path) -> str:
    """Return docs/benchmarks.md of a checkout."""
    stored = _stored(root)
    quoted = set().union(*(quoted_rows(path.read_text("utf-8")) for path in _quoting(root)))
    return overview_page(stored, quoted)


def benchmark_tables(root: Path) -> dict[str, str]:
    """Return a page with all rows of each benchmark of a checkout, by name."""
    return {one.name: rows_page(one, sentence) for one, sentence in _stored(root)}


def _stored(root: Path) -> list[tuple[StoredRows, str]]:
    """Return what is stored, each with the sentence that says what was measured."""
    modules, stored = _modules(root), read_rows(root / "docs" / "data")
    for name in stored:
        if name not in modules:
            raise UserError(f"docs/data/{name}.json belongs to no benchmark; delete it")
    return [(one, _sentence(modules[name])) for name, one in stored.items()]


def _quoting(root: Path) -> list[Path]:
    """Return the pages that quote stored rows."""
    return [root / "README.md", *sorted((root / "docs").glob("*.md"))]


def own_pages(path: Path) -> dict[Path, str]:
    """Return the pages that a benchmark writes itself, from what it stored."""
    if "\ndef pages(" not in path.read_text("utf-8"):
        return {}
    pages: dict[Path, str] = _loaded(path).pages()
    return pages


def _write_pages(root: Path, modules: dict[str, Path]) -> Outcome:
    """Write docs/benchmarks.md and refresh the marked numbers of the README and the pages of docs."""
    stored = read_rows(root / "docs" / "data")
    if not stored:
        raise UserError("there are no stored rows in docs/data of a checkout; run thbcad bench NAME --store")
    new = {root / "docs" / "benchmarks.md": benchmark_page(root)}
    for name in stored:
        new |= own_pages(modules[name])
    for path in _quoting(root):
        new.setdefault(path, refreshed(path.read_text("utf-8"), stored))
    changed = [path for path, text in new.items() if not path.exists() or path.read_text("utf-8") != text]
    for path in changed:
        write_text(path, new[path])
    names = [path.relative_to(root).as_posix() for path in changed]
    return Outcome({"changed": names}, [f"wrote {name}" for name in names] or ["every page is up to date"])


def _modules(root: Path) -> dict[str, Path]:
    """Return the benchmarks of a checkout by name: the modules that have `rows()`."""
    files = sorted((root / "benchmarks").rglob("*.py"))
    return {path.stem: path for path in files if "\ndef rows(" in path.read_text("utf-8")}


def _sentence(path: Path) -> str:
    """Return the first sentence of a benchmark's docstring."""
    text = ast.get_docstring(ast.parse(path.read_text("utf-8"))) or ""
    return " ".join(text.split("\n\n")[0].split())
