"""Views and sections of a lens that is cut to an outline, or has a flange, with a proven error.

What stands inside the flange is not drawn, and edges that are seen behind others at the same position are
left out.
"""

from __future__ import annotations

import numpy as np

from thbcad.checks import Floats
from thbcad.drawings.curves import Curve, Style, spline_chords
from thbcad.drawings.cut_outlines import THINNEST, CutLens, box_of, intervals, ring_of, strips_of
from thbcad.drawings.cut_silhouettes import GraphOverStrips
from thbcad.drawings.views import (
    NAMES,
    SECTION_AXES,
    Piece,
    View,
    of_section,
    scaled,
    turned_graphs,
    view_of_pieces,
)
from thbcad.lens import ALLOWANCE
from thbcad.outlines import Polygon

FLANGE = "flange"


def cut_plan(cut: CutLens, seen_from: str, chord: float) -> View:
    """Return the outline of the lens and that of its flange as seen from "front" or "rear"."""
    mirror = np.array([-1.0 if seen_from == "front" else 1.0, 1.0])
    curves = []
    bounds = []
    for name, shape in ((seen_from, cut.shape), (FLANGE, cut.around)):
        if shape is not None:
            points, bound = ring_of(shape, chord)
            curves.append(Curve(name, points * mirror))
            bounds.append(bound)
    axes = ("-x" if seen_from == "front" else "x", "y")
    return View(f"SEEN FROM THE {seen_from.upper()}", axes, tuple(curves), max(bounds))


def cut_section(cut: CutLens, across: int, chord: float) -> View:
    """Return the section with the plane x (across 0) or y (1) = at, of `CutLens.planes`.

    The curves are front, rear and the edges at both ends of each piece, piece after piece.
    """
    at = cut.planes[across]
    pieces = intervals(cut.shape, across, at)
    rows, bound = _section_lines(cut, across, at, pieces, chord - ALLOWANCE)
    curves = []
    for (front, rear), ends in zip(rows, pieces):
        edges = []
        for end in (0, -1):
            steps = []
            if cut.flange is not None and cut.around is not None:
                (outer,) = intervals(cut.around, across, at)
                inside, beside = ends[end], outer[end]
                low, high = cut.flange.low, cut.flange.high
                steps = [(inside, low), (beside, low), (beside, high), (inside, high)]
            edges.append(np.array([front[end], *steps, rear[end]]))
        lines = zip((*NAMES, "edge", "edge"), (front, rear, *edges))
        curves += [Curve(name, of_section(line, across)) for name, line in lines]
    axis = "xy"[across]
    return View(f"SECTION {axis} = {at:.12g}", SECTION_AXES[across], tuple(curves), bound + ALLOWANCE)


def _section_lines(
    cut: CutLens, across: int, at: float, pieces: list[tuple[float, float]], chord: float
) -> tuple[list[tuple[Floats, Floats]], float]:
    """Return (front, rear) of every piece as points (n, 2) of (y or x, z), and the error of their chords."""
    surfaces = []
    bounds = []
    for _, turned, vertex in turned_graphs(cut.lens, across):
        line = (turned.kv_u.collocation([at]) @ turned.coefficients)[0]
        t, _, bound = spline_chords(turned.kv_v, line, chord)
        bounds.append(bound)
        own = []
        for low, high in pieces:
            low, high = np.clip([low, high], turned.kv_v.start, turned.kv_v.stop)
            inner = np.concatenate([[low], t[(t > low) & (t < high)], [high]])
            own.append(np.column_stack([inner, vertex + turned.kv_v.collocation(inner) @ line]))
        surfaces.append(own)
    return list(zip(*surfaces)), max(bounds)


def cut_side(cut: CutLens, along: int, chord: float) -> View:
    """Return the cut lens as seen along x (0, from -x) or y (1, from -y): the least and the greatest z of
    front and rear, rims, corners and the flange."""
    allowed = chord - ALLOWANCE
    pieces = [*_silhouettes(cut, along, allowed), *_upright(cut, along), *_flange_box(cut, along)]
    return view_of_pieces(pieces, along, chord)


def _silhouettes(cut: CutLens, along: int, chord: float) -> list[Piece]:
    """Return the least and the greatest z of front and rear, and their rims: the near ones, and as hidden
    lines the others."""
    strips = strips_of(cut.shape, along)
    most = max(strip.at(np.array(strip.ends[:1]))[1].shape[1] for strip in strips)
    pieces: list[Piece] = []
    for name, turned, vertex in turned_graphs(cut.lens, along):
        for sign in (1, -1):
            line, bound = GraphOverStrips(scaled(turned, sign), strips, chord).lowest()
            shown = (name == "front") == (sign == 1)
            style = Style.OUTLINE if shown else Style.HIDDEN
            pieces.append((name, line * np.array([1, sign]) + np.array([0, vertex]), style, bound))
        seen = GraphOverStrips(turned, strips, chord)
        for number in range(most):
            for end in (0, 1):
                style = Style.OUTLINE if (number, end) == (0, 0) else Style.HIDDEN
                rims = seen.side(number, end)
                pieces += [(name, line + np.array([0, vertex]), style, bound) for line, bound in rims]
    return pieces


def _upright(cut: CutLens, along: int) -> list[Piece]:
    """Return the upright edges: at both ends, and at the corners of a polygon; of those at one position the
    nearest, hidden where glass stands before it."""
    low, high = (box[1 - along] for box in box_of(cut.shape))
    if isinstance(cut.shape, Polygon):
        corners = np.array(cut.shape.corners)[:, [along, 1 - along]]
        nearest = {v: u for u, v in sorted(corners.tolist(), reverse=True)}
    else:
        flat = cut.shape.corners[along] - cut.shape.half_width[along]  # the near end of sides seen edge-on
        nearest = {float(low): flat, float(high): flat}
    pieces: list[Piece] = []
    for v, u in nearest.items():
        least = (start for start, _ in intervals(cut.shape, 1 - along, v))
        shown = v in (low, high) or u <= min(least) + THINNEST
        graphs = turned_graphs(cut.lens, along)
        heights = [vertex + float(graph(u, v)) for _, graph, vertex in graphs]
        levels = [heights]
        if cut.flange is not None:
            levels = [[heights[0], cut.flange.low], [cut.flange.high, heights[1]]]
        style = Style.OUTLINE if shown else Style.HIDDEN
        pieces += [("edge", np.column_stack([[v, v], ends]), style, 0.0) for ends in levels]
    return pieces


def _flange_box(cut: CutLens, along: int) -> list[Piece]:
    """Return the flange, which is a rectangle from all sides."""
    if cut.flange is None or cut.around is None:
        return []
    low, high = (float(box[1 - along]) for box in box_of(cut.around))
    bottom, top = cut.flange.low, cut.flange.high
    ring = [(low, bottom), (high, bottom), (high, top), (low, top), (low, bottom)]
    return [(FLANGE, np.array(ring), Style.OUTLINE, 0.0)]
