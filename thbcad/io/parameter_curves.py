"""How far the edges of a STEP file lie from their images in the parameters of the faces.

An edge C(t) has an image c(t) in the parameters of each face X that it borders, a PCURVE.  A CAD program may
take either, so that

    X(c(t)) = C(t)

must hold for every t between the vertices.  The difference is looked at in every span of C, of c and of X
between the extrema of a Chebyshev polynomial: where the image is a line along the sides of X, which is all
that rectangular lenses have, the difference is a polynomial of no higher degree there, and what lies between
is at most a few times larger.

A circle may begin at any multiple of 2 pi; on a sphere, a cylinder or a cone the images follow each other
round a face all the same.

Source: ISO 10303-42, pcurve, surface_curve; L. N. Trefethen, Approximation Theory and Approximation Practice,
chapter 15 (Lebesgue constants of Chebyshev points are below 4 up to degree 100).
"""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from thbcad.checks import Floats, Integers
from thbcad.io.brep_records import TURN, Brep, BrepCurve, BrepEdge, BrepFace, Order, ParameterCurve, edge_span
from thbcad.sags import axes, lobatto_nodes
from thbcad.splines import KnotVector

BEYOND = 1e-9  # of the size of a parameter rectangle: rounding
CLOSE = 1e-3  # of a loop's extent: edges meet within a vertex's tolerance, or are a whole turn apart
ROUND_NODES = 16  # of a circle, enough for a whole turn to rounding errors
BISECTIONS = 50  # between samples: to rounding errors


def image_distance(brep: Brep) -> tuple[float, tuple[str, ...]]:
    """Return the greatest distance of an edge from its vertices and from its images, in the unit of length,
    and what was not compared.

    It is inf where an image lies beside the parameters of its face, on a surface that the edge does not
    border, or beyond the numbers of float64.

    Compared are lines, splines and conics on planes, splines, spheres, cylinders, cones and extrusions.
    Others come back as "2 images of edges on a TOROIDAL_SURFACE", and so on.
    """
    faces = {face.carrier: face for face in brep.faces}
    borders = {(face.carrier, number) for face in brep.faces for loop in face.loops for number, _ in loop}
    greatest = 0.0
    left: Counter[str] = Counter()
    for edge in brep.edges:
        span = edge_span(edge)
        if span is None:
            left["edges that are neither lines, splines nor conics"] += 1
            continue
        beside = _greatest(edge.points(np.array(span)) - edge.ends) if span[0] < span[1] else np.inf
        greatest = max(greatest, beside)
        for image in edge.images:
            face = faces.get(image.carrier)
            if face is None or (image.carrier, edge.number) not in borders:
                greatest = np.inf
            elif not image.known:
                left["images of edges that are neither lines, splines nor conics"] += 1
            elif edge.conic is not None and edge.conic.kind == "PARABOLA" and image.kv is not None:
                left["images of parabolas, which OCCT writes over another parameter"] += 1
            elif not face.known:
                left[f"images of edges on a {face.surface_type}"] += 1
            else:
                greatest = max(greatest, _distance(edge, image, face))
    return greatest, tuple(f"{count} {what}" for what, count in left.items())


def turned_faces(brep: Brep) -> int:
    """Return how many faces lie to the right of their loops, seen from outside the solid.

    The area in the parameters, 1/2 the sum over the loops of the integral of u dv - v du, has the sign of the
    surface's normal against the outward one; loops count as polygons through some of their points.  Faces
    count whose edges all have images there, which close.
    """
    edges = {edge.number: edge for edge in brep.edges}
    turned = 0
    for face in brep.faces:
        twice = 0.0
        for loop in boundary(face, edges) or ():
            u, v = np.concatenate([passage.samples() for passage in loop]).T
            twice += float(u @ np.roll(v, -1) - v @ np.roll(u, -1))
        turned += twice < 0 if face.outward else twice > 0
    return turned


