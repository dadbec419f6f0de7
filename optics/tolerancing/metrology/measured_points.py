"""Measured points of a surface, in the surface's own frame.

The frame has its origin in the vertex of the surface, +z along the light, x and y as the lens has them, mm.
What a file holds is brought there in this order: units, mirrored x, rotation about z, the middle, heights
turned over.  The text has rows of numbers, with headers, comments, separators and missing values.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

import numpy as np

from optics.base.runtime import UserError
from optics.tolerancing.metrology.instrument_files import (
    MILLIMETRES,
    MOST_BYTES,
    MOST_POINTS,
    grid_points,
    instrument_points,
)
from thbcad.checks import Floats
from thbcad.lens import FreeformSurface

GRID_HEADER = 7  # numbers: nx ny dx dy unit xdec ydec
GRID_MISSING = 4  # column of a grid's rows that is not 0 where there is no data

COMMENT = re.compile(r"""^\s*(#|%|!|//|;|"|').*$""")
REMARK = re.compile(r"[#%!].*$")
MISSING = re.compile(
    r"\*+|\bno[ _]?data\b|\bn/?a\b|\bbad\b|(?<![\w.])-{2,}(?![\w.])"
    r"|[-+]?1\.#(QNAN|SNAN|IND|INF)\w*|[-+]?nan\(\w*\)",  # as Windows prints what is no number
    re.IGNORECASE,
)
DECIMAL_COMMA = re.compile(r"\d,\d+\s*;|;\s*[-+]?\d+,\d")
EMPTY_FIELD = re.compile(r"([,;])(?=\s*([,;]|$))")
EMPTY_BETWEEN_TABS = re.compile(r"(\t)(?= *(\t|$))")
SEPARATORS = str.maketrans(",;\t", "   ")
Unit = Literal["m", "mm", "um", "nm"]
Kind = Literal["heights", "errors"]
GRID_UNITS = (1.0, 10.0, 25.4, 1000.0)  # mm, of the unit flag of a grid sag file
TURNS = (0, 90, 180, 270)
LEAST_POINTS = 100  # fewer say nothing of a freeform surface
LEAST_INSIDE = 0.5  # of the points lie on the surface, else the frame or the unit is another one
ROUNDED = 1e-12  # of the half-width: points so far beside the rim lie on it
LEAST_EXTENT = 0.02  # of the surface's width
FARTHEST = 0.1  # of the greater half-width: no lens is so far from its design


def read_bytes(path: str | Path) -> bytes:
    """Return what a file holds.

    Raises UserError : the file cannot be read, is empty, or too large.
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
    return data


def text_of(data: bytes, name: str) -> str:
    """Return the text of a file.

    Raises UserError : it holds none.
    """
    encoding = "utf-16" if data[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"
    try:
        text = data.decode(encoding)
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    if "\0" in text:
        raise UserError(f"{name} is no text: a measurement is rows x y z, or an X3P, Zygo or GXYZF file")
    return text


def number_rows(text: str, name: str, columns: int = 3) -> Floats:
    """Return the first numbers of every row, (n, columns), NaN where a value is missing.

    Comments and the lines before the first row of numbers are left out.

    Raises UserError : no row of numbers, too many of them, or one that is none.
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

    Raises UserError : more or fewer rows, or one that is none.
    """
    if count > MOST_POINTS:
        raise UserError(f"{name} announces more than {MOST_POINTS:,} points; thin it out")
    rows = _rows(text)[1:]
    if len(rows) != count:
        raise UserError(
            f"{name} announces {count:,} points and holds {len(rows):,} rows; the file may be cut off"
        )
    body = "\n".join(row for _, row in rows)
    heights = number_rows(body, name, 1)[:, 0]
    flagged = [k for k, (_, row) in enumerate(rows) if len(row.split()) > GRID_MISSING]
    flags = np.zeros(0)
    if flagged:  # some programs flag only the rows without data
        flags = number_rows("\n".join(rows[k][1] for k in flagged), name, GRID_MISSING + 1)[:, GRID_MISSING]
    if len(heights) != count or len(flags) != len(flagged):
        raise UserError(f"{name} holds rows that are no numbers")
    heights[np.array(flagged, dtype=int)[flags != 0]] = np.nan
    return heights


def _rows(text: str, most: int | None = None) -> list[tuple[int, str]]:
    """Return (line number, words parted by spaces) of lines that are no comments, missing values as nan."""
    start = text[: 1 << 16]
    comma = DECIMAL_COMMA.search(start) is not None
    empty = [EMPTY_FIELD, EMPTY_BETWEEN_TABS] if _parted_by_tabs(start) else [EMPTY_FIELD]
    rows = []
    for number, line in enumerate(text.splitlines(), 1):
        if COMMENT.match(line):
            continue
        plain = REMARK.sub("", MISSING.sub("nan", line))
        for field in empty:
            plain = field.sub(r"\1 nan ", plain)
        plain = plain.replace(",", ".").replace(";", " ") if comma else plain.translate(SEPARATORS)
        if plain.strip():
            rows.append((number, plain))
            if len(rows) == most:
                break
    return rows


def _parted_by_tabs(text: str) -> bool:
    """Return whether single tabs part the columns of most lines, so that nothing between two is a value."""
    lines = [line.strip(" ") for line in text.splitlines() if "\t" in line]
    return 2 * sum("\t\t" not in line and line == line.strip() for line in lines) > len(lines)


def _numbers(row: str, columns: int) -> list[float] | None:
    """Return the first numbers of a row, None where there are none."""
    words = row.split()[:columns]
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        return None
    return numbers if len(numbers) == columns else None


@dataclass(frozen=True)
class FileFrame:
    """What a file's numbers mean.

    unit : of x and y.  height_unit : of the third column, by default the same.
    kind : "heights" z of the surface, or "errors" dz = made - designed.
    mirror : x is turned over first, as where the part was measured from behind.
    turn : then x and y are turned by 0, 90, 180 or 270 degrees, from +x towards +y.
    down : heights are positive against the light.
    centre : the middle of what was measured is the vertex.
    """

    unit: Unit = "mm"
    height_unit: Unit | None = None
    kind: Kind = "heights"
    mirror: bool = False
    turn: int = 0
    down: bool = False
    centre: bool = False

    def __post_init__(self) -> None:
        for name, value, known in (
            ("unit", self.unit, get_args(Unit)),
            ("height_unit", self.height_unit or self.unit, get_args(Unit)),
            ("kind", self.kind, get_args(Kind)),
            ("turn", self.turn, TURNS),
        ):
            if value not in known:
                raise UserError(f"{name} must be one of {', '.join(map(str, known))}, got {value!r}")

    def placed(self, x: Floats, y: Floats) -> tuple[Floats, Floats]:
        """Return x and y of the surface from those of the file, both in mm."""
        if self.mirror:
            x = -x
        for _ in range(self.turn // 90):
            x, y = -y, x
        return x, y


@dataclass(frozen=True, eq=False)
class MeasuredPoints:
    """Points (3, n) in the frame of a surface, mm.

    missing : rows of the file without a value.  beside : points that lie beside the surface.
    """

    points: Floats
    missing: int = 0
    beside: int = 0


def read_measured(
    path: str | Path, surface: FreeformSurface, frame: FileFrame | None = None
) -> MeasuredPoints:
    """Return the measured points of a surface from rows x y z, or a grid sag, X3P, Zygo or GXYZF file.

    Raises UserError : a file that cannot be read, is cut off, holds too few points, or does not fit the
        surface.
    """
    frame = frame or FileFrame()
    x, y, values = _values(path, frame)
    there = np.isfinite(x) & np.isfinite(y) & np.isfinite(values)
    missing = int(there.size - there.sum())
    x, y = frame.placed(x[there], y[there])
    values = -values[there] if frame.down else values[there]
    if len(x) < LEAST_POINTS:
        raise UserError(f"{path} holds {len(x)} points with a value, fewer than {LEAST_POINTS}")
    if frame.centre:
        x, y = (a - (a.min() + a.max()) / 2 for a in (x, y))
    hx, hy = surface.half_width
    x, y = (np.where(abs(a) <= h * (1 + ROUNDED), np.clip(a, -h, h), a) for a, h in ((x, hx), (y, hy)))
    on = surface.outline.contains(x, y)
    reach = f"x from {x.min():.4g} to {x.max():.4g} mm and y from {y.min():.4g} to {y.max():.4g} mm"
    if on.mean() < LEAST_INSIDE:
        raise UserError(
            f"the points of {path} reach over {reach}, but the surface only over +-{hx:g} x +-{hy:g} mm: "
            "is the unit right (--unit), and is the origin the vertex of the surface (--centre)?"
        )
    if np.ptp(x[on]) < LEAST_EXTENT * 2 * hx or np.ptp(y[on]) < LEAST_EXTENT * 2 * hy:
        raise UserError(
            f"the points of {path} reach over {reach} only, the surface over +-{hx:g} x +-{hy:g} mm: is the "
            "unit right (--unit)?"
        )
    if frame.kind == "errors":  # they belong to points of the surface alone
        x, y, values = x[on], y[on], values[on]
        values = values + surface(x, y)
        on = on[on]
    most = float(np.median(np.abs(values[on] - surface(x[on], y[on]))))
    if most > FARTHEST * max(surface.half_width):
        raise UserError(
            f"half of the points of {path} lie more than {most:.4g} mm above or below the designed surface: "
            "are its unit (--unit, --height-unit), its orientation (--down, --mirror, --turn), the surface "
            "(--surface) and its origin right? It is the vertex of the surface; `thbcad export` takes that "
            "of the front."
        )
    return MeasuredPoints(np.stack([x, y, values]), missing, int(there.sum() - on.sum()))


def _values(path: str | Path, frame: FileFrame) -> Floats:
    """Return x and y in mm, as the file has them, and heights or errors in mm, (3, n)."""
    data, name = read_bytes(path), str(path)
    if (points := instrument_points(data, name)) is not None:
        return points
    text = text_of(data, name)
    header = grid_header(text)
    if header is None:
        scale = MILLIMETRES[frame.unit]
        scales = [scale, scale, MILLIMETRES[frame.height_unit or frame.unit]]
        return (number_rows(text, name) * scales).T
    nx, ny, dx, dy, flag, *middle = header
    if flag not in range(len(GRID_UNITS)):
        raise UserError(f"the unit flag of {path} must be 0 (mm), 1 (cm), 2 (in) or 3 (m), got {flag:g}")
    heights = grid_rows(text, name, int(nx) * int(ny)).reshape(int(ny), int(nx))
    return GRID_UNITS[int(flag)] * grid_points(heights, (dx, dy), (middle[0], middle[1]))
