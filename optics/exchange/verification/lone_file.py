"""Checks of a STEP file without the lens that it was written from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple, TypeAlias

import numpy as np

from optics.base.runtime import Check
from optics.exchange.verification.solid_text import TOLERANCE, measure_checks, whole_checks
from optics.exchange.verification.step_checks import differing_numbers
from optics.exchange.verification.step_file import StepFile, optical_form, state_checks
from thbcad.cad.exchange import SolidState, conic_faces, spline_faces, step_shape
from thbcad.checks import Bools, Floats
from thbcad.io import Brep, BrepFace, edge_span
from thbcad.lens import FreeformSurface, require_sound_graphs
from thbcad.outlines import Outline
from thbcad.sags import NOT_BOUNDED, PlacedConic
from thbcad.splines import BSplineSurface, KnotVector

GRID = 1e-10  # of the size of a face: poles farther from their grid than rounding
ON_RIM = 1e-8  # relative; rims are fitted within 1e-9 mm
RIM_POINTS = 33  # of every edge that are compared with an outline
UNITS = {  # of length as STEP files name them: OCCT's names, and their sizes in mm
    "MILLI METRE": ("MM", 1.0),
    "CENTI METRE": ("CM", 10.0),
    "METRE": ("M", 1000.0),
    "MICRO METRE": ("UM", 1e-3),
    "INCH": ("INCH", 25.4),
    "FOOT": ("FT", 304.8),
}
WITHOUT_LENS = (
    "whether the lens is the one that was designed, which `thbcad verify` of its folder says: "
    "a pole moved along z gives another whole lens"
)

Placed: TypeAlias = "tuple[BSplineSurface, BrepFace]"  # a graph z(x, y) and the face on it


class BareChecks(NamedTuple):
    """What can be said of a STEP file by itself.

    checks : of the file.  left_out : sentences on what was not checked, and why.
    """

    checks: list[Check]
    left_out: list[str]


def bare_checks(file: StepFile) -> BareChecks:
    """Return the BareChecks of a STEP file, by its text and by what OCCT reads in it.

    Raises OSError : the file cannot be read.  ValueError : it is not whole, or not one solid.
    """
    unit, size = UNITS.get(file.text.unit.upper(), ("MM", 1.0))
    by_itself = text_checks_of(file.text, size)
    # in the unit of the file, so that its numbers stay as they are
    state = file.state if unit == "MM" else SolidState(step_shape(file.path, unit))
    measures, not_measured = measure_checks(file.text, state)
    # numbers of spline faces, and of planes across z, spheres and patches of conics, by OCCT and by the text
    by_occt = [*spline_faces(state.shape), *conic_faces(state.shape)]
    faces = file.text.faces
    splines = [face.surface for face in faces if face.surface is not None]
    conics = [form for face in faces if isinstance(form := optical_form(file.text, face), PlacedConic)]
    by_text = [*splines, *conics]
    unequal = sum(differing_numbers(read, surface) for read, surface in zip(by_occt, by_text))
    checks = [
        *state_checks(state, "by OCCT"),
        Check("tolerance that faces, edges and vertices need to meet", file.state.tolerance, TOLERANCE, "mm"),
        Check.none_of(
            "text of the file: numbers of surfaces that differ from those that OCCT reads",
            unequal + abs(len(by_occt) - len(by_text)),
        ),
    ]
    return BareChecks(
        [*by_itself.checks, *checks, *measures], [*by_itself.left_out, *not_measured, WITHOUT_LENS]
    )


def unit_note(file: StepFile) -> list[str]:
    """Return a sentence on the unit of length of a STEP file, where that is not the millimetre."""
    unit, size = UNITS.get(file.text.unit.upper(), (file.text.unit, 0.0))
    if unit == "MM":
        return []
    known = f"{size:g} mm" if size else "which is not known here; its numbers are taken as mm"
    name = file.text.unit.lower().replace(" metre", "metre")
    return [f"the unit of length of {file.path} is the {name}, {known}"]


def text_checks_of(solid: Brep, size: float = 1.0) -> BareChecks:
    """Return the part of the BareChecks that reads the text alone.  size : mm, of its unit of length."""
    checks, left_out = whole_checks(solid, size=size)
    nets, surfaces = _net_checks(solid)
    outline = _outline(solid, surfaces)
    if not surfaces:
        left_out.append("folds and crossings of front and rear: they are no graphs over known rectangles")
    elif outline is None:
        left_out.append(
            "crossings of front and rear: the walls are not known to be those over one outline around the "
            "axis; they may be drafted, rounded, cut or patched"
        )
    else:
        with np.errstate(all="ignore"):
            nets += _crossing_checks([graph for graph, _ in surfaces], outline)
    return BareChecks([*checks, *nets], left_out)


def _net_checks(solid: Brep) -> tuple[list[Check], list[Placed]]:
    """Return the Checks of front and rear as graphs z(x, y), and the graphs with their faces, the lower one
    first.

    The poles of a face that is curved in both directions lie on a grid over x and y, equal to the means of
    the knots but for scale (Greville abscissae): the face folds nowhere then.  Faces of which the most poles
    lie beside that grid come from elsewhere, and are left out.  Conics are graphs by themselves, over the
    rectangle of the others where the corners of their faces span none.
    """
    found: list[Placed] = []
    beside: list[int] = []
    conics: list[tuple[PlacedConic, BrepFace]] = []
    for face in solid.faces:
        form = optical_form(solid, face)
        if isinstance(form, BSplineSurface):
            graph, off = _graph(form)
            if 2 * off < form.kv_u.dim * form.kv_v.dim:
                found.append((graph, face))
                beside.append(off)
        elif form is not None:
            conics.append((form, face))
    other = _half_width(found[0][0]) if found else NOT_BOUNDED
    for conic, face in conics:
        over = conic if conic.half_width != NOT_BOUNDED else replace(conic, half_width=other)
        if over.half_width != NOT_BOUNDED:
            found.append((_conic_graph(over), face))
    name = "text of the file: poles of front and rear beside the grid of the others in x and y"
    found.sort(key=lambda pair: float(np.median(pair[0].coefficients)))
    return [Check.none_of(name, sum(beside))] if beside else [], found


def _outline(solid: Brep, surfaces: Sequence[Placed]) -> Outline | None:
    """Return the outline of the rear, None unless it bounds front and rear, in proportion, and has a wall for
    every piece.

    A corner ends where the rim leaves the sides of its rectangle.
    """
    if len(surfaces) != 2 or not all(_centred(graph) for graph, _ in surfaces):
        return None
    half = _half_width(surfaces[1][0])
    if len(solid.faces) == 6:
        return Outline(half)
    ends = abs(_rim_points(solid, surfaces[1][1], 2)) / half
    straight = [ends[ends[:, 1 - k] > 1 - ON_RIM, k].max(initial=0.0) for k in (0, 1)]
    try:
        a, b = (h if share <= ON_RIM else h * (1 - share) for h, share in zip(half, straight))
        outline = Outline(half, (a, b))
        fits = len(solid.faces) == 2 + len(outline.pieces)
    except ValueError:
        return None
    for graph, face in surfaces:
        points = _rim_points(solid, face, RIM_POINTS).T
        fits &= bool((abs(outline.scaled(_half_width(graph)).gauge(*points) - 1) <= ON_RIM).all())
    return outline if fits else None


def _rim_points(solid: Brep, face: BrepFace, count: int) -> Floats:
    """Return points (x, y) of every edge round a face, from end to end, (n, 2)."""
    numbers = {number for loop in face.loops for number, _ in loop}
    spans = ((edge, edge_span(edge)) for edge in solid.edges if edge.number in numbers)
    rows = [edge.points(np.linspace(*span, count))[:, :2] for edge, span in spans if span is not None]
    return np.concatenate([np.empty((0, 2)), *rows])


def _half_width(graph: BSplineSurface) -> tuple[float, float]:
    return graph.kv_u.stop, graph.kv_v.stop


def _conic_graph(conic: PlacedConic) -> BSplineSurface:
    """Return a conic over its rectangle as a graph z(x, y), within 1e-11 mm."""
    graph = FreeformSurface(conic.half_width, conic.conic).graph()
    return BSplineSurface(graph.kv_u, graph.kv_v, conic.vertex + graph.coefficients)


def _graph(surface: BSplineSurface) -> tuple[BSplineSurface, int]:
    """Return a spline as a graph z(x, y), and how many of its poles lie beside the grid of the others."""
    x, y, z = np.moveaxis(surface.coefficients, -1, 0)
    kv_u, across = _axis(surface.kv_u, x)
    kv_v, along = _axis(surface.kv_v, y.T)
    return BSplineSurface(kv_u, kv_v, z), int((across | along.T).sum())


def _axis(kv: KnotVector, positions: Floats) -> tuple[KnotVector, Bools]:
    """Return knots over x, and which poles lie beside their grid; positions are those of the poles, (dim, n).

    The ends of the grid are the medians over the poles there.
    """
    start, stop = np.median(positions[[0, -1]], axis=1).tolist()
    nowhere = kv, np.ones(positions.shape, dtype=bool)
    if not start < stop:
        return nowhere
    try:
        over = kv.rescale(start, stop)
    except ValueError:  # knots so uneven that they fall together
        return nowhere
    return over, abs(positions - over.greville()[:, None]) > GRID * (stop - start)


def _centred(graph: BSplineSurface) -> bool:
    """Return whether the rectangle under a graph lies around x = y = 0."""
    return all(abs(kv.start + kv.stop) <= GRID * (kv.stop - kv.start) for kv in (graph.kv_u, graph.kv_v))


def _crossing_checks(graphs: list[BSplineSurface], outline: Outline) -> list[Check]:
    """Return the Check of the proof that front, rear and edges do not cross each other within an outline."""
    name = "text of the file: no proof that front, rear and edges stay apart"
    degrees = tuple(max(getattr(g, kv).degree for g in graphs) for kv in ("kv_u", "kv_v"))
    front, rear = (graph.elevate(degrees[0], degrees[1]) for graph in graphs)
    try:
        require_sound_graphs(front, rear, outline)
    except ValueError as error:
        return [Check.none_of(f"{name}: {error}", 1)]
    return [Check.none_of(name, 0)]
