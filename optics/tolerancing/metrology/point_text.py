"""Rows of numbers in the text of a measurement: headers, comments, separators, missing values."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from optics.base.runtime import UserError

Floats = NDArray[np.float64]

MOST_BYTES = 1 << 28  # 256 MB: 4 million rows of 64 characters, more than MOST_POINTS can use
MOST_POINTS = 2_000_000  # their matrix of 16 functions each takes 0.4 GB
GRID_HEADER = 7  # numbers: nx ny dx dy unit xdec ydec
GRID_MISSING = 4  # column of a grid's rows that is not 0 where there is no data

COMMENT = re.compile(r"""^\s*(#|%|!|//|;|"|').*$""")
REMARK = re.compile(r"[#%!].*$")
MISSING = re.compile(r"\*+|\bno[ _]?data\b|\bn/?a\b|\bbad\b|(?<![\w.])-{2,}(?![\w.])", re.IGNORECASE)
DECIMAL_COMMA = re.compile(r"\d,\d+\s*;|;\s*[-+]?\d+,\d")
EMPTY_FIELD = re.compile(r"([,;])(?=\s*([,;]|$))")
SEPARATORS = str.maketrans(",;\t", "   ")


def read_text(path: str | Path) -> str:
    """Return the text of a file.

    Raises
    ------
    UserError : the file cannot be read, is too large, or holds no text.
    """
    path = Path(path)
    try:
        with path.open("rb") as file:  # a device has no size, and no end
            data = file.read(MOST_BYTES + 1)
    except OSError as error:
        raise UserError(f"cannot read {path}: {error.strerror or error}") from None
    if len(data) > MOST_BYTES:
        raise UserError(f"{path} has more than {MOST_BYTES:,} bytes; measure fewer points, or thin it out")
    if not data.strip():
        raise UserError(f"{path} is empty")
    encoding = "utf-16" if data[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"
    try:
        text = data.decode(encoding)
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    if "\0" in text:
        raise UserError(f"{path} is no text: a measurement is rows of numbers x y z")
    return text


def number_rows(text: str, name: str, columns: int = 3) -> Floats:
    """Return the first numbers of every row, (n, columns), NaN where a value is missing.

    Comments and the lines before the first row of numbers are left out.

    Raises
    ------
    UserError : no row of numbers, too many of them, or one that is none.
    """
    rows = _rows(text)
    first = next((k for k, (_, row) in enumerate(rows) if _numbers(row, columns) is not None), None)
    if first is None:
        raise UserError(f"{name} holds no row of {columns} numbers")
    rows = rows[first:]
    if len(rows) > MOST_POINTS:
        raise UserError(f"{name} holds {len(rows):,} points, more than {MOST_POINTS:,}; thin it out")
    try:
        return np.loadtxt([row for _, row in rows], usecols=range(columns), ndmin=2)
    except ValueError:
        number, row = next((n, r) for n, r in rows if _numbers(r, columns) is None)
        raise UserError(
            f"line {number} of {name} holds {row.strip()[:60]!r}, not {columns} numbers; "
            "the file may be cut off"
        ) from None


def grid_header(text: str) -> list[float] | None:
    """Return the seven numbers nx ny dx dy unit xdec ydec of a grid sag file, None of other files."""
    rows = _rows(text, most=1)
    numbers = _numbers(rows[0][1], GRID_HEADER) if rows else None
    if numbers is None or len(rows[0][1].split()) != GRID_HEADER:
        return None
    whole = all(n == int(n) for n in (*numbers[:2], numbers[4]) if np.isfinite(n))
    if not np.isfinite(numbers).all() or not whole or min(numbers[:4]) <= 0:
        return None
    return numbers


def grid_rows(text: str, name: str, count: int) -> Floats:
    """Return the heights of a grid sag file, (count,), NaN where there is no data.

    Raises
    ------
    UserError : more or fewer rows, or one that is none.
    """
    if count > MOST_POINTS:
        raise UserError(f"{name} announces more than {MOST_POINTS:,} points; thin it out")
    rows = _rows(text)[1:]
    if len(rows) != count:
        raise UserError(
            f"{name} announces {count:,} points and holds {len(rows):,} rows; the file may be cut off"
        )
    body = "\n".join(row for _, row in rows)
    flagged = all(len(row.split()) > GRID_MISSING for _, row in rows)
    values = number_rows(body, name, GRID_MISSING + 1 if flagged else 1)
    if len(values) != count:
        raise UserError(f"{name} holds rows that are no numbers")
    heights = values[:, 0].copy()
    if flagged:
        heights[values[:, GRID_MISSING] != 0] = np.nan
    return heights


def _rows(text: str, most: int | None = None) -> list[tuple[int, str]]:
    """Return (line number, words parted by spaces) of lines that are no comments, missing values as nan."""
    comma = DECIMAL_COMMA.search(text[: 1 << 16]) is not None
    rows = []
    for number, line in enumerate(text.splitlines(), 1):
        if COMMENT.match(line):
            continue
        plain = MISSING.sub("nan", REMARK.sub("", line))
        plain = EMPTY_FIELD.sub(r"\1 nan ", plain)
        plain = plain.replace(",", ".").replace(";", " ") if comma else plain.translate(SEPARATORS)
        if plain.strip():
            rows.append((number, plain))
            if len(rows) == most:
                break
    return rows


def _numbers(row: str, columns: int) -> list[float] | None:
    """Return the first numbers of a row, None where there are none."""
    words = row.split()[:columns]
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        return None
    return numbers if len(numbers) == columns else None
