"""Plane curves of a drawing, and a spline along a line as chords with a proven error.

Between two points of a curve, h apart, a function with |z''| <= M lies within M h^2 / 8 of its chord.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from thbcad.certified import cell_bounds
from thbcad.checks import Floats, read_only, rebuilt
from thbcad.lens import subdivided
from thbcad.splines import UNIT, BSplineSurface, KnotVector

MOST_CHORDS = 200_000


class Style(StrEnum):
    """How a line is drawn, by what it means; the names are those of the layers of a DXF file."""

    OUTLINE = "OUTLINE"
    HIDDEN = "HIDDEN"
    CENTRE = "CENTRE"
    HATCH = "HATCH"
    DIMENSION = "DIMENSION"
    FRAME = "FRAME"


@dataclass(frozen=True, eq=False)
class Curve:
    """A line through points (n, 2), mm, to the right and upwards in a view.

    name : what it is a line of, such as "rear".  style : Style.
    """

    name: str
    points: Floats
    style: Style = Style.OUTLINE

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", read_only(self.points))

    __reduce__ = rebuilt


def spline_chords(kv: KnotVector, coefficients: Floats, chord: float) -> tuple[Floats, Floats, float]:
    """Return parameters (n,), values (n,) and the proven error of the chords of a scalar spline.

    chord : the error that they may have.

    Raises
    ------
    ValueError : more than 200,000 chords.
    """
    constant_in_v = BSplineSurface(kv, UNIT, np.stack([coefficients, coefficients], axis=1))
    bend = cell_bounds(constant_in_v, ((2, 0),))[0, :, 0]
    width = np.diff(kv.breaks)
    parts = np.maximum(np.ceil(width * np.sqrt(bend / (8 * chord))), 1)
    if parts.sum() > MOST_CHORDS:
        raise ValueError(
            f"a chord error of {chord:g} mm needs more than {MOST_CHORDS:,} chords of a section; "
            "allow a greater one"
        )
    t = subdivided(kv.breaks, parts.astype(np.int64))
    return t, kv.collocation(t) @ coefficients, float(((width / parts) ** 2 * bend).max()) / 8
