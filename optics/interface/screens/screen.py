"""What a command shows first: its result in short rows, at most 80 columns wide, in colour on a terminal."""

from __future__ import annotations

import os
import re
import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from shutil import get_terminal_size
from typing import TextIO

from optics.base.runtime import Grade, printable

WIDTH = 80  # columns
LABEL = 9  # columns of a label, after two blanks
MARK, SUBJECT = 6, 8  # columns of PASS, FAIL or OPEN, and of the label after it
RIGHT = 45  # column of the second half of a row
NARROWEST = 20  # columns of text that a row has at least
PASS, FAIL, OPEN = "PASS", "FAIL", "OPEN"
COLOURS = {PASS: "32", FAIL: "31", OPEN: "33"}  # ANSI: green, red, yellow
BOLD = "1"
MARK_OF: dict[Grade, str] = {
    "made": PASS,
    "light misses": FAIL,
    "file or part fails": FAIL,
    "not decided": OPEN,
}
TYPOGRAPHY = (
    (r"\+- ?(?=\d)", "±"),
    (r"\+-", "±"),
    (r"(?<=[a-z])\^2\b", "²"),
    (r"(?<=[a-z])\^3\b", "³"),
    (r"(?<=\d) x (?=\d)", " × "),
    (r"(?<=\d)%", " %"),
    (r"\bum\b", "µm"),
)
UNBROKEN = "\N{NO-BREAK SPACE}"
TOGETHER = re.compile(r"(?<=--set) |(?<=\d) (?=(?:%|[µkmn]?[mWs]|px|degrees|hours)\b|%)")
ASCII = str.maketrans({"±": "+-", "²": "^2", "³": "^3", "×": "x", "µ": "u", "≤": "<=", "≥": ">="})


class Heading(str):
    """A line that begins a section of the full output."""


@dataclass(frozen=True)
class Entry:
    """A row of a screen: a label, then text.

    right : text for the right half of the row; it gets its own row if it does not fit.
    mark : PASS, FAIL or OPEN in front of the label, or "".
    """

    label: str
    text: str
    right: str = ""
    mark: str = ""


@dataclass(frozen=True)
class Screen:
    """The rows that a command shows first.

    title, state : headline, left and right; both may be "".
    """

    title: str
    state: str
    entries: tuple[Entry, ...]

    def lines(self, paint: Paint) -> list[str]:
        """Return the lines of the screen."""
        marked = any(entry.mark for entry in self.entries)
        lines = _headline(self.title, self.state, paint)
        for entry in self.entries:
            lines += _rows(entry, marked, paint)
        return lines


@dataclass(frozen=True)
class Paint:
    """How a stream shows lines: columns, whether it shows colours, and whether it is a terminal."""

    width: int = WIDTH
    colours: bool = False
    terminal: bool = False

    @classmethod
    def of(cls, stream: TextIO) -> Paint:
        """Return the Paint of a stream: colours on a terminal, unless NO_COLOR is set or TERM is dumb."""
        terminal = stream.isatty()
        plain = bool(os.environ.get("NO_COLOR")) or os.environ.get("TERM") == "dumb"
        return cls(
            get_terminal_size((WIDTH, 24)).columns if terminal else WIDTH, terminal and not plain, terminal
        )

    def __call__(self, text: str, code: str) -> str:
        """Return a text in a colour, or as it is where there are no colours.  code : of ANSI."""
        return f"\x1b[{code}m{text}\x1b[0m" if self.colours and text else text


def screen_text(screen: Screen, stream: TextIO) -> str:
    """Return a screen as text for a stream."""
    return _encodable("\n".join(screen.lines(Paint.of(stream))), stream)


def full_text(lines: Iterable[str], stream: TextIO) -> str:
    """Return all lines of a command as text: wrapped on a terminal, elsewhere one line each.

    A blank line and the bold text of a `Heading` begin each section.
    """
    paint, out = Paint.of(stream), []
    for line in lines:
        if isinstance(line, Heading):
            out += ["", paint(printable(line), BOLD)]
        elif paint.terminal and not line.startswith(" ") and len(line) > paint.width:
            out += _wrapped(printable(line), paint.width, 0, 2)
        else:
            out.append(printable(line))
    return _encodable("\n".join(out), stream)


def typeset(text: str) -> str:
    """Return a sentence with ±, ×, ², ³, µ, and a blank before the sign of per cent."""
    for pattern, shown in TYPOGRAPHY:
        text = re.sub(pattern, shown, text)
    return text


def _headline(title: str, state: str, paint: Paint) -> list[str]:
    title, state = printable(title), printable(state)
    if not title or not state:
        return [paint(text, BOLD) for text in (title, state) if text]
    width = min(paint.width, WIDTH)
    gap = width - len(title) - len(state)
    if gap < 2:
        return [*(paint(line, BOLD) for line in _wrapped(title, width, 0, 0)), *_wrapped(state, width, 2, 2)]
    return [f"{paint(title, BOLD)}{' ' * gap}{state}"]


def _rows(entry: Entry, marked: bool, paint: Paint) -> list[str]:
    """Return an entry as one line or several.  marked : some entry of the screen has a mark."""
    width = min(paint.width, WIDTH)
    if marked:
        head = paint(entry.mark, COLOURS.get(entry.mark, "")) + " " * (MARK - len(entry.mark))
        head, start = head + entry.label.ljust(SUBJECT), MARK + SUBJECT
    else:
        head, start = "  " + entry.label.ljust(LABEL), 2 + LABEL
    text, right = printable(typeset(entry.text)), printable(typeset(entry.right))
    lines = _wrapped(text, width, start, start)
    if right and len(lines) == 1 and len(lines[0]) + 2 <= RIGHT and RIGHT + len(right) <= width:
        lines = [lines[0].ljust(RIGHT) + right]
    elif right:
        lines += _wrapped(right, width, start, start)
    return [(head + lines[0][start:]).rstrip(), *lines[1:]]


def _wrapped(text: str, width: int, first: int, others: int) -> list[str]:
    """Return a text in lines of at most `width` columns; longer words stay whole.

    first, others : blanks before the first line and before all others.
    """
    lines = textwrap.wrap(
        TOGETHER.sub(UNBROKEN, text),
        max(width, others + NARROWEST),
        initial_indent=" " * first,
        subsequent_indent=" " * others,
        break_long_words=False,
        break_on_hyphens=False,
    )
    return [line.replace(UNBROKEN, " ") for line in lines] or [" " * first]


def _encodable(text: str, stream: TextIO) -> str:
    """Return a text that the stream can write: signs that its encoding lacks are spelled in ASCII."""
    try:
        text.encode(stream.encoding or "utf-8")
    except UnicodeEncodeError:
        return text.translate(ASCII)
    return text


def rows_of(cells: Sequence[Sequence[str]]) -> list[str]:
    """Return a table as lines with aligned columns, two blanks apart."""
    widths = [max(map(len, column)) for column in zip(*cells)]
    return ["  ".join(c.ljust(w) for c, w in zip(row, widths)).rstrip() for row in cells]
