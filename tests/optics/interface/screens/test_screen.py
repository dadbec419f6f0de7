"""Layout of screens: 80 columns, two halves, marks, colours, narrow terminals, encodings."""

import os
import pty
import re
import subprocess
import sys
import termios

import pytest
from hypothesis import given, strategies as st

from optics.interface.screens import Entry, Heading, Screen, full_text, screen_text
from optics.interface.screens.screen import FAIL, OPEN, PASS, typeset
from tests.cases import ROOT
from tests.optics.cases import write_problem
from tests.optics.interface.screens.cases import Stream

LONG = (
    "light that leaves the lens far from its axis misses the target; make target.half_width larger than that"
)


@pytest.fixture
def columns(monkeypatch):
    """A function that sets the width of the terminal, without NO_COLOR."""
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", "xterm")
    return lambda count: monkeypatch.setenv("COLUMNS", str(count))


def shown(*entries, title="", state="", stream=None):
    return screen_text(Screen(title, state, entries), stream or Stream()).splitlines()


def test_rows_have_two_halves_that_begin_in_the_same_columns():
    lines = shown(
        Entry("lens", "20 x 20 x 8.5 mm", "relief +-1 of +-2 mm allowed"),
        Entry("light", "92% on the target", "detail down to 0.94 mm"),
        title="My lens",
        state="problem is valid",
    )
    assert lines == [
        "My lens" + " " * 57 + "problem is valid",
        "  lens     20 × 20 × 8.5 mm                  relief ±1 of ±2 mm allowed",
        "  light    92 % on the target                detail down to 0.94 mm",
    ]


def test_long_text_is_wrapped_below_itself_and_pushes_the_right_half_down():
    first, second, last = shown(Entry("note", LONG, "more: --full"))
    assert first.startswith("  note     light that leaves")
    assert re.match(r" {11}\S", second)
    assert last == " " * 11 + "more: --full"


def test_marks_stand_first_and_rows_without_one_are_aligned_with_the_others():
    lines = shown(
        Entry("light", "error 2 %", mark=PASS), Entry("", "U0: 0.6", mark=FAIL), Entry("cost", "6 s")
    )
    assert lines == ["PASS  light   error 2 %", "FAIL          U0: 0.6", "      cost    6 s"]


def test_only_a_terminal_gets_colours_and_none_with_no_color(columns, monkeypatch):
    columns(80)
    rows = [Entry("", "", mark=mark) for mark in (PASS, FAIL, OPEN)]
    terminal = shown(*rows, stream=Stream(True))
    assert terminal == ["\x1b[32mPASS\x1b[0m", "\x1b[31mFAIL\x1b[0m", "\x1b[33mOPEN\x1b[0m"]
    assert shown(*rows) == ["PASS", "FAIL", "OPEN"]
    for name, value in (("NO_COLOR", "1"), ("TERM", "dumb")):
        with monkeypatch.context() as changed:
            changed.setenv(name, value)
            assert shown(*rows, stream=Stream(True)) == ["PASS", "FAIL", "OPEN"]


texts = st.text(st.sampled_from("abc xyz-0123.% "), max_size=200)


@given(texts, texts, st.text(st.sampled_from("ab "), max_size=90), st.integers(40, 200))
def test_no_line_is_wider_than_80_columns_or_the_terminal(text, right, title, width):
    with pytest.MonkeyPatch.context() as changed:
        changed.setenv("COLUMNS", str(width))
        changed.setenv("NO_COLOR", "1")
        longest = max(map(len, re.split(r"\s+", f"{typeset(text)} {typeset(right)} {title}")))
        lines = shown(Entry("note", text, right), title=title, state="valid", stream=Stream(True))
        assert max(map(len, lines)) <= max(min(80, width), longest + 11)
        words = " ".join(lines).split()
        assert [w for w in words if w not in ("note", "valid")] == [
            w for w in f"{title} {typeset(text)} {typeset(right)}".split() if w not in ("note", "valid")
        ]


def test_everything_is_wrapped_on_a_terminal_and_one_line_each_elsewhere(columns):
    columns(60)
    lines = [Heading("Notes"), LONG, "  a row of a table" + " " * 60 + "end"]
    assert full_text(lines, Stream()).splitlines() == ["", "Notes", *lines[1:]]
    wrapped = full_text(lines, Stream(True)).splitlines()
    assert wrapped[:2] == ["", "\x1b[1mNotes\x1b[0m"]
    assert wrapped[3].startswith("  ")
    assert max(map(len, wrapped[:4])) <= 60
    assert wrapped[-1] == lines[-1]  # tables keep their columns


def test_a_stream_without_the_signs_gets_them_in_ascii():
    assert shown(Entry("a", "+-1 mm^2, 2 x 3"), stream=Stream(encoding="ascii")) == [
        "  a        +-1 mm^2, 2 x 3"
    ]


def test_control_characters_are_printed_as_codes():
    assert shown(Entry("a", "b\x1b[31mc"), title="d\x9b") == ["d\\x9b", "  a        b\\x1b[31mc"]


def in_a_terminal(width, *words):
    """Run the program in a pseudo terminal of a width, and return what it shows."""
    ours, theirs = pty.openpty()
    termios.tcsetwinsize(theirs, (40, width))
    environment = os.environ | {"PYTHONPATH": str(ROOT), "TERM": "xterm"}
    environment = {name: value for name, value in environment.items() if name not in ("COLUMNS", "NO_COLOR")}
    command = [sys.executable, "-m", "optics", *map(str, words)]
    with subprocess.Popen(command, stdout=theirs, stderr=subprocess.DEVNULL, env=environment) as process:
        os.close(theirs)
        read = b""
        while True:
            try:
                part = os.read(ours, 4096)
            except OSError:  # the other end is closed
                break
            if not part:
                break
            read += part
    os.close(ours)
    assert process.returncode == 0
    return read.decode().replace("\r\n", "\n").splitlines()


@pytest.mark.slow
@pytest.mark.parametrize("width", [80, 120])
def test_check_in_a_pseudo_terminal(width, tmp_path):
    path = write_problem(tmp_path, {"target.pixels": [16, 16]})
    lines = [re.sub(r"\x1b\[\d+m", "", line) for line in in_a_terminal(width, "check", path, "--full")]
    screen = lines[: lines.index("")]
    assert screen[0].endswith("problem is valid")
    assert len(screen[0]) == 80
    assert max(map(len, lines[len(screen) :])) in range(width - 20, width + 1)
