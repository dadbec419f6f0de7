"""TOML that costs more than it says is refused before it is read; all other is read as the standard library
reads it."""

import tomllib
import tracemalloc

import pytest
from hypothesis import example, given, strategies as st

from thbcad.toml import MOST_DEPTH, MOST_PARTS, toml_tables

LONG = 100_000
LONG_KEYS = {
    "dotted": "\na" + ".a" * LONG + "=1",
    "blanks": "a" + " . a" * LONG + "=1",
    "quoted": "'a'" + '."a.b"' * LONG + "=1",
    "table": "x=1\n[a" + ".a" * LONG + "]",
    "rows of a table": "[[a" + ".a" * LONG + "]]",
    "inline": "x={a" + ".a" * LONG + "=1}",
    "without a value": "a" + ".a" * LONG,
}
DEEP = {
    "lists": "x=" + "[" * LONG + "]" * LONG,
    "tables": "x=" + "{a=" * LONG,
    "both": "x=" + "[{a=" * LONG,
    "over lines": "x=" + "[\n" * LONG,
}


@pytest.mark.parametrize("text", LONG_KEYS.values(), ids=LONG_KEYS)
def test_a_key_of_many_parts_is_refused_before_it_takes_memory(text):
    tracemalloc.start()
    with pytest.raises(ValueError, match=rf"a key has more than {MOST_PARTS} parts \(at line [12]\)"):
        toml_tables(text)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 8 * len(text) + 1e6  # the standard library takes 8 bytes times half the square of the parts


@pytest.mark.parametrize("text", DEEP.values(), ids=DEEP)
def test_values_deep_in_each_other_are_refused(text):
    with pytest.raises(ValueError, match=rf"values are nested more than {MOST_DEPTH} deep \(at line \d+\)"):
        toml_tables(text)


def test_the_line_is_that_of_the_text_whatever_stands_in_strings_before_it():
    text = '# [\na = \'\'\'\n.\n[\n\'\'\'\nb = """\\"""\\\n"""\nc' + ".c" * MOST_PARTS + "=1"
    with pytest.raises(ValueError, match=r"at line 8"):
        toml_tables(text)


def test_as_much_as_is_allowed_is_read():
    key, value = ".".join("a" * MOST_PARTS), "[" * MOST_DEPTH + "]" * MOST_DEPTH
    assert toml_tables(f"{key}=1") == tomllib.loads(f"{key}=1")
    assert toml_tables(f"x={value}") == tomllib.loads(f"x={value}")


def test_dots_and_brackets_in_strings_and_comments_are_no_keys_and_no_lists():
    dots = "." * LONG + "[{" * LONG
    text = (
        f'a="\\"{dots}"\nb=\'{dots}\'\nc=""""\n{dots}\\""""\nd=\'\'\'{dots}\'\'\'\'\ne=1#{dots}\n"{dots}"=1'
    )
    assert toml_tables(text) == tomllib.loads(text)
    assert list(toml_tables(text)) == ["a", "b", "c", "d", "e", dots]


PIECES = ['"', "'", '"""', "'''", "\\", "\n", "#", "=", ".", ",", "[", "]", "{", "}", " ", "a", "1", "é"]


@given(pieces=st.lists(st.sampled_from(PIECES), max_size=15))
def test_short_texts_are_read_as_the_standard_library_reads_them(pieces):
    text = "x = " + "".join(pieces)
    try:
        wanted = tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        with pytest.raises(tomllib.TOMLDecodeError):
            toml_tables(text)
    else:
        assert toml_tables(text) == wanted


STRINGS = st.text(alphabet="ab.[{#=,\n", max_size=40).map(lambda s: s.replace("\\", ""))
QUOTED = st.one_of(
    STRINGS.map(lambda s: '"' + s.replace("\n", "\\n\\\"'") + '"'),
    STRINGS.map(lambda s: "'" + s.replace("\n", '"""') + "'"),
    STRINGS.map(lambda s: '"""\n' + s.replace("a", "\\\"\"\"'''") + '""""'),
    STRINGS.map(lambda s: "'''" + s.replace("a", '""" \\') + "''''"),
)


@example(values=["'''''''"])
@example(values=['""""""""'])
@given(values=st.lists(QUOTED, max_size=8))
def test_strings_hide_what_they_hold(values):
    text = "".join(f'k{k} = {value} # \' """ [[ .....\n' for k, value in enumerate(values))
    assert toml_tables(text) == tomllib.loads(text)
    with pytest.raises(ValueError, match=r"a key has more than"):
        toml_tables(text + "[b" + ".b" * MOST_PARTS + "]")