@dataclass(frozen=True, eq=False)
class Passage:
    """An edge as a loop passes it in the parameters of its face.

    span : the parameters of the curve's start and end.  along : whether the curve is passed forwards.
    pace : of the image against the curve.  shift : of (u, v), multiples of 2 pi, (2,) float or 0.
    """

    edge: BrepEdge
    image: ParameterCurve
    span: tuple[float, float]
    along: bool
    pace: float = 1.0
    shift: Floats | float = 0.0

    def points(self, t: Floats) -> Floats:
        """Return (u, v) at parameters of the curve, (n, 2)."""
        return _image_points(self.image, self.pace * t) + self.shift

    def rates(self, t: Floats) -> Floats:
        """Return the derivatives of (u, v) by the parameter of the curve, (n, 2)."""
        return self.pace * _image_points(self.image, self.pace * t, 1)

    def samples(self) -> Floats:
        """Return points in the order of the loop, some in every span of the image."""
        t = lobatto_nodes(np.unique(np.clip([*self.span, *_breaks(self.image)], *self.span)), 4)
        return self.points(t)[:: 1 if self.along else -1]

    def ends(self) -> Floats:
        """Return the first and the last point, in the order of the loop, (2, 2)."""
        return self.points(np.array(self.span))[:: 1 if self.along else -1]

    def pieces(self, lines: Sequence[Floats]) -> Floats:
        """Return the parameters of the curve, increasing, between which the image meets no line u = lines[0],
        v = lines[1] and no knot of its own or of the edge."""
        inner = np.concatenate([_breaks(self.edge), _breaks(self.image)])
        breaks = np.unique(np.clip([*self.span, *inner], *self.span))
        return np.unique(np.r_[breaks, _crossings(self.points, breaks, lines)])


def boundary(face: BrepFace, edges: Mapping[int, BrepEdge]) -> list[list[Passage]] | None:
    """Return the loops of a face in its parameters, None where an image is missing or a loop does not
    close."""
    loops = []
    for loop in face.loops:
        passages: list[Passage] = []
        for number, along in loop:
            images = [k for k in edges[number].images if k.carrier == face.carrier]
            options = [_passage(face, edges[number], image, along, passages) for image in images]
            known = [option for option in options if option is not None]
            if not known:
                return None
            if passages:  # the one that begins nearest to where the edge before ends
                end = passages[-1].ends()[1]
                known.sort(key=lambda option: float(abs(end - option.ends()[0]).sum()))
            passages.append(known[0])
        corners = np.array([passage.ends() for passage in passages])
        extent = np.ptp(np.concatenate([passage.samples() for passage in passages]), axis=0)
        if (abs(corners[:, 0] - np.roll(corners[:, 1], 1, axis=0)) > CLOSE * extent).any():
            return None
        loops.append(passages)
    return loops


def _passage(
    face: BrepFace, edge: BrepEdge, image: ParameterCurve, along: bool, before: Sequence[Passage]
) -> Passage | None:
    """Return an edge after others of a loop, None where curve and image do not fit each other."""
    span = image_span(edge, image) if face.known else None
    if span is None:
        return None
    passage = Passage(edge, image, span, along, _pace(edge, image, face))
    if not any(face.turns) or not before:
        return passage
    turns = np.round((before[-1].ends()[1] - passage.ends()[0]) / TURN)
    return replace(passage, shift=TURN * turns * face.turns)


def image_span(edge: BrepEdge, image: ParameterCurve) -> tuple[float, float] | None:
    """Return the parameters of an edge's ends on an image of it, None where either is not known or the image
    lacks some of them."""
    span = edge_span(edge)
    if span is None or not image.known or not span[0] < span[1]:
        return None
    if image.kv is None:
        return span
    slack = BEYOND * (image.kv.stop - image.kv.start)
    if edge.closed_conic:  # from the first turn on that the image has
        turns = np.ceil((image.kv.start - slack - span[0]) / TURN)
        span = float(span[0] + TURN * turns), float(span[1] + TURN * turns)
    inside = image.kv.start - slack <= span[0] and span[1] <= image.kv.stop + slack
    return span if inside else None


