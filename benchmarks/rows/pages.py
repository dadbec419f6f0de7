"""Pages of stored rows: all of each benchmark, their overview, and the pages that quote them."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from types import ModuleType

from benchmarks.rows.quoted_numbers import quoted_rows, refreshed
from benchmarks.rows.quotes import FILE, marked_pages, quotes_text, without_marks
from benchmarks.rows.stored_rows import StoredRows, overview_page, read_rows, rows_page
from optics.base.runtime import UserError
from thbcad.io import write_text


def loaded(root: Path, path: Path) -> ModuleType:
    """Return a module of a checkout, whose folder is on the path of imports."""
    return import_module(".".join(path.relative_to(root).with_suffix("").parts))


def benchmark_page(root: Path, marked: Mapping[Path, str] | None = None) -> str:
    """Return docs/benchmarks.md of a checkout.  marked : pages with their marks, by default as they are."""
    pages = marked_pages(root) if marked is None else marked
    return overview_page(_stored(root), set().union(*map(quoted_rows, pages.values())))


def benchmark_tables(root: Path) -> dict[str, str]:
    """Return a page with all rows of each benchmark of a checkout, by name."""
    return {one.name: rows_page(one, sentence) for one, sentence in _stored(root)}


def _stored(root: Path) -> list[tuple[StoredRows, str]]:
    """Return what is stored, each with the sentence that says what was measured."""
    modules, stored = modules_of(root), read_rows(root / "docs" / "data")
    for name in stored:
        if name not in modules:
            raise UserError(f"docs/data/{name}.json belongs to no benchmark; delete it")
    return [(one, _sentence(modules[name])) for name, one in stored.items()]


def own_pages(root: Path, path: Path) -> dict[Path, str]:
    """Return the pages that a benchmark writes itself, from what it stored, with their marks."""
    if "\ndef pages(" not in path.read_text("utf-8"):
        return {}
    pages: dict[Path, str] = loaded(root, path).pages()
    return pages


def write_pages(root: Path) -> tuple[dict[str, list[str]], list[str]]:
    """Write docs/benchmarks.md and refresh the quoted numbers of all pages, there and in quotes.toml.

    Return what changed as data and as lines.
    """
    stored = read_rows(root / "docs" / "data")
    if not stored:
        raise UserError("there are no stored rows in docs/data of a checkout; run thbcad bench NAME --store")
    _stored(root)  # each belongs to a benchmark
    modules = modules_of(root)
    marked = {path: refreshed(text, stored) for path, text in marked_pages(root).items()}
    for name in stored:
        marked |= own_pages(root, modules[name])
    new = {path: without_marks(text) for path, text in marked.items()}
    new[root / FILE] = quotes_text({path.relative_to(root).as_posix(): text for path, text in marked.items()})
    new[root / "docs" / "benchmarks.md"] = benchmark_page(root, marked)
    changed = [path for path, text in new.items() if not path.exists() or path.read_text("utf-8") != text]
    for path in changed:
        write_text(path, new[path])
    names = [path.relative_to(root).as_posix() for path in changed]
    return {"changed": names}, [f"wrote {name}" for name in names] or ["every page is up to date"]


def modules_of(root: Path) -> dict[str, Path]:
    """Return the benchmarks of a checkout by name: the modules that have `rows()`."""
    files = sorted((root / "benchmarks").rglob("*.py"))
    return {path.stem: path for path in files if "\ndef rows(" in path.read_text("utf-8")}


def _sentence(path: Path) -> str:
    """Return the first sentence of a benchmark's docstring."""
    text = ast.get_docstring(ast.parse(path.read_text("utf-8"))) or ""
    return " ".join(text.split("\n\n")[0].split())
