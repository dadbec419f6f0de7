"""How far the edges of a STEP file lie from their images in the parameters of the faces.

An edge C(t) has an image c(t) in the parameters of each face X that it borders, a PCURVE.  A CAD program may
take either, so that

    X(c(t)) = C(t)

must hold for every t between the vertices.  The difference is looked at in every span of C, of c and of X
between the extrema of a Chebyshev polynomial: where the image is a line along the sides of X, which is all
that rectangular lenses have, the difference is a polynomial of no higher degree there, and what lies between
is at most a few times larger.

Source: ISO 10303-42, pcurve, surface_curve; L. N. Trefethen, Approximation Theory and Approximation Practice,
chapter 15 (Lebesgue constants of Chebyshev points are below 4 up to degree 100).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping

import numpy as np

from thbcad.checks import Floats
from thbcad.io.brep_records import MATCH, Brep, BrepEdge, BrepFace, ParameterCurve
from thbcad.sags import lobatto_nodes
from thbcad.splines import KnotVector

NEWTON_STEPS = 20  # about 5 suffice where the point lies on the curve
BEYOND = 1e-9  # of the size of a parameter rectangle: rounding


def image_distance(brep: Brep) -> tuple[float, tuple[str, ...]]:
    """Return the greatest distance of an edge from its vertices and from its images, in the unit of length,
    and what was not compared.

    It is inf where an image lies beside the parameters of its face, or on a surface that the edge does not
    border.

    Curves that are neither lines nor splines, and surfaces that are neither planes nor splines, are not
    compared: they come back as "LINE on a CYLINDRICAL_SURFACE", and so on, each with its number.
    """
    faces = {face.carrier: face for face in brep.faces}
    borders = {(face.carrier, number) for face in brep.faces for loop in face.loops for number, _ in loop}
    greatest = 0.0
    left: Counter[str] = Counter()
    for edge in brep.edges:
        span = _span(edge)
        if span is None:
            left["edges that are neither lines nor splines"] += 1
            continue
        greatest = max(greatest, _beside_ends(edge, span) if span[0] < span[1] else np.inf)
        for image in edge.images:
            face = faces.get(image.carrier)
            if face is None or (image.carrier, edge.number) not in borders:
                greatest = np.inf
            elif image.poles is None:
                left["images of edges that are neither lines nor splines"] += 1
            elif face.plane is None and face.surface is None:
                left[f"images of edges on a {face.surface_type}"] += 1
            else:
                greatest = max(greatest, _distance(edge, image, face, span))
    return greatest, tuple(f"{count} {what}" for what, count in left.items())


def turned_faces(brep: Brep) -> int:
    """Return how many faces lie to the right of their loops, seen from outside the solid.

    The area in the parameters, 1/2 the sum over the loops of the integral of u dv - v du, has the sign of the
    surface's normal against the outward one.  Planes and splines count whose edges all have images there.
    """
    edges = {edge.number: edge for edge in brep.edges}
    turned = 0
    for face in brep.faces:
        twice = 0.0 if face.plane is None and face.surface is None else _twice_area(face, edges)
        turned += twice < 0 if face.outward else twice > 0
    return turned


def _twice_area(face: BrepFace, edges: Mapping[int, BrepEdge]) -> float:
    """Return twice the area of a face's loops in its parameters, 0 where an image is missing."""
    twice = 0.0
    for number, along in (use for loop in face.loops for use in loop):
        edge = edges[number]
        span = _span(edge)
        image = next((i for i in edge.images if i.carrier == face.carrier and i.poles is not None), None)
        if span is None or image is None or not _covers(image, span):
            return 0.0
        breaks = np.unique(np.clip([*span, *_breaks(edge, image, face)], *span))
        u, v = _curve(image, lobatto_nodes(breaks, 4)).T[:, :: 1 if along else -1]
        twice += float(u[:-1] @ v[1:] - v[:-1] @ u[1:])
    return twice


def _covers(image: ParameterCurve, span: tuple[float, float]) -> bool:
    """Return whether an image has the parameters of an edge."""
    inside = image.kv is None or image.kv.start <= span[0] <= span[1] <= image.kv.stop
    return inside and span[0] < span[1]