def _distance(edge: BrepEdge, image: ParameterCurve, face: BrepFace) -> float:
    """Return the greatest distance of an edge from the surface point of its image at equal parameters."""
    span = image_span(edge, image)
    if span is None:
        return np.inf
    passage = Passage(edge, image, span, True, _pace(edge, image, face))
    degree = 2 * max(kv.degree if kv else 1 for kv in (edge.kv, image.kv, *knots(face)))
    degree = max(degree, ROUND_NODES if edge.conic or image.conic or not knots(face) else 1)
    t = lobatto_nodes(passage.pieces([kv.breaks for kv in knots(face)]), degree)
    points = _surface(face, passage.points(t))
    return np.inf if points is None else _greatest(points - edge.points(t))


def _greatest(apart: Floats) -> float:
    """Return the greatest length of vectors, (n, 3), inf where one is not a number."""
    return float(np.nan_to_num(np.linalg.norm(apart, axis=1).max(), nan=np.inf, posinf=np.inf))


def _pace(edge: BrepEdge, image: ParameterCurve, face: BrepFace) -> float:
    """Return how fast an image is passed: OCCT writes lines on a cone and their images both with vectors of
    length 1, though v counts along the axis of the cone."""
    if face.cone is None or edge.poles is None or edge.kv is not None or image.poles is None:
        return 1.0
    along, across = np.diff(edge.poles, axis=0)[0], np.diff(image.poles, axis=0)[0]
    return float(abs(along @ axes(face.cone[:3])[2] / across[1])) if across[1] else 1.0


def knots(face: BrepFace) -> tuple[KnotVector, ...]:
    """Return the knot vectors of a spline face, none of another one."""
    return () if face.surface is None else (face.surface.kv_u, face.surface.kv_v)


def _breaks(curve: BrepCurve) -> Floats:
    return np.zeros(0) if curve.kv is None else curve.kv.breaks


def _crossings(points: Callable[[Floats], Floats], breaks: Floats, lines: Sequence[Floats]) -> Floats:
    """Return the parameters at which a plane curve crosses lines u = lines[0] and v = lines[1], by bisection
    between samples.

    breaks : increasing, of the parameter; the curve is smooth between them.
    """
    t = lobatto_nodes(breaks, ROUND_NODES)
    place = points(t)
    found = []
    for axis, row in enumerate(lines):
        cell: Integers = np.searchsorted(row, place[:, axis])
        steps = np.diff(cell)
        count: Integers = np.abs(steps)
        piece = np.repeat(np.arange(len(steps)), count)
        nth = np.arange(len(piece)) - np.repeat(np.cumsum(count) - count, count)
        target = row[np.minimum(cell[:-1], cell[1:])[piece] + nth]
        found.append((np.full(len(piece), axis), piece, target, steps[piece] > 0))
    if not any(len(piece) for _, piece, _, _ in found):
        return np.zeros(0)
    column, piece, target, rising = (np.concatenate(rows) for rows in zip(*found))
    # a sample on the line is the crossing: rims of our own files have a knot there
    slack = BEYOND * np.array([np.ptp(row) for row in lines])[column]
    here, next_ = (abs(place[piece + k, column] - target) <= slack for k in (0, 1))
    known, rest = np.where(here, t[piece], t[piece + 1])[here | next_], ~(here | next_)
    column, piece, target, rising = (rows[rest] for rows in (column, piece, target, rising))
    low, high, every = t[piece], t[piece + 1], np.arange(len(piece))
    for _ in range(BISECTIONS if len(piece) else 0):
        middle = (low + high) / 2
        beyond = (points(middle)[every, column] > target) == rising
        low, high = np.where(beyond, low, middle), np.where(beyond, middle, high)
    return np.concatenate([known, high])


def _image_points(image: ParameterCurve, t: Floats, derivative: Order = 0) -> Floats:
    """Return points of an image, those that rounding put beside its parameters moved onto them."""
    return image.points(t if image.kv is None else np.clip(t, image.kv.start, image.kv.stop), derivative)


def _surface(face: BrepFace, parameters: Floats) -> Floats | None:
    """Return points of a face, (n, 3), None where parameters lie beside it."""
    inside = parameters
    if face.surface is not None:
        low, high = np.array([[kv.start, kv.stop] for kv in knots(face)]).T
        inside = np.clip(parameters, low, high)
        if not (abs(inside - parameters) <= BEYOND * (high - low)).all():
            return None
    return face.points(*inside.T)
