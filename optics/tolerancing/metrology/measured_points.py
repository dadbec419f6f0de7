"""Measured points of a surface, in the surface's own frame.

The frame has its origin in the vertex of the surface, +z along the light, x and y as the lens has them, mm.
What a file holds is brought there in this order: units, mirrored x, rotation about z, the middle, heights
turned over.  The text has rows of numbers, with headers, comments, separators and missing values.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

import numpy as np

from optics.base.runtime import UserError, read_at_most
from optics.tolerancing.metrology.instrument_files import (
    MILLIMETRES,
    MOST_BYTES,
    grid_points,
    instrument_points,
)
from optics.tolerancing.metrology.measured_text import grid_header, grid_rows, number_rows
from thbcad.checks import Floats
from thbcad.lens import FreeformSurface
from thbcad.texts import LATIN, text_of

Unit = Literal["m", "mm", "um", "nm"]
Kind = Literal["heights", "errors"]
GRID_UNITS = (1.0, 10.0, 25.4, 1000.0)  # mm, of the unit flag of a grid sag file
TURNS = (0, 90, 180, 270)
LEAST_POINTS = 100  # fewer say nothing of a freeform surface
LEAST_INSIDE = 0.5  # of the points lie on the surface, else the frame or the unit is another one
ROUNDED = 1e-12  # of the half-width: points so far beside the rim lie on it
LEAST_EXTENT = 0.02  # of the surface's width
FARTHEST = 0.1  # of the greater half-width: no lens is so far from its design


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
    name, data = str(path), read_at_most(path, MOST_BYTES, pipes=True)
    if not data.strip():
        raise UserError(f"{name} is empty")
    if (points := instrument_points(data, name)) is not None:
        return points
    try:
        text = text_of(data, LATIN)
    except ValueError as error:
        raise UserError(
            f"{name} is no text: {error}; a measurement is rows x y z, or an X3P, Zygo or GXYZF file"
        ) from None
    header = grid_header(text, name)
    if header is None:
        scale = MILLIMETRES[frame.unit]
        scales = [scale, scale, MILLIMETRES[frame.height_unit or frame.unit]]
        return (number_rows(text, name) * scales).T
    nx, ny, dx, dy, flag, *middle = header
    if flag not in range(len(GRID_UNITS)):
        raise UserError(f"the unit flag of {path} must be 0 (mm), 1 (cm), 2 (in) or 3 (m), got {flag:g}")
    heights = grid_rows(text, name, int(nx) * int(ny)).reshape(int(ny), int(nx))
    return GRID_UNITS[int(flag)] * grid_points(heights, (dx, dy), (middle[0], middle[1]))
