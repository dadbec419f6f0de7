"""Damage to a STEP file at a known place: one control point of its largest spline surface is moved."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

from thbcad.io import Entity, Value, having, points_of, read_part21

SPLINE = "B_SPLINE_SURFACE_WITH_KNOTS"
NET, PARAMETERS = 3, 13  # place of the net of control points among the parameters of a spline surface


class Damage(NamedTuple):
    """A control point that was moved along z.

    entity : its number in the file.  row, column : its place in the net.  before, after : z in mm.
    """

    entity: int
    row: int
    column: int
    before: float
    after: float


def move_control_point(path: Path, distance: float) -> Damage:
    """Move the middle control point of the largest spline surface of a STEP file along z, and write the file.

    distance : mm

    Raises OSError : the file cannot be read or written.
    Raises ValueError : it is no STEP file, or has no spline surface without weights.
    """
    entities = read_part21(path)
    nets = [(_net(entity), entity) for entity in having(entities, SPLINE) if len(entity.parts) == 1]
    if not nets:
        raise ValueError(f"{path} has no spline surface whose control points can be moved")
    net, spline = max(nets, key=lambda found: len(found[0]) * len(found[0][0]))
    row, column = len(net) // 2, len(net[0]) // 2
    point = net[row][column]
    ((x, y, z),) = points_of(entities, [point], spline).tolist()
    moved = f"#{point}=CARTESIAN_POINT('',({_real(x)},{_real(y)},{_real(z + distance)}));"
    text = path.read_bytes().decode("latin-1")
    changed, count = re.subn(rf"#{point}\s*=\s*CARTESIAN_POINT\b[^;]*;", moved, text)
    if count != 1:
        raise ValueError(f"{path} states the control point #{point} {count} times, expected once")
    path.write_bytes(changed.encode("latin-1"))
    return Damage(int(str(point)), row, column, z, z + distance)


def _net(spline: Entity) -> list[list[Value]]:
    """Return the references to the control points of a spline surface, row by row."""
    rows = spline.parameters(SPLINE, PARAMETERS)[NET]
    assert isinstance(rows, list)
    return [row for row in rows if isinstance(row, list)]


def _real(number: float) -> str:
    """Return a number as STEP files write it: with all digits, and always with a point."""
    mantissa, exponent, power = repr(number).upper().partition("E")
    return (mantissa if "." in mantissa else f"{mantissa}.") + exponent + power
