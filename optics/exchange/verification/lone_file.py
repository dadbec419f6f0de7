"""Checks of a STEP file without the lens that it was written from."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from optics.base.runtime import Check
from optics.exchange.verification.solid_text import TOLERANCE, measure_checks, whole_checks
from optics.exchange.verification.step_checks import differing_numbers
from optics.exchange.verification.step_file import StepFile, optical_form, state_checks
from thbcad.cad.exchange import conic_faces, spline_faces
from thbcad.io import Brep
from thbcad.lens import FreeformSurface, require_sound_graphs
from thbcad.sags import NOT_BOUNDED, PlacedConic
from thbcad.splines import BSplineSurface, KnotVector

GRID = 1e-10  # of the size of a face: poles farther from their grid than rounding
WITHOUT_LENS = (
    "whether the lens is the one that was designed, which `thbcad verify` of its folder says: "
    "a pole moved along z gives another whole lens"
)


class BareChecks(NamedTuple):
    """What can be said of a STEP file by itself.

    checks : of the file.  left_out : sentences on what was not checked, and why.
    """

    checks: list[Check]
    left_out: list[str]


def bare_checks(file: StepFile) -> BareChecks:
    """Return the BareChecks of a STEP file, by its text and by what OCCT reads in it.

    Raises
    ------
    OSError : the file cannot be read.  ValueError : it is not whole, or not one solid.
    """
    by_itself = text_checks_of(file.text)
    state = file.state
    measures, not_measured = measure_checks(file.text, state)
    # numbers of spline faces, and of planes across z, spheres and patches of conics, by OCCT and by the text
    by_occt = [*spline_faces(file.state.shape), *conic_faces(file.state.shape)]
    faces = file.text.faces
    splines = [face.surface for face in faces if face.surface is not None]
    conics = [form for face in faces if isinstance(form := optical_form(file.text, face), PlacedConic)]
    by_text = [*splines, *conics]
    unequal = sum(differing_numbers(read, surface) for read, surface in zip(by_occt, by_text))
    checks = [
        *state_checks(state, "by OCCT"),
        Check("tolerance that faces, edges and vertices need to meet", state.tolerance, TOLERANCE, "mm"),
        Check.none_of(
            "text of the file: numbers of surfaces that differ from those that OCCT reads",
            unequal + abs(len(by_occt) - len(by_text)),
        ),
    ]
    return BareChecks(
        [*by_itself.checks, *checks, *measures], [*by_itself.left_out, *not_measured, WITHOUT_LENS]
    )


def text_checks_of(solid: Brep) -> BareChecks:
    """Return the part of the BareChecks that reads the text alone."""
    checks, left_out = whole_checks(solid)
    nets, surfaces = _net_checks(solid)
    if not surfaces:
        left_out.append("folds of front and rear: their poles lie on no grid over x and y")
    elif not (len(surfaces) == 2 == len(solid.faces) - 4 and all(map(_centred, surfaces))):
        left_out.append("crossings of front and rear: they are cut, patched or beside the axis")
    else:
        with np.errstate(all="ignore"):
            nets += _crossing_checks(surfaces)
    return BareChecks([*checks, *nets], left_out)


def _net_checks(solid: Brep) -> tuple[list[Check], list[BSplineSurface]]:
    """Return the Checks of front and rear as graphs z(x, y), and the graphs, the lower one first.

    The poles of a face that is curved in both directions lie on a grid over x and y, equal to the means of
    the knots but for scale (Greville abscissae): the face folds nowhere then.  Faces of which the most poles
    lie beside that grid come from elsewhere, and are left out.  Conics are graphs by themselves.
    """
    graphs = []
    beside: list[int] = []
    for face in solid.faces:
        form = optical_form(solid, face)
        if isinstance(form, BSplineSurface):
            graph, off = _graph(form)
            if 2 * off < form.kv_u.dim * form.kv_v.dim:
                graphs.append(graph)
                beside.append(off)
        elif form is not None and form.half_width != NOT_BOUNDED:
            graphs.append(_conic_graph(form))
    name = "text of the file: poles of front and rear beside the grid of the others in x and y"
    graphs.sort(key=lambda graph: float(np.median(graph.coefficients)))
    return [Check.none_of(name, sum(beside))] if beside else [], graphs


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


def _axis(kv: KnotVector, positions: NDArray[np.float64]) -> tuple[KnotVector, NDArray[np.bool_]]:
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


def _crossing_checks(graphs: list[BSplineSurface]) -> list[Check]:
    """Return the Check of the proof that front, rear and edges do not cross each other."""
    name = "text of the file: no proof that front, rear and edges stay apart"
    degrees = tuple(max(getattr(g, kv).degree for g in graphs) for kv in ("kv_u", "kv_v"))
    front, rear = (graph.elevate(degrees[0], degrees[1]) for graph in graphs)
    try:
        require_sound_graphs(front, rear)
    except ValueError as error:
        return [Check.none_of(f"{name}: {error}", 1)]
    return [Check.none_of(name, 0)]
