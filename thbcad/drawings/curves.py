"""Plane curves of a drawing, views of them, and splines along lines and cuts of ruled edges as chords with a
proven error.

Between two points of a curve, h apart, a function with |z''| <= M lies within M h^2 / 8 of its chord.

A plane x = a cuts both surfaces.  With the half-widths h_F and h_R of front and rear along its normal, and
those of the edge from rim to rim at w: h(w) = (1 - w) h_F + w h_R, the cut lies at the relative position
s = a / h(w):

    z(w) = E(s(w), w),    z'' = E_ss s'^2 + 2 E_sw s' + E_s s'',    E_ww = 0.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise

import numpy as np

from thbcad.certified import cell_bounds
from thbcad.checks import Floats, read_only
from thbcad.lens import ALLOWANCE, SIDES, Lens, placed_surfaces, ruled_edge, subdivided
from thbcad.splines import UNIT, BSplineSurface, KnotVector
from thbcad.values import Value

MOST_CHORDS = 200_000
NAMES = ("front", "rear")
AXES = ("x", "y")
SECTION_AXES = (("z", "y"), ("x", "z"))  # to the right and upwards, across x and across y
SIDE_AXES = (("z", "y"), ("-x", "-z"))  # seen from -x and from -y


class Style(StrEnum):
    """How a line is drawn, by what it means; the names are those of the layers of a DXF file."""

    OUTLINE = "OUTLINE"
    HIDDEN = "HIDDEN"
    CENTRE = "CENTRE"
    HATCH = "HATCH"
    DIMENSION = "DIMENSION"
    FRAME = "FRAME"


Piece = tuple[str, Floats, Style, float]  # name, points (y or x, z), style, proven error


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


@dataclass(frozen=True, eq=False)
class View:
    """Curves in one plane.

    title : such as "SECTION x = 0"
    axes : the axes of the lens to the right and upwards, such as ("z", "y"); "-x" is x to the left
    curves : Curve, mm
    bound : float, mm; no point of a curve is farther from the exact one
    """

    title: str
    axes: tuple[str, str]
    curves: tuple[Curve, ...]
    bound: float

    def box(self) -> Floats:
        """Return the corners ((left, low), (right, high)) of the curves, (2, 2), mm."""
        points = np.concatenate([curve.points for curve in self.curves])
        return np.array([points.min(axis=0), points.max(axis=0)])


def spline_chords(kv: KnotVector, coefficients: Floats, chord: float) -> tuple[Floats, Floats, float]:
    """Return parameters (n,), values (n,) and the proven error of the chords of a scalar spline.

    chord : the error that they may have.
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


def outline_cut(lens: Lens, across: int, at: float, end: int, chord: float) -> tuple[Floats, float]:
    """Return the cut of the wall of a lens with an outline, as `edge_cut`, and the error of its chords in any
    direction.

    Over t, the position itself on a straight side and the angle on a corner, the cut passes through the
    relative positions (S, Y)(t) of both rims at

        w(t) = (at / S - h_F) / (h_R - h_F),

    and bounds of the derivatives of S, Y, w and of the heights of both rims give that of the cut.
    """
    (h, other), sign = _both(lens, across), 1 if end else -1
    c, d = (lens.rear.outline.relative_corners[k] for k in (across, 1 - across))
    first, last = abs(at) / h
    ends = np.array([first, last])
    if first != last and min(ends) < 1 - c < max(ends):
        ends = np.array([first, 1 - c, last])
    lines, bound = [], 0.0
    for start, stop in pairwise(ends.tolist()):
        round_ = max(start, stop) > 1 - c
        t = np.array([start, stop])
        if round_:
            t = np.arcsin(np.clip((t - (1 - c)) / c, 0.0, 1.0))
        speeds = (c, c, d, d) if round_ else (1.0, 0.0, 0.0, 0.0)
        bend = _cut_bend(lens, across, at, min(start, stop), speeds) if first != last else 0.0
        parts = max(float(np.ceil(abs(t[1] - t[0]) * np.sqrt(bend / (8 * chord)))), 1.0)
        if parts > MOST_CHORDS:
            raise ValueError(
                f"a chord error of {chord:g} mm needs more than {MOST_CHORDS:,} chords of a wall"
            )
        bound = max(bound, float((t[1] - t[0]) ** 2 / parts**2 * bend / 8))
        t = np.linspace(t[0], t[1], int(parts) + 1)
        s, y = (1 - c + c * np.sin(t), 1 - d + d * np.cos(t)) if round_ else (t, np.ones(len(t)))
        w = (abs(at) / s - h[0]) / (h[1] - h[0]) if first != last else np.array([0.0, 1.0])
        heights = [
            vertex + graph(np.copysign(s * a, at), sign * y * b)
            for (_, graph, vertex), a, b in zip(turned_graphs(lens, across), h, other)
        ]
        place = sign * y * ((1 - w) * other[0] + w * other[1])
        lines.append(np.column_stack([place, (1 - w) * heights[0] + w * heights[1]]))
    return np.concatenate(lines), bound


