"""Views and sections of a lens as plane curves, mm, with a proven error.

Seen from the front, x runs to the left; from the rear, to the right.  Seen from -x, light runs to the right;
seen from -y, downwards and x to the left, as third-angle projection wants it below the front.  In a section
y = at it runs upwards and x to the right, as below the rear.
"""

import numpy as np

from thbcad.checks import require_number
from thbcad.drawings.curves import (
    AXES,
    NAMES,
    SECTION_AXES,
    Curve,
    Piece,
    Style,
    View,
    edge_cut,
    of_section,
    scaled,
    spline_chords,
    turned_graphs,
    view_of_pieces,
)
from thbcad.drawings.cut_outlines import cut_lens
from thbcad.drawings.cut_views import cut_plan, cut_section, cut_side
from thbcad.drawings.envelopes import lowest_outline
from thbcad.lens import ALLOWANCE, LEAST_CHORD, SIDES, Lens, placed_surfaces, require_sound, rim, ruled_edge
from thbcad.splines import BSplineSurface


def plan_view(lens: Lens, seen_from: str, chord: float = 1e-3) -> View:
    """Return the rims as seen from the front or from the rear; a rectangular lens has straight lines only and
    no error.

    seen_from : "front" or "rear".  The rim of the other surface is hidden along the sides on which the edge
        faces away.
    chord : mm, the error that its curves may have.

    Raises ValueError : another direction; a chord below 1e-8 mm; as `require_sound`.
    """
    if seen_from not in NAMES:
        raise ValueError(f"seen_from must be 'front' or 'rear', got {seen_from!r}")
    require_number("chord", chord, least=LEAST_CHORD, finite=True)
    cut = cut_lens(require_sound(lens), None, None, None)
    if cut is not None:
        return cut_plan(cut, seen_from, chord)
    near, far = (lens.front, lens.rear) if seen_from == "front" else (lens.rear, lens.front)
    other = NAMES[1 - NAMES.index(seen_from)]
    mirror = np.array([-1.0 if seen_from == "front" else 1.0, 1.0])
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1)]) * mirror
    inner, outer = (corners * surface.half_width for surface in (near, far))
    curves = [Curve(seen_from, inner)]
    faces_viewer = [b >= a for a, b in zip(near.half_width, far.half_width)]  # edges at high x, at high y
    for k in range(4) if near.half_width != far.half_width else ():
        shown = faces_viewer[1 if k % 2 == 0 else 0]
        curves.append(Curve(other, outer[k : k + 2], Style.OUTLINE if shown else Style.HIDDEN))
        shown = any(a < b for a, b in zip(near.half_width, far.half_width))
        strut = np.stack([inner[k], outer[k]])
        curves.append(Curve("edge", strut, Style.OUTLINE if shown else Style.HIDDEN))
    axes = ("-x" if seen_from == "front" else "x", "y")
    return View(f"SEEN FROM THE {seen_from.upper()}", axes, tuple(curves), 0.0)


def section_view(lens: Lens, axis: str, at: float = 0.0, chord: float = 1e-3) -> View:
    """Return the section of the lens with the plane x = at or y = at.

    axis : "x" or "y".  chord : mm, the error that its curves may have, in z.

    Raises ValueError : another axis; a plane that does not cut both surfaces; a chord below 1e-8 mm; as
        `require_sound`; more than 200,000 chords.
    """
    across = _axis_number(axis)
    require_number("chord", chord, least=LEAST_CHORD, finite=True)
    require_number("at", at, finite=True)
    reach = min(surface.half_width[across] for surface in (require_sound(lens).front, lens.rear))
    if abs(at) >= reach:
        raise ValueError(
            f"the plane {axis} = {at:g} mm must cut front and rear: choose {axis} between {-reach:g} and "
            f"{reach:g} mm"
        )
    cut = cut_lens(lens, None, None, None)
    if cut is not None:
        return cut_section(cut, across, at, chord)
    bounds = []
    lines = []
    for _, graph, vertex in turned_graphs(lens, across):
        line = (graph.kv_u.collocation([at]) @ graph.coefficients)[0]
        t, z, bound = spline_chords(graph.kv_v, line, chord - ALLOWANCE)
        lines.append(np.column_stack([t, vertex + z]))
        bounds.append(bound)
    for end in (0, -1):
        line, bound = edge_cut(lens, across, at, end, chord - ALLOWANCE)
        lines.append(line)
        bounds.append(bound)
    names = (*NAMES, "edge", "edge")
    curves = tuple(Curve(name, of_section(line, across)) for name, line in zip(names, lines))
    return View(f"SECTION {axis} = {at:g}", SECTION_AXES[across], curves, max(bounds) + ALLOWANCE)


