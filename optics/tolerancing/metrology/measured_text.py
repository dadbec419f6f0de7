"""Rows of numbers in the text of a measurement: headers, comments, separators and missing values."""

from __future__ import annotations

import re

import numpy as np

from optics.base.runtime import UserError
from optics.tolerancing.metrology.instrument_files import MOST_POINTS
from thbcad.checks import Floats
from thbcad.texts import EMPTY, column_mark, columns_by_blanks, is_damaged_row, number

GRID_HEADER = 7  # numbers: nx ny dx dy unit xdec ydec
GRID_MISSING = 4  # column of a grid's rows that is not 0 where there is no data
JUDGED = 1 << 16  # letters, from which the layout of a text is known
MOST_LINES = MOST_POINTS + 100_000  # of text: headers and comments are few
COMMENT = re.compile(r"""^[^\S\n]*(?:#|%|!|//|"|').*$""", re.MULTILINE)
COMMENT_OR_SEMICOLON = re.compile(r"""^[^\S\n]*(?:#|%|!|//|;|"|').*$""", re.MULTILINE)
QUOTED = re.compile(r'"([-+.,0-9eEdD \t]*)"')  # a number as some programs write CSV
REMARK = re.compile(r"[#%!].*$", re.MULTILINE)
# what programs write in the place of a value, by letters without which a text has none of it: long texts are
# searched for these first
MISSING = (
    (("*",), re.compile(r"\*+")),
    (("--",), re.compile(r"(?<![\w.])-{2,}(?![\w.])")),
    ((",-,",), re.compile(r"(?<=,)-(?=,)")),
    (("-\t", "-;", "- ", "-\n", "-,"), re.compile(r"(?<![^\s,;])-(?![^\s,;])(?!,\d)")),
    (("#",), re.compile(r"[-+]?1\.#(?:QNAN|SNAN|IND|INF)\w*", re.IGNORECASE)),  # Windows
    (("(",), re.compile(r"[-+]?nan\(\w*\)", re.IGNORECASE)),
    (("a", "A"), re.compile(r"\b(?:no[ _]?data|n/?a|bad)\b", re.IGNORECASE)),
    (("ul", "UL", "on", "ON"), re.compile(r"\b(?:null|none)\b", re.IGNORECASE)),
)
NO_NUMBERS = ("nan", "inf", "infinity")


def number_rows(text: str, name: str, columns: int = 3) -> Floats:
    """Return the first numbers of every row, (n, columns), NaN where a value is missing.

    Comments and the lines before the first row of numbers are left out.

    Raises UserError : no row of numbers, too many of them, one that is none, or commas that may mean two
        things.
    """
    rows = _rows(text, name, columns)
    first = next((k for k, (_, row) in enumerate(rows) if _numbers(row, columns) is not None), len(rows))
    for line, row in rows[:first]:
        if is_damaged_row(row.split()[:columns]):
            raise UserError(
                f"line {line} of {name} holds {row.strip()[:60]!r}, not {columns} numbers; mend it, or begin "
                "it with # if it is a remark"
            )
    if first == len(rows):
        raise UserError(f"{name} holds no row of {columns} numbers")
    rows = rows[first:]
    if len(rows) > MOST_POINTS:
        raise UserError(f"{name} holds {len(rows):,} points, more than {MOST_POINTS:,}; thin it out")
    try:
        return np.loadtxt([row for _, row in rows], usecols=range(columns), ndmin=2)
    except ValueError:
        line, row = next(((n, r) for n, r in rows if _numbers(r, columns) is None), rows[-1])
        raise UserError(
            f"line {line} of {name} holds {row.strip()[:60]!r}, not {columns} numbers; "
            "the file may be cut off"
        ) from None


def grid_header(text: str, name: str) -> list[float] | None:
    """Return the seven numbers nx ny dx dy unit xdec ydec of a grid sag file, None of other files."""
    start = text[:JUDGED].rpartition("\n")[0] if len(text) > JUDGED else text
    try:
        rows = _rows(start, name, GRID_MISSING)
    except UserError:  # as rows of so many numbers their commas may mean two things
        return None
    numbers = _numbers(rows[0][1], GRID_HEADER) if rows else None
    if numbers is None or len(rows[0][1].split()) != GRID_HEADER:
        return None
    whole = all(n == int(n) for n in (*numbers[:2], numbers[4]) if np.isfinite(n))
    if not np.isfinite(numbers).all() or not whole or min(numbers[:4]) <= 0:
        return None
    return numbers


def grid_rows(text: str, name: str, count: int) -> Floats:
    """Return the heights of a grid sag file, (count,), NaN where there is no data.

    Raises UserError : more or fewer rows, or one that is none.
    """
    if count > MOST_POINTS:
        raise UserError(f"{name} announces more than {MOST_POINTS:,} points; thin it out")
    rows = _rows(text, name, GRID_MISSING)[1:]
    if len(rows) != count:
        raise UserError(
            f"{name} announces {count:,} points and holds {len(rows):,} rows; the file may be cut off"
        )
    heights = number_rows("\n".join(row for _, row in rows), name, 1)[:, 0]
    flagged = [k for k, (_, row) in enumerate(rows) if len(row.split()) > GRID_MISSING]
    flags = np.zeros(0)
    if flagged:  # some programs flag only the rows without data
        flags = number_rows("\n".join(rows[k][1] for k in flagged), name, GRID_MISSING + 1)[:, GRID_MISSING]
    if len(heights) != count or len(flags) != len(flagged):
        raise UserError(f"{name} holds rows that are no numbers")
    heights[np.array(flagged, dtype=int)[flags != 0]] = np.nan
    return heights


def _rows(text: str, name: str, columns: int) -> list[tuple[int, str]]:
    """Return (line number, words parted by blanks) of lines that are no comments, missing values as nan."""
    if (lines := text.count("\n")) > MOST_LINES:
        raise UserError(
            f"{name} has {lines:,} lines, and at most {MOST_POINTS:,} points are read; thin it out"
        )
    text = QUOTED.sub(r"\1", text) if '"' in text else text
    mark = column_mark(text[:JUDGED])
    text = (COMMENT if mark == ";" else COMMENT_OR_SEMICOLON).sub("", text)
    for letters, missing in MISSING:
        text = missing.sub("nan", text) if any(part in text for part in letters) else text
    text = REMARK.sub("", text)
    text = EMPTY[mark].sub(" nan ", text) if mark in text else text
    try:
        text = columns_by_blanks(text, columns)
    except ValueError as error:
        raise UserError(f"{name}: {error}") from None
    return [(k, row) for k, row in enumerate(text.split("\n"), 1) if row and not row.isspace()]


def _numbers(row: str, columns: int) -> list[float] | None:
    """Return the first numbers of a row, None where there are none."""
    words = row.split()[:columns]
    try:
        numbers = [float("nan") if _is_missing(word) else number(word) for word in words]
    except ValueError:
        return None
    return numbers if len(numbers) == columns else None


def _is_missing(word: str) -> bool:
    return word.lstrip("+-").lower() in NO_NUMBERS