def _both(lens: Lens, across: int) -> tuple[Floats, Floats]:
    """Return the half-widths of front and rear along an axis and beside it, (2,) each, mm."""
    half = np.array([lens.front.half_width, lens.rear.half_width])
    return half[:, across], half[:, 1 - across]


def _cut_bend(lens: Lens, across: int, at: float, least: float, speeds: tuple[float, ...]) -> float:
    """Return a bound of the second derivative of `outline_cut` over t.

    least : of S.  speeds : bounds of |S'|, |S''|, |Y'| and |Y''|
    """
    (h, other), (s1, s2, y1, y2) = _both(lens, across), speeds
    change = abs(at) / least**2 / abs(h[1] - h[0])
    w1, w2 = change * s1, change * (2 * s1**2 / least + s2)
    size, slope, bend = lens.thickness, 0.0, 0.0
    for (_, graph, _), a, b in zip(turned_graphs(lens, across), h, other):
        u, v, uu, uv, vv = cell_bounds(graph, ((1, 0), (0, 1), (2, 0), (1, 1), (0, 2))).max(axis=(1, 2))
        size += float(abs(graph.coefficients).max())
        slope += u * a * s1 + v * b * y1
        own = uu * (a * s1) ** 2 + 2 * uv * a * s1 * b * y1 + vv * (b * y1) ** 2
        bend = max(bend, own + u * a * s2 + v * b * y2)
    beside = abs(other[1] - other[0])
    place = w2 * beside + 2 * w1 * beside * y1 + other.max() * y2
    return float(place + w2 * size + 2 * w1 * slope + bend)


def view_of_pieces(pieces: list[Piece], along: int, chord: float) -> View:
    """Return a lens as seen along x (0) or y (1): outlines first, and none of the pieces that one before them
    covers within twice the chord."""
    kept: list[Piece] = []
    for piece in sorted(pieces, key=lambda item: item[2] is Style.HIDDEN):
        if not any(piece[0] == other[0] and _covers(other[1], piece[1], 2 * chord) for other in kept):
            kept.append(piece)
    # seen from -y, z runs downwards and x to the left
    lines = [(name, line[:, ::-1] if along == 0 else 0.0 - line, style) for name, line, style, _ in kept]
    bound = max(piece[3] for piece in pieces) + ALLOWANCE
    return View(f"SEEN FROM -{AXES[along]}", SIDE_AXES[along], tuple(Curve(*line) for line in lines), bound)


def _covers(line: Floats, other: Floats, tolerance: float) -> bool:
    """Return whether a line over y or x ends where the other does, and is nowhere farther from it in z."""
    if line[0, 0] >= line[-1, 0] or (line[[0, -1], 0] != other[[0, -1], 0]).any():
        return False
    everywhere = np.concatenate([line[:, 0], other[:, 0]])
    gap = np.interp(everywhere, *line.T) - np.interp(everywhere, *other.T)
    return bool(abs(gap).max() <= tolerance)


def of_section(line: Floats, across: int) -> Floats:
    """Return points (y, z) or (x, z) along the axes of a section across x (0) or y (1)."""
    return line[:, ::-1] if across == 0 else line


def turned_graphs(lens: Lens, axis: int) -> Iterator[tuple[str, BSplineSurface, float]]:
    """Yield name, graph and z of the vertex of front and rear; the first parameter of the graphs is x (0) or
    y (1)."""
    for name, graph, vertex in zip(NAMES, lens.graphs(), (0.0, lens.thickness)):
        if axis == 1:
            graph = BSplineSurface(graph.kv_v, graph.kv_u, graph.coefficients.T)
        yield name, graph, vertex


def scaled(graph: BSplineSurface, factor: float) -> BSplineSurface:
    """Return a graph with other heights."""
    return BSplineSurface(graph.kv_u, graph.kv_v, factor * graph.coefficients)
