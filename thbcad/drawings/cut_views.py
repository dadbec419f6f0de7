"""Views and sections of a lens that is cut to an outline, or has a flange, with a proven error.

What stands inside the flange is not drawn, and edges that are seen behind others at the same position are
left out.
"""

import numpy as np

from thbcad.checks import Floats
from thbcad.drawings.curves import (
    NAMES,
    SECTION_AXES,
    Curve,
    Piece,
    Style,
    View,
    of_section,
    outline_cut,
    scaled,
    spline_chords,
    turned_graphs,
    view_of_pieces,
)
from thbcad.drawings.cut_outlines import THINNEST, CutLens, box_of, intervals, ring_of, strips_of
from thbcad.drawings.envelopes import GraphOverStrips
from thbcad.lens import ALLOWANCE, Lens
from thbcad.outlines import Polygon

FLANGE = "flange"


def cut_plan(cut: CutLens, seen_from: str, chord: float) -> View:
    """Return the outline of the lens and that of its flange as seen from "front" or "rear"; of slanted walls
    both rims, the far one hidden where it is the narrower."""
    mirror = np.array([-1.0 if seen_from == "front" else 1.0, 1.0])
    curves = []
    bounds = []
    for name, shape in ((seen_from, cut.shapes[NAMES.index(seen_from)]), (FLANGE, cut.around)):
        if shape is not None:
            points, bound = ring_of(shape, chord)
            curves.append(Curve(name, points * mirror))
            bounds.append(bound)
    if cut.slanted:
        far = 1 - NAMES.index(seen_from)
        points, bound = ring_of(cut.shapes[far], chord)
        beside = ~(cut.lens.rear, cut.lens.front)[far].outline.contains(*points.T)
        turns = np.flatnonzero(np.diff(beside)) + 1
        for part in np.split(np.arange(len(points)), turns):
            style = Style.OUTLINE if beside[part[0]] else Style.HIDDEN
            curves.append(Curve(NAMES[far], points[part[0] : part[-1] + 2] * mirror, style))
        bounds.append(bound)
    axes = ("-x" if seen_from == "front" else "x", "y")
    return View(f"SEEN FROM THE {seen_from.upper()}", axes, tuple(curves), max(bounds))


def cut_section(cut: CutLens, across: int, at: float, chord: float) -> View:
    """Return the section with the plane x (across 0) or y (1) = at.

    The curves are front, rear and the edges at both ends of each piece, piece after piece.
    """
    ends_of = [intervals(shape, across, at) for shape in cut.shapes]
    rows, bound = _section_lines(cut, across, at, ends_of, chord - ALLOWANCE)
    curves = []
    for (front, rear), ends in zip(rows, ends_of[1]):
        edges = []
        for end in (0, -1):
            steps = []
            if cut.flange is not None and cut.around is not None:
                (outer,) = intervals(cut.around, across, at)
                inside, beside = ends[end], outer[end]
                low, high = cut.flange.low, cut.flange.high
                steps = [(inside, low), (beside, low), (beside, high), (inside, high)]
            if cut.slanted:
                wall, own = outline_cut(cut.lens, across, at, end, chord - ALLOWANCE)
                steps, bound = wall[1:-1].tolist(), max(bound, own)
            edges.append(np.array([front[end], *steps, rear[end]]))
        lines = zip((*NAMES, "edge", "edge"), (front, rear, *edges))
        curves += [Curve(name, of_section(line, across)) for name, line in lines]
    axis = "xy"[across]
    return View(f"SECTION {axis} = {at:.12g}", SECTION_AXES[across], tuple(curves), bound + ALLOWANCE)


def _section_lines(
    cut: CutLens, across: int, at: float, pieces: list[list[tuple[float, float]]], chord: float
) -> tuple[list[tuple[Floats, Floats]], float]:
    """Return (front, rear) of every piece as points (n, 2) of (y or x, z), and the error of their chords.

    pieces : those of front and of rear
    """
    surfaces = []
    bounds = []
    for (_, turned, vertex), inside in zip(turned_graphs(cut.lens, across), pieces):
        line = (turned.kv_u.collocation([at]) @ turned.coefficients)[0]
        t, _, bound = spline_chords(turned.kv_v, line, chord)
        bounds.append(bound)
        own = []
        for low, high in inside:
            low, high = np.clip([low, high], turned.kv_v.start, turned.kv_v.stop)
            inner = np.concatenate([[low], t[(t > low) & (t < high)], [high]])
            own.append(np.column_stack([inner, vertex + turned.kv_v.collocation(inner) @ line]))
        surfaces.append(own)
    return list(zip(*surfaces)), max(bounds)


def cut_side(cut: CutLens, along: int, chord: float) -> View:
    """Return the cut lens as seen along x (0, from -x) or y (1, from -y): the least and the greatest z of
    front and rear, rims, corners and the flange; of slanted walls the rulings that reach farthest."""
    allowed = chord - ALLOWANCE
    edges = _slanted(cut.lens, along) if cut.slanted else _upright(cut, along)
    pieces = [*_silhouettes(cut, along, allowed), *edges, *_flange_box(cut, along)]
    return view_of_pieces(pieces, along, chord)


def _silhouettes(cut: CutLens, along: int, chord: float) -> list[Piece]:
    """Return the least and the greatest z of front and rear, and their rims: the near ones, and as hidden
    lines the others."""
    pieces: list[Piece] = []
    for (name, turned, vertex), shape in zip(turned_graphs(cut.lens, along), cut.shapes):
        strips = strips_of(shape, along)
        most = max(strip.at(np.array(strip.ends[:1]))[1].shape[1] for strip in strips)
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


def _slanted(lens: Lens, along: int) -> list[Piece]:
    """Return the rulings of slanted walls that reach farthest in v, those at both ends of straight sides."""
    pieces: list[Piece] = []
    for side in (-1, 1):
        for end in (-1, 1):
            line = []
            for (_, graph, vertex), surface in zip(turned_graphs(lens, along), (lens.front, lens.rear)):
                flat = surface.half_width[along] - surface.outline.corners[along]
                v = side * surface.half_width[1 - along]
                line.append((v, vertex + float(graph(end * flat, v))))
            pieces.append(("edge", np.array(line), Style.OUTLINE if end < 0 else Style.HIDDEN, 0.0))
    return pieces


def _flange_box(cut: CutLens, along: int) -> list[Piece]:
    """Return the flange, which is a rectangle from all sides."""
    if cut.flange is None or cut.around is None:
        return []
    low, high = (float(box[1 - along]) for box in box_of(cut.around))
    bottom, top = cut.flange.low, cut.flange.high
    ring = [(low, bottom), (high, bottom), (high, top), (low, top), (low, bottom)]
    return [(FLANGE, np.array(ring), Style.OUTLINE, 0.0)]
