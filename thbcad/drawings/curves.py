"""Plane curves of a drawing; splines along lines, and cuts of ruled edges, as chords with a proven error.

Between two points of a curve, h apart, a function with |z''| <= M lies within M h^2 / 8 of its chord.

A plane x = a cuts both surfaces.  With the half-widths h_F and h_R of front and rear along its normal, and
those of the edge from rim to rim at w: h(w) = (1 - w) h_F + w h_R, the cut lies at the relative position
s = a / h(w):

    z(w) = E(s(w), w),    z'' = E_ss s'^2 + 2 E_sw s' + E_s s'',    E_ww = 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from thbcad.certified import cell_bounds
from thbcad.checks import Floats, read_only
from thbcad.lens import SIDES, Lens, placed_surfaces, ruled_edge, subdivided
from thbcad.splines import UNIT, BSplineSurface, KnotVector
from thbcad.values import Value

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
class Curve(Value):
    """A line through points (n, 2), mm, to the right and upwards in a view.

    name : what it is a line of, such as "rear".  style : Style.
    """

    name: str
    points: Floats
    style: Style = Style.OUTLINE

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", read_only(self.points))


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


def edge_cut(lens: Lens, across: int, at: float, end: int, chord: float) -> tuple[Floats, float]:
    """Return the cut of one edge by x = at (across 0) or y = at (across 1), and the proven error of its
    chords in z: points (n, 2) of (y or x, z) from front to rear.

    end : 0 the edge at low y or x, -1 the one at high.

    Raises
    ------
    ValueError : more than 200,000 chords.
    """
    side = next(s for s in SIDES if s.axis == across and s.end == end)
    net = ruled_edge(placed_surfaces(lens), side)
    edge = BSplineSurface(net.kv_u, net.kv_v, net.coefficients[..., 2])
    half = np.array([surface.half_width[across] for surface in (lens.front, lens.rear)])
    other = np.array([surface.half_width[1 - across] for surface in (lens.front, lens.rear)])
    w = np.array([0.0, 1.0])
    bend = 0.0
    if at and half[0] != half[1]:
        bend = _bend(edge, at, half)
        inner = (at * edge.kv_u.stop / edge.kv_u.breaks[edge.kv_u.breaks != 0] - half[0]) / np.diff(half)
        w = np.unique(np.concatenate([w, inner[(inner > 0) & (inner < 1)]]))
    parts = np.maximum(np.ceil(np.diff(w) * np.sqrt(bend / (8 * chord))), 1)
    if parts.sum() > MOST_CHORDS:
        raise ValueError(f"a chord error of {chord:g} mm needs more than {MOST_CHORDS:,} chords of an edge")
    bound = float((np.diff(w) / parts).max() ** 2 * bend / 8)
    w = subdivided(w, parts.astype(np.int64))
    s = np.clip(at / ((1 - w) * half[0] + w * half[1]), -1, 1) * edge.kv_u.stop
    position = (-1 if end == 0 else 1) * ((1 - w) * other[0] + w * other[1])
    return np.column_stack([position, edge(s, w)]), bound


def _bend(edge: BSplineSurface, at: float, half: Floats) -> float:
    """Return a bound of |z''(w)|."""
    ss, sw, s = cell_bounds(edge, ((2, 0), (1, 1), (1, 0))).max(axis=(1, 2))
    size, change, least = abs(at) * edge.kv_u.stop, abs(half[1] - half[0]), half.min()
    first, second = size * change / least**2, 2 * size * change**2 / least**3
    return float(ss * first**2 + 2 * sw * first + s * second)
