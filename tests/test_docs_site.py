"""What the documentation site makes of the code: every key, command, room and benchmark is on its pages.

`make docs` builds the site, and fails at a link, an anchor or a page that is missing.
"""

import re

import pytest

from benchmarks.rows.stored_rows import read_rows
from optics.interface.commands import parsers
from optics.scene.keys import keys_of, table_of
from optics.scene.problem import Problem
from scripts.docs_site import api_pages
from scripts.docs_site.benchmark_pages import benchmark_pages
from scripts.docs_site.command_page import with_help
from scripts.docs_site.docstring_text import as_markdown
from scripts.docs_site.outside_files import CODE_OR_LINK, with_links
from scripts.docs_site.problem_page import MARK, keys_text
from tests.cases import ROOT

DOCS = ROOT / "docs"
REQUIRED = {"source.kind", "lens.thickness", "lens.front.half_width", "target.half_width"}
QUOTED = {'"uniform"', '"round"', '"gaussian"'}


def cells_of(text):
    """Return {anchor: the other cells of its row} of all rows of tables that have one."""
    rows = re.findall(r'^\| <span id="([\w.]+)"></span>(.*) \|$', text, re.MULTILINE)
    return {name: re.split(r" ?(?<!\\)\| ?", cells) for name, cells in rows}


def test_every_key_of_the_schema_has_a_row_with_six_cells():
    rows = cells_of(keys_text())
    tables = {key.name: table_of(key.hint) for key in keys_of(Problem) if table_of(key.hint)}
    first = {table: name for name, table in reversed(tables.items())}  # the page refers to one of equal keys
    shared = tuple(f"{name}." for name, table in tables.items() if first[table] != name)
    wanted = {k.name for k in keys_of(Problem) if k.name not in tables and not k.name.startswith(shared)}
    assert set(rows) == wanted
    assert {len(cells) for cells in rows.values()} == {6}
    assert [name for name, cells in rows.items() if not cells[5]] == []  # every key has a meaning


def test_rows_of_keys_tell_type_unit_default_and_range():
    rows = cells_of(keys_text())
    assert rows["source.distance"][1:5] == ["number", "mm", "`2.0`", "at least 0, at most 1e+09"]
    assert rows["source.distance"][5] == "From the source plane to the front vertex."
    assert rows["target.distance"][1:5] == [
        "number",
        "mm",
        "left out",
        "at least 1e-06, at most 1e+09, or `inf`",
    ]
    assert rows["lens.front.radius"][1] == 'number or `"auto"`'
    assert rows["source.half_width"][1:4] == ["list of 2 numbers", "mm", "`[0.0, 0.0]`"]
    assert all(rows[name][3] == "**required**" for name in REQUIRED)
    assert all(name in rows["source.profile"][4] for name in QUOTED)


@pytest.mark.parametrize("name", parsers()[1])
def test_every_command_shows_its_help_in_its_own_section(name):
    page = with_help((DOCS / "commands.md").read_text("utf-8"))
    section = page.partition(f"\n## {name}\n")[2].partition("\n## ")[0]
    for action in parsers()[1][name]._actions:
        assert all(option in section.partition("--help")[2] for option in action.option_strings)


def test_a_command_without_a_section_is_refused():
    with pytest.raises(ValueError, match="## relight"):
        with_help((DOCS / "commands.md").read_text("utf-8").replace("## relight", "## relit"))


def test_every_room_has_a_page_with_all_names_of_its_door():
    rooms = {room.module: room for room in api_pages.rooms()}
    for module, room in rooms.items():
        door = __import__(module, fromlist=["__all__"])
        assert list(room.names) == list(dict.fromkeys(room.names))
        assert sorted(room.names) == door.__all__
        assert all(home in room.text() for _, home in room.names.values())
    assert all(room in rooms for held in rooms.values() for room, _ in held.names.values())


def test_every_benchmark_has_a_page_with_all_of_its_rows():
    pages, stored = benchmark_pages(), read_rows(DOCS / "data")
    assert set(pages) == set(stored)
    for name, page in pages.items():
        rows = [line for line in page.splitlines() if line.startswith("| ")]
        assert len(rows) == 1 + len(stored[name].rows), name


def test_docstrings_keep_their_signs_formulas_and_sections():
    text = """Return a_i * b < c of `x_i`.

    z = a * b_i

a : rows, (n,).  b_2, c : columns,
    which go on here.

Raises ValueError : a_i of another shape,
    or not finite.

>>> f(a_i)  # [*]
1
"""
    assert as_markdown(text) == (
        "Return a\\_i \\* b &lt; c of `x_i`.\n\n    z = a * b_i\n\n"
        "- `a`: rows, (n,).\n- `b_2, c`: columns, which go on here.\n\n"
        "**Raises**\n\n- `ValueError`: a\\_i of another shape, or not finite.\n\n"
        "**Examples**\n\n```pycon\n>>> f(a_i)  # [*]\n1\n```"
    )


def test_links_out_of_docs_lead_to_places_of_the_site():
    text = "[a](../README.md) [b](benchmarks.md#error) [c](../CONTRIBUTING.md#words) `[d](../x)` [e](https://f.g)"
    wanted = "[a](README.md) [b](benchmarks/error.md) [c](contributing.md#words) `[d](../x)` [e](https://f.g)"
    assert with_links(text, DOCS / "page.md", "page.md") == wanted
    assert with_links("[a](docs/thb.md#cost)", ROOT / "CHANGELOG.md", "changelog.md") == "[a](thb.md#cost)"
    code = "[a](../../examples/pearl.toml) ![b](../../examples/pearl.png) [c](../../examples/scripts)"
    assert with_links(code, DOCS / "thesis" / "x.md", "thesis/x.md") == (
        "[a](../repository/examples/pearl.toml.md) ![b](../repository/examples/pearl.png) "
        "[c](../repository/examples/scripts/index.md)"
    )
    assert [found[1] for found in CODE_OR_LINK.finditer("```\n[a](b)\n```\n")] == [None]


def test_the_navigation_names_every_page_of_docs():
    text = (ROOT / "mkdocs.yml").read_text("utf-8")
    named = set(re.findall(r"^ +- (?:[^:\n]+: )?([\w/]+\.md)$", text, re.MULTILINE))
    assert {path.relative_to(DOCS).as_posix() for path in DOCS.rglob("*.md")} <= named
    assert MARK in (DOCS / "problem_file.md").read_text("utf-8")
    assert api_pages.MARK in (DOCS / "api.md").read_text("utf-8")
