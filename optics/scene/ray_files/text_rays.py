"""Rays as text: rows of 7 or 8 numbers, in mm and watts unless the head of the file names other units.

    x y z l m n flux [wavelength in nm or um]

Lines before the first row are its head: names of columns, comments, and the one or two numbers with which
OpticStudio begins: how many rays there are, and the unit of length.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from optics.base.runtime import UserError
from optics.scene.ray_files.ray_set import RaySet
from optics.scene.ray_files.text_units import flux_unit, length_units
from optics.scene.ray_files.zemax_rays import MILLIMETRES
from thbcad.checks import Floats
from thbcad.texts import EMPTY, LATIN, column_mark, columns_by_blanks, is_damaged_row, number, text_of

COLUMNS, WITH_WAVELENGTH = 7, 8
ROW = "x y z l m n flux"
MOST_BYTES = 1 << 28  # 4 million rays of 64 letters
REMARK = re.compile(r"(?:[#%!]|//).*$|^[^\S\n]*\".*$", re.MULTILINE)
JUDGED = 1 << 16  # letters, from which the mark between columns is known
LONGEST_UM = 30.0  # wavelengths up to here are in um, longer ones in nm


def read_text_rays(path: Path, data: memoryview) -> RaySet:
    """Return the rays of a text.

    Raises UserError : no text with rows of 7 or 8 numbers, damaged rows, an unknown or a second unit in the
        head, or another count of rays than it says.
    """
    if len(data) > MOST_BYTES:
        raise UserError(
            f"{path} is a text of {len(data):,} bytes, and at most {MOST_BYTES:,} are read; write the "
            "rays as a binary file"
        )
    try:
        raw = text_of(bytes(data), LATIN)
    except ValueError as error:
        raise UserError(f"{path}: {error}; {_no_binary(data)}") from None
    try:
        lines = columns_by_blanks(raw, COLUMNS).split("\n")
    except ValueError as error:
        raise UserError(f"{path}: {error}") from None
    first = next((k for k, line in enumerate(lines) if _is_row(REMARK.sub("", line).split())), len(lines))
    _require_no_damaged_row(path, lines[:first])
    if first == len(lines):
        raise UserError(f"{path} holds no row of numbers {ROW}; {_no_binary(data)}")
    raw_lines = raw.split("\n")
    _require_no_empty_field(path, raw_lines[first:], first)
    rows = REMARK.sub("", "\n".join(lines[first:])).split("\n")
    table = _table(path, [(k, line.split()) for k, line in enumerate(rows, first + 1) if line.strip()])
    scale = _scale(path, lines[:first], length_units(raw_lines[:first]), len(table))
    unit = flux_unit("\n".join(raw_lines[:first]))
    values = table.astype(np.float32)
    position = (scale * table[:, :3]).astype(np.float32)
    return RaySet(position, values[:, 3:6], values[:, 6], unit, _wavelength(path, table))


def _no_binary(data: memoryview) -> str:
    return f"it is no binary ray file of TM-25, LightTools or Zemax: it begins with {bytes(data[:4])!r}"


def _is_row(words: list[str]) -> bool:
    return len(words) >= COLUMNS and _numbers(words[:COLUMNS]) is not None


def _numbers(words: list[str]) -> list[float] | None:
    try:
        return [number(word) for word in words]
    except ValueError:
        return None


def _table(path: Path, lines: list[tuple[int, list[str]]]) -> Floats:
    """Return the numbers of (line number, words), (n, 7) or (n, 8)."""
    columns = len(lines[0][1])
    if columns > WITH_WAVELENGTH:
        raise UserError(f"{path} has rows of {columns} numbers, wanted {ROW} and perhaps a wavelength")
    try:
        return np.loadtxt([" ".join(words) for _, words in lines], ndmin=2)
    except ValueError:
        line, words = next(((n, w) for n, w in lines if len(w) != columns or _numbers(w) is None), lines[-1])
        raise UserError(
            f"line {line} of {path} holds {' '.join(words)[:60]!r}, not {columns} numbers; "
            "it may be truncated"
        ) from None


def _require_no_damaged_row(path: Path, head: list[str]) -> None:
    for line, text in enumerate(head, 1):
        if is_damaged_row(text.split()[:WITH_WAVELENGTH]):
            raise UserError(
                f"line {line} of {path} holds {text.strip()[:60]!r}, not the numbers {ROW}; mend it, or "
                "begin it with # if it is a remark"
            )


def _require_no_empty_field(path: Path, lines: list[str], before: int) -> None:
    """Raise UserError where nothing is between two commas or semicolons.  before : lines of the head.

    Two tabs may only align the columns, and rows that lack a number differ in length.
    """
    text = "\n".join(lines)
    mark = column_mark(text[:JUDGED])
    if mark == "\t" or mark not in text:
        return
    text = "\n".join(line.rstrip(",; \t") for line in REMARK.sub("", text).split("\n"))
    if found := EMPTY[mark].search(text):
        line = before + 1 + text.count("\n", 0, found.start())
        raise UserError(f"line {line} of {path} has an empty field; every ray needs {ROW}")


def _wavelength(path: Path, table: Floats) -> NDArray[np.float32] | None:
    """Return the wavelengths of (n, 8) numbers in nm, None of (n, 7)."""
    if table.shape[1] < WITH_WAVELENGTH:
        return None
    column = table[:, COLUMNS]
    if column.min() <= LONGEST_UM < column.max():
        raise UserError(
            f"{path} has wavelengths from {column.min():g} to {column.max():g}: up to {LONGEST_UM:g} they "
            "are in um, and longer ones in nm; write all in one unit"
        )
    return ((1000 if column.max() <= LONGEST_UM else 1) * column).astype(np.float32)


def _scale(path: Path, head: list[str], named: set[float], rays: int) -> float:
    """Return mm per unit of length, and compare the count of rays that a head says with theirs.

    named : mm per unit, by the words of the head.
    """
    for line in head:
        numbers = _numbers(line.split())
        if not numbers:
            continue
        if numbers[0] != rays:
            raise UserError(
                f"{path} holds {rays} rays, and its head says {numbers[0]:g}; it may be truncated, or joined "
                "from several files"
            )
        if len(numbers) == 2:
            if numbers[1] not in MILLIMETRES:
                raise UserError(
                    f"{path} has the unknown unit {numbers[1]:g} of length in its head; known are 0 to 4"
                )
            named = named | {MILLIMETRES[int(numbers[1])]}
        break
    if len(named) > 1:
        sizes = " and ".join(f"{mm:g} mm" for mm in sorted(named))
        raise UserError(f"{path} names several units of length in its head: {sizes}; name one")
    return next(iter(named), 1.0)
