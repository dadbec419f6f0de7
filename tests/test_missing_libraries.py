"""Test files are left out where their library is missing, and only those."""

import ast

import pytest

from tests.cases import ROOT
from tests.missing_libraries import LIBRARIES, MISSING, left_out, needed, sentences
from tests.source_tree import FILES, MODULES, name, tree

TESTS = [path for path in FILES if name(path).startswith("tests/")]
CAD = "tests/thbcad/cad"


def imports(path):
    """Return the modules that a file imports at its top, by its syntax tree."""
    found = set()
    for node in tree(path).body:
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return found


def test_needed_libraries_are_those_of_the_syntax_trees():
    """A string with a program in it counts as nothing, an import within a function neither."""
    direct = {path: imports(path) for path in TESTS}
    wanted = {path: {m.split(".")[0] for m in modules} & set(LIBRARIES) for path, modules in direct.items()}
    for _ in range(5):  # helpers that import helpers
        for path, modules in direct.items():
            helpers = [MODULES[m] for m in modules if m in MODULES and m.startswith("tests.")]
            wanted[path] |= {library for helper in helpers for library in wanted[helper]}
    assert {name(path): needed(path) for path in TESTS} == {name(path): w for path, w in wanted.items()}


@pytest.mark.parametrize(
    ("file", "missing", "wanted"),
    [
        (f"{CAD}/exchange/test_handover.py", ("build123d",), True),
        (f"{CAD}/exchange/test_handover.py", ("cadquery",), False),
        (f"{CAD}/exchange/test_cadquery_handover.py", ("build123d",), False),
        (f"{CAD}/exchange/test_cadquery_handover.py", ("cadquery",), True),
        (f"{CAD}/exchange/test_step_bytes.py", LIBRARIES, False),  # OCP alone
        (f"{CAD}/foreign/cases.py", LIBRARIES, False),  # no test file
        (f"{CAD}/foreign", LIBRARIES, False),
        ("tests/test_loading.py", LIBRARIES, False),  # names both in strings
    ],
)
def test_a_file_is_left_out_only_without_its_own_library(file, missing, wanted):
    assert left_out(ROOT / file, missing) is wanted
    assert not left_out(ROOT / file, ())


def test_a_helper_passes_its_library_on(tmp_path):
    file = tmp_path / "test_helped.py"
    file.write_text("from tests.thbcad.cad.foreign.cases import (\n    RoundLens,\n)\n", "utf-8")
    assert left_out(file, ("build123d",))
    assert not left_out(file, ("cadquery",))


def test_no_file_needs_both_libraries():
    """The two can't be installed together."""
    assert [name(path) for path in TESTS if needed(path) == set(LIBRARIES)] == []


def test_the_report_counts_what_is_left_out(tmp_path):
    for file in ("test_a.py", "test_b.py", "cases.py"):
        (tmp_path / file).write_text("import cadquery as cq\n", "utf-8")
    (tmp_path / "test_c.py").write_text("from build123d import Box\n", "utf-8")
    two, one = "not collected without cadquery: 2 files", "not collected without build123d: 1 file"
    assert sentences([tmp_path], ("cadquery", "build123d")) == [two, one]
    assert sentences([tmp_path, tmp_path / "test_a.py"], ("cadquery",)) == [two]
    assert sentences([tmp_path / "test_a.py"], ("cadquery",)) == []  # named one by one, it is collected
    assert sentences([tmp_path], ()) == []


def test_collection_leaves_out_what_is_missing(request):
    """Of files with collected tests none needs a missing library."""
    collected = {item.path for item in request.session.items}
    assert [path for path in collected if left_out(path, MISSING)] == []
