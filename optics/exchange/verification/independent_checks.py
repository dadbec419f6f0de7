"""Checks of a STEP file by independent programs: by its text, and by OCCT's intersections with rays."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from optics.base.runtime import Backend, Check
from optics.exchange.verification.occt_tracer import Crossed, occt_through
from optics.exchange.verification.rays_behind import RaysBehind
from optics.exchange.verification.reference_tracer import fixed_face
from optics.exchange.verification.same_design import bits_of, conic_bits, fresh_export_checks
from optics.exchange.verification.solid_text import measure_checks, whole_checks
from optics.exchange.verification.step_checks import differing_numbers, occt_checks
from optics.exchange.verification.step_file import (
    StepFile,
    faces_besides,
    optical_faces,
    optical_form,
    text_solid_checks,
)
from optics.exchange.verification.trace_comparison import compared
from optics.scene.problem import Problem
from optics.scene.system import MadePart, System
from thbcad.checks import Floats
from thbcad.io import Brep, BrepEdge, BrepFace, edge_span
from thbcad.lens import CORNERS, SIDES, Lens, OpticalForm, edge_names, optical_forms, rim, ruled_edges
from thbcad.moulds import MouldedBody, lens_of
from thbcad.outlines import UPRIGHT, Line, RimPiece
from thbcad.splines import UNIT, BSplineSurface

if TYPE_CHECKING:
    from thbcad.moulds import Made


RAYS = (22, 23)  # in x and y; of sources that take a power of two, 512
ROUNDING = 1e-12  # of the direction of a line, and of the place of a plane
FITTED = 1e-8  # mm; rims are fitted within 1e-9 mm at eight points of every span
ALONG = 33  # points of an edge that are compared


def text_and_occt_checks(system: System, file: StepFile, backend: Backend) -> list[Check]:
    """Return the Checks of a STEP file by its text and by OCCT's intersections of rays and faces.

    The text is read first, so that a file that is cut off or damaged never reaches OCCT.
    backend : of double precision.

    Raises OSError : the file cannot be read.  ValueError : it is not whole, or not one solid.
    """
    path = system.path.without_coats()  # as OCCT is to meet the faces: those that reflect do so ideally
    crossed = [(int(f.face == "rear"), fixed_face(path, k).eta) for k, f in system.own_faces.items()]
    difference = compared(system, backend, RAYS, tracer_by_occt(file, crossed))
    fates, landing, _ = difference.checks(system.traced_within, "OCCT's intersections with the file")
    return [*_own_checks(file, system.made), fates, landing]


def other_part_checks(part: MadePart, file: StepFile, problem: Problem) -> list[Check]:
    """Return the Checks of the STEP file of a fixed element, against a fresh export, by its text and by OCCT,
    under its name.

    Raises OSError, ValueError : as `text_and_occt_checks`.
    """
    fresh, _ = fresh_export_checks(part, problem.export.schema, file)
    checks = [*fresh, *_own_checks(file, part.made), *occt_checks(part.made, file, problem.verify)]
    return [replace(check, name=f"{part.name}: {check.name}") for check in checks]


def _own_checks(file: StepFile, made: Made) -> list[Check]:
    return [*text_checks(file.text, made), *measure_checks(file.text, file.solid)[0]]


def tracer_by_occt(file: StepFile, crossed: Sequence[Crossed]) -> Callable[[RaysBehind], RaysBehind]:
    """Return the trace of rays through a file as `occt_through`; the text of the file is read first."""
    optical = optical_faces(file.text)
    return partial(occt_through, file.solid.shape, optical, crossed=crossed)


def text_checks(solid: Brep, made: Made) -> list[Check]:
    """Return the Checks of the text of a STEP file against a lens or its body in memory."""
    pair, optical = optical_forms(lens_of(made)), optical_faces(solid)
    rest = [face for k, face in enumerate(solid.faces) if k not in optical]
    front, rear = (optical_form(solid, solid.faces[k]) for k in optical)
    counts = {
        "front numbers": differing_numbers(front, pair[0]),
        "rear numbers": differing_numbers(rear, pair[1]),
    }
    if isinstance(made, Lens):
        counts["edge face numbers"] = _other_walls(rest, made)
        counts["rims and corners"] = _other_edges(solid.edges, made)
    elif isinstance(made, MouldedBody):
        counts["walls"] = sum(not _is_wall(face, solid.edges, made) for face in rest)
    besides, number = faces_besides(made, len(solid.faces))
    return [
        *whole_checks(solid)[0],
        Check.none_of(f"text of the file: {besides}", number),
        *(
            Check.none_of(f"text of the file: {name} that differ from the lens in memory", value)
            for name, value in counts.items()
        ),
        *text_solid_checks(solid, made),
    ]


def _other_walls(faces: Sequence[BrepFace], lens: Lens) -> int:
    """Return how many of the edge faces, or of their numbers, are not those of the lens."""
    if lens.taper != UPRIGHT:
        ruled = zip(faces, ruled_edges(lens))
        off = sum(differing_numbers(face.surface, wall) for face, wall in ruled)
        return abs(len(faces) - len(edge_names(lens))) + off
    pieces = lens.rear.outline.pieces
    if lens.rear.outline.is_rectangle:
        return _other_planes(faces, lens)
    return abs(len(faces) - len(pieces)) + sum(not _stands_on(*pair) for pair in zip(faces, pieces))


def _is_wall(face: BrepFace, edges: Sequence[BrepEdge], body: MouldedBody) -> bool:
    """Return whether the edges of a face lie on one wall of a body or on its land, or whether it has the
    numbers of a rounded edge."""
    if face.name.startswith("radius"):
        own = (surface for edge in body.rounded_edges.values() for surface in edge.surfaces)
        return any(differing_numbers(face.surface, surface) == 0 for surface in own)
    numbers = {number for loop in face.loops for number, _ in loop}
    spans = [(edge, span) for edge in edges if edge.number in numbers and (span := edge_span(edge))]
    points = np.concatenate([edge.points(np.linspace(*span, ALONG)) for edge, span in spans])
    return body.off_walls(*points.T) <= FITTED


def _stands_on(face: BrepFace, piece: RimPiece) -> bool:
    """Return whether a face is the plane or the cylinder along z over a piece of an outline."""
    if isinstance(piece, Line):
        if face.plane is None or face.plane[1, 2]:
            return False
        ends = np.array([piece.start, piece.stop])
        beside = np.abs((ends - face.plane[0, :2]) @ face.plane[1, :2]).max()
        return bool(beside <= ROUNDING * abs(ends).max())
    if piece.is_round:
        rows = face.cylinder
        if rows is None or rows[1, :2].any():
            return False
        return (*rows[0, :2], rows[3, 0]) == (*piece.centre, piece.semi_axes[0])
    swept = face.extrusion
    if swept is None or swept.curve.conic is None or swept.vector[:2].any():
        return False
    conic = swept.curve.conic
    return (*conic.placement[0, :2], *conic.sizes) == (*piece.centre, *sorted(piece.semi_axes, reverse=True))


def _other_planes(faces: Sequence[BrepFace], lens: Lens) -> int:
    """Return how many of the edge faces are not one of the four planes through the sides of the lens."""
    wanted = {(k, sign * h) for k, h in enumerate(lens.front.half_width) for sign in (-1.0, 1.0)}
    for face in faces:
        if face.plane is not None and np.count_nonzero(face.plane[1]) == 1:
            axis = int(np.argmax(face.plane[1] != 0))
            wanted.discard((axis, face.plane[0, axis]))
    return len(wanted) + abs(len(faces) - 4)


def _other_edges(edges: Sequence[BrepEdge], lens: Lens) -> int:
    """Return how many edges, or parts of them, are not those of the lens: by their numbers round a rectangle,
    by points of them round another outline, where rims are fitted."""
    if not lens.rear.outline.is_rectangle:
        return sum(not _is_edge(edge, lens) for edge in edges)
    pair = optical_forms(lens)
    corners: set[Hashable] = {bits_of(corner) for form in pair for corner in _corners(form)}
    rims = {row for form in pair for row in _rims(form)}
    return sum(_loose_parts(edge, corners, rims) for edge in edges)


def _is_edge(edge: BrepEdge, lens: Lens) -> bool:
    """Return whether an edge is a part of a rim, or a straight line from the front's rim to the rear's."""
    span = edge_span(edge)
    if span is None:
        return False
    points = edge.points(np.linspace(*span, ALONG))
    on_rims = []
    for _, surface, vertex in lens.faces:
        x, y, z = points.T
        beside = abs(surface.outline.gauge(x, y) - 1) * max(surface.half_width)
        x, y = (np.clip(row, -h, h) for row, h in zip((x, y), surface.half_width))
        on_rims.append((beside <= FITTED) & (abs(vertex + surface(x, y) - z) <= FITTED))
    if any(on.all() for on in on_rims):
        return True
    ends, steps = points[[0, -1]], points - points[0]
    along = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    straight = bool(np.linalg.norm(np.cross(steps, along), axis=1).max() <= FITTED)
    front, rear = (on[[0, -1]].tolist() for on in on_rims)
    return straight and [front, rear] in ([[True, False], [False, True]], [[False, True], [True, False]])


def _loose_parts(edge: BrepEdge, corners: set[Hashable], rims: set[Hashable]) -> int:
    """Return how many parts of an edge are not those of the lens."""
    loose = sum(bits_of(end) not in corners for end in edge.ends)
    if edge.conic is not None:
        return loose + (conic_bits(edge.conic) not in rims)
    if edge.kv is None or edge.poles is None or edge.weights is not None:
        return loose + (not _leads(edge))
    straight = edge.kv.degree == 1 and len(edge.poles) == 2 and bool((edge.kv.knots == UNIT.knots).all())
    loose += not straight and (bits_of(edge.kv.knots), bits_of(edge.poles)) not in rims
    return loose + int((edge.poles[[0, -1]] != edge.ends).any())


def _corners(form: OpticalForm) -> Iterator[Floats]:
    """Yield the corners of front or rear, (3,), mm."""
    for corner in CORNERS:
        if isinstance(form, BSplineSurface):
            yield form.coefficients[corner]
        else:
            x, y = (h if end else -h for h, end in zip(form.half_width, corner))
            yield np.array([x, y, form(x, y)])


def _rims(form: OpticalForm) -> Iterator[Hashable]:
    """Yield the rims of front or rear as values; those of planes are lines, which are compared by their
    ends."""
    for side in SIDES:
        if isinstance(form, BSplineSurface):
            kv, poles = rim(form, side)
            yield bits_of(kv.knots), bits_of(poles)
        elif form.kind != "PLANE":
            half = form.half_width[1 - side.axis]
            yield conic_bits(form.section(side.axis, half if side.end else -half))


def _leads(edge: BrepEdge) -> bool:
    """Return whether an edge is a line from its first end to its second."""
    if edge.poles is None or (edge.poles[0] != edge.ends[0]).any():
        return False
    wanted, line = edge.ends[1] - edge.ends[0], edge.poles[1] - edge.poles[0]
    beside = np.linalg.norm(np.cross(wanted, line))
    return bool(wanted @ line > 0 and beside <= ROUNDING * np.linalg.norm(wanted) * np.linalg.norm(line))