def side_view(lens: Lens, axis: str, chord: float = 1e-3) -> View:
    """Return the lens as seen along x (from -x) or along y (from -y, -x to the right, the front at the top):
    outlines, and rims.

    Outlines are the least and the greatest z of front, rear and slanted edges at every y, or x.  The far rim,
    and outlines behind glass, are hidden lines.  Folds within the outline are left out.

    axis : "x" or "y".  chord : mm, the error that its curves may have, in z.

    Raises ValueError : another axis; a chord below 1e-8 mm; as `require_sound`; more than 200,000 chords.
    """
    along = _axis_number(axis)
    require_number("chord", chord, least=LEAST_CHORD, finite=True)
    cut = cut_lens(require_sound(lens), None, None, None)
    if cut is not None:
        return cut_side(cut, along, chord)
    allowed = chord - ALLOWANCE
    pieces = [
        *_outlines(lens, along, allowed),
        *_edge_outlines(lens, along, allowed),
        *_rims(lens, along, allowed),
    ]
    return view_of_pieces(pieces, along, chord)


def _outlines(lens: Lens, along: int, chord: float) -> list[Piece]:
    """Return the least and the greatest z of front and rear; inside the glass they are hidden."""
    pieces = []
    for name, graph, vertex in turned_graphs(lens, along):
        for sign in (1, -1):
            v, z, bound = lowest_outline(scaled(graph, sign), chord)
            line = np.column_stack([v, vertex + sign * z])
            shown = (name == "front") == (sign == 1)
            pieces.append((name, line, Style.OUTLINE if shown else Style.HIDDEN, bound))
    return pieces


def _edge_outlines(lens: Lens, along: int, chord: float) -> list[Piece]:
    """Return the outer outlines of the two edges that are seen edge-on: of planes a line, of slanted ones as
    of graphs over the rim and from rim to rim, and the lines in which both rims appear."""
    pieces = []
    surfaces = placed_surfaces(lens)
    across = 1 - along
    widths = [surface.half_width[across] for surface in (lens.front, lens.rear)]
    for side in (s for s in SIDES if s.axis == along):
        sign = 1 if side.end else -1
        net = ruled_edge(surfaces, side)
        edge = BSplineSurface(net.kv_u, net.kv_v, net.coefficients[..., 2])
        low = lowest_outline(edge, chord)
        high = lowest_outline(scaled(edge, -1), chord)
        least, greatest, bound = low[1], -high[1], max(low[2], high[2])
        if widths[0] == widths[1]:
            line = np.column_stack([np.full(2, sign * widths[0]), [least[0], greatest[-1]]])
            pieces.append(("edge", line, Style.OUTLINE, bound))
            continue
        (v, _, own), z = (low, least) if widths[0] < widths[1] else (high, greatest)
        position = sign * ((1 - v) * widths[0] + v * widths[1])
        pieces.append(("edge", np.column_stack([position, z]), Style.OUTLINE, own))
        for k, width in enumerate(widths):  # both rims are seen edge-on too, the narrower through the glass
            line = np.array([[sign * width, least[-k]], [sign * width, greatest[-k]]])
            pieces.append(("edge", line, Style.OUTLINE if width == max(widths) else Style.HIDDEN, bound))
    return pieces


def _rims(lens: Lens, along: int, chord: float) -> list[Piece]:
    """Return the rims on the near side, and as hidden lines those on the far side that differ from them, with
    the corner edges between them."""
    pieces: list[Piece] = []
    surfaces = placed_surfaces(lens)
    near, far = (next(s for s in SIDES if s.axis != along and s.end == end) for end in (0, -1))
    for name, surface in zip(NAMES, surfaces):
        half = getattr(lens, name).half_width[1 - along]
        nets = [rim(surface, side) for side in (near, far)]
        for (kv, poles), style in zip(nets, (Style.OUTLINE, Style.HIDDEN)):
            if style is Style.HIDDEN and np.array_equal(poles[:, 2], nets[0][1][:, 2]):
                continue
            t, z, bound = spline_chords(kv, poles[:, 2], chord)
            pieces.append((name, np.column_stack([t * (half / kv.stop), z]), style, bound))
    if lens.front.half_width[1 - along] != lens.rear.half_width[1 - along]:
        for side, style in ((near, Style.OUTLINE), (far, Style.HIDDEN)):
            for corner in (side.start, side.stop):
                ends = np.array([s.coefficients[corner] for s in surfaces])
                pieces.append(("edge", ends[:, [1 - along, 2]], style, 0.0))
    return pieces


def _axis_number(axis: str) -> int:
    if axis not in AXES:
        raise ValueError(f"axis must be 'x' or 'y', got {axis!r}")
    return AXES.index(axis)