def _span(edge: BrepEdge) -> tuple[float, float] | None:
    """Return the parameters of an edge's ends, equal ones where a line has no direction, None where the curve
    is neither a line nor a spline."""
    if edge.poles is None:
        return None
    if edge.kv is not None:
        whole = abs(edge.poles[[0, -1]] - edge.ends).max() <= MATCH
        return (edge.kv.start, edge.kv.stop) if whole else _nearest(edge.kv, edge.poles, edge.ends)
    step = edge.poles[1] - edge.poles[0]
    length = np.linalg.norm(step)
    if not length:
        return 0.0, 0.0
    first, last = ((edge.ends - edge.poles[0]) @ (step / length) / length).tolist()
    return first, last


def _nearest(kv: KnotVector, poles: Floats, ends: Floats) -> tuple[float, float]:
    """Return the parameters of the points of a spline that are nearest to two points, for an edge that is a
    part of it: by Gauss-Newton steps from the nearest of samples."""
    t = lobatto_nodes(kv.breaks, 2 * kv.degree)
    apart = np.linalg.norm((kv.collocation(t) @ poles)[:, None] - ends, axis=2)
    found = t[np.argmin(apart, axis=0)]
    for _ in range(NEWTON_STEPS):
        off, along = kv.collocation(found) @ poles - ends, kv.collocation(found, 1) @ poles
        step = (off * along).sum(axis=1) / (along * along).sum(axis=1)
        found = np.clip(found - np.nan_to_num(step, posinf=0.0, neginf=0.0), kv.start, kv.stop)
    first, last = found.tolist()
    return first, last


def _beside_ends(edge: BrepEdge, span: tuple[float, float]) -> float:
    """Return the distance of a curve's ends from the vertices."""
    return float(np.linalg.norm(_curve(edge, np.array(span)) - edge.ends, axis=1).max())


def _distance(edge: BrepEdge, image: ParameterCurve, face: BrepFace, span: tuple[float, float]) -> float:
    """Return the greatest distance of an edge from the surface point of its image at equal parameters."""
    if not _covers(image, span):
        return np.inf
    breaks = np.unique(np.clip([*span, *_breaks(edge, image, face)], *span))
    degree = 2 * max(kv.degree if kv else 1 for kv in (edge.kv, image.kv, *_knots(face)))
    t = lobatto_nodes(breaks, degree)
    points = _surface(face, _curve(image, t))
    return np.inf if points is None else float(np.linalg.norm(points - _curve(edge, t), axis=1).max())


def _knots(face: BrepFace) -> tuple[KnotVector, ...]:
    return () if face.surface is None else (face.surface.kv_u, face.surface.kv_v)


def _breaks(edge: BrepEdge, image: ParameterCurve, face: BrepFace) -> Iterator[float]:
    """Yield the parameters of an edge where the difference may not be smooth: knots of edge and image, and
    where an image that is a line crosses the knots of its face."""
    for kv in (edge.kv, image.kv):
        if kv is not None:
            yield from kv.breaks
    if image.kv is None and image.poles is not None:
        start, step = image.poles[0], image.poles[1] - image.poles[0]
        for axis, kv in enumerate(_knots(face)):
            if step[axis]:
                yield from (kv.breaks - start[axis]) / step[axis]


def _curve(curve: BrepEdge | ParameterCurve, t: Floats) -> Floats:
    """Return points of a line or a spline, (n, dimensions)."""
    assert curve.poles is not None
    points: Floats
    if curve.kv is None:
        points = curve.poles[0] + t[:, None] * (curve.poles[1] - curve.poles[0])
        return points
    points = curve.kv.collocation(t) @ curve.poles
    return points


def _surface(face: BrepFace, parameters: Floats) -> Floats | None:
    """Return points of a face, (n, 3), None where parameters lie beside it."""
    if face.surface is None:
        assert face.plane is not None
        point, normal, first = face.plane
        normal = normal / np.linalg.norm(normal)
        across = first - (first @ normal) * normal
        across = across / np.linalg.norm(across)
        points: Floats = point + parameters @ np.stack([across, np.cross(normal, across)])
        return points
    low, high = np.array([[kv.start, kv.stop] for kv in _knots(face)]).T
    inside = np.clip(parameters, low, high)
    if (abs(inside - parameters) > BEYOND * (high - low)).any():
        return None
    return face.surface(*inside.T)
