"""Rays as text: rows of 7 or 8 numbers, in mm and watts unless the head of the file says otherwise.

    x y z l m n flux [wavelength in nm or um]

Lines before the first row are its head: names of columns, comments, and the one or two numbers with which
OpticStudio begins: how many rays there are, and the unit of length.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from optics.base.runtime import UserError
from optics.scene.ray_files.ray_set import RaySet, Unit
from optics.scene.ray_files.zemax_rays import MILLIMETRES
from thbcad.checks import Floats
from thbcad.texts import LATIN, columns_by_blanks, number, text_of

COLUMNS, WITH_WAVELENGTH = 7, 8
ROW = "x y z l m n flux"
MOST_BYTES = 1 << 28  # 4 million rays of 64 letters
LUMENS = re.compile(r"\blm\b|\blumens?\b", re.IGNORECASE)
COMMENT = re.compile(r"\s*(?:#|%|!|//|;|\")")
LONGEST_UM = 30.0  # wavelengths up to here are in um, longer ones in nm


def read_text_rays(path: Path, data: memoryview) -> RaySet:
    """Return the rays of a text.

    Raises UserError : no text with rows of 7 or 8 numbers, rows of several lengths, or another count of rays
        than its head says.
    """
    if len(data) > MOST_BYTES:
        raise UserError(
            f"{path} is a text of {len(data):,} bytes, and at most {MOST_BYTES:,} are read; write the "
            "rays as a binary file"
        )
    try:
        text = columns_by_blanks(text_of(bytes(data), LATIN), COLUMNS)
    except ValueError as error:
        raise UserError(f"{path}: {error}") from None
    lines = [(k, line.split()) for k, line in enumerate(text.split("\n"), 1) if line and not line.isspace()]
    first = next((k for k, (_, words) in enumerate(lines) if _is_row(words)), None)
    if first is None:
        raise UserError(f"{path} holds no row of numbers {ROW}")
    table = _table(path, [line for line in lines[first:] if not COMMENT.match(line[1][0])])
    head = [words for _, words in lines[:first]]
    scale = _scale(path, head, len(table))
    unit: Unit = "lm" if any(LUMENS.search(" ".join(words)) for words in head) else "W"
    rows = table.astype(np.float32)
    position = (scale * table[:, :3]).astype(np.float32)
    wavelength = None
    if table.shape[1] == WITH_WAVELENGTH:
        nm = 1000 if table[:, COLUMNS].max() <= LONGEST_UM else 1
        wavelength = (nm * table[:, COLUMNS]).astype(np.float32)
    return RaySet(position, rows[:, 3:6], rows[:, 6], unit, wavelength)


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


def _scale(path: Path, head: list[list[str]], rays: int) -> float:
    """Return mm per unit of length by the head of a file, whose count of rays is compared with theirs."""
    for words in head:
        numbers = _numbers(words)
        if numbers is None or len(numbers) > 2:
            continue
        if numbers[0] != rays:
            raise UserError(
                f"{path} holds {rays} rays, and its head says {numbers[0]:g}; it may be truncated, or joined "
                "from several files"
            )
        unit = numbers[1] if len(numbers) == 2 else 4
        if unit not in MILLIMETRES:
            raise UserError(f"{path} has the unknown unit {unit:g} of length in its head; known are 0 to 4")
        return MILLIMETRES[int(unit)]
    return 1.0
