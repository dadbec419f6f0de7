"""Volume and areas of a solid as the text of a STEP file holds it, by Gauss's theorem over its faces.

    V = sum over faces of 1/3 (integral of (X - O) . n dA),    O the mean of the vertices.

Of a spline face X(u, v) the integrand (X - O) . (X_u x X_v) is a polynomial of degree 3 p - 1 on every span:
Gauss quadrature is exact.  On a plane face (X - O) . n is constant; its area is half of n . (integral of X x
dX) around its loops, which is exact for lines and splines.  The area of a spline face is the integral of |X_u
x X_v|, of which two numbers of nodes show the error.

Faces are planes, or splines that are not rational and end at the four sides of their rectangle.

Source: R. N. Goldman, Area of planar polygons and volume of polyhedra, Graphics Gems II (1991); G. H. Golub
and J. H. Welsch, Calculation of Gauss quadrature rules, Math. Comp. 23 (1969).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from thbcad.checks import Floats
from thbcad.io.brep_records import MATCH, Brep, BrepEdge, BrepFace
from thbcad.splines import UNIT, BSplineSurface, KnotVector, gauss_rule

ACCURACY = 1e-10  # relative, of areas
MOST_NODES = 64  # per span and direction
STRIP = 2**18  # nodes that are taken at once


class NotMeasured(ValueError):
    """A solid with a face or an edge of a kind that is not measured here, such as a cylinder."""


def volume(brep: Brep) -> float:
    """Return the volume of a solid in its unit of length, cubed; exact but for rounding.

    Raises
    ------
    NotMeasured : a face that is neither a plane nor a whole spline, an edge that is neither a line nor a
        whole spline.
    ValueError : edges that do not border two faces, or a solid inside out.
    """
    edges = _edges(brep)
    origin = np.mean([edge.ends for edge in brep.edges], axis=(0, 1))
    parts = [(1.0 if face.outward else -1.0) * _flux(face, edges, origin) for face in brep.faces]
    total = sum(parts) / 3
    if not total > 0:
        raise ValueError(f"the faces of the solid must point outward, got a volume of {total:.6g}")
    return float(total)


def areas(brep: Brep) -> tuple[float, ...]:
    """Return the areas of the faces, in their order, in the unit of length squared; relative errors are below
    1e-10.

    Raises
    ------
    ValueError : as `volume`, or a spline face whose area needs more than 64 Gauss nodes per span.
    """
    edges = _edges(brep)
    return tuple(_area(face, edges) for face in brep.faces)


def _edges(brep: Brep) -> dict[int, BrepEdge]:
    """Return the edges by number; raise ValueError unless the solid is closed and its faces can be
    measured."""
    if brep.unpaired or brep.gaps:
        raise ValueError(
            f"the solid must be closed, got {brep.unpaired} edges that do not border two faces and "
            f"{brep.gaps} gaps"
        )
    edges = {edge.number: edge for edge in brep.edges}
    for face in brep.faces:
        if face.plane is None:
            _require_whole(face, edges)
    return edges


def _spline(face: BrepFace) -> BSplineSurface:
    """Return the surface of a face that is no plane; raise NotMeasured unless it is a spline that is not
    rational."""
    if not isinstance(face.surface, BSplineSurface):
        raise NotMeasured(
            f"face #{face.number} must be a plane or a spline that is not rational, got {face.surface_type}"
        )
    return face.surface


def _require_whole(face: BrepFace, edges: Mapping[int, BrepEdge]) -> None:
    """Raise NotMeasured unless the edges of a spline face are the four sides of its rectangle."""
    surface = _spline(face)
    kv_u = surface.kv_u
    kv_v = surface.kv_v
    net = surface.coefficients
    sides = [(kv_u, net[:, 0]), (kv_u, net[:, -1]), (kv_v, net[0]), (kv_v, net[-1])]
    if len(face.loops) == 1 and len(face.loops[0]) == 4:
        for number, _ in face.loops[0]:
            sides = [side for side in sides if not _covers(edges[number], *side)]
    if sides:
        raise NotMeasured(f"face #{face.number} must end at the four sides of its spline")


def _covers(edge: BrepEdge, kv: KnotVector, poles: Floats) -> bool:
    """Return whether an edge is the spline (kv, poles), of which it may lack some knots, run in either
    direction."""
    curve = edge.kv or UNIT
    points = _poles(edge)
    if _same(poles[[0, -1]], points[[-1, 0]]):
        curve = KnotVector(curve.degree, 0.0 - curve.knots[::-1])
        points = points[::-1]
    if curve.degree != kv.degree or not _same(poles[[0, -1]], points[[0, -1]]):
        return False
    curve = curve.rescaled(kv.start, kv.stop)
    both = curve.merged(kv)
    return _same(curve.prolongation(both) @ points, kv.prolongation(both) @ poles)


def _same(a: Floats, b: Floats) -> bool:
    return bool((abs(a - b) <= MATCH).all())


def _poles(edge: BrepEdge) -> Floats:
    """Return the poles of an edge, along its curve; raise NotMeasured for a curve that is neither a line nor
    a whole spline."""
    if edge.poles is None:
        raise NotMeasured(f"edge #{edge.number} must be a line or a spline")
    if edge.kv is None:
        return edge.ends
    if not _same(edge.ends, edge.poles[[0, -1]]):
        raise NotMeasured(f"edge #{edge.number} must be a whole spline, got a part")
    return edge.poles


def _flux(face: BrepFace, edges: Mapping[int, BrepEdge], origin: Floats) -> float:
    """Return the integral of (X - O) . n dA, n the normal of the surface."""
    if face.plane is not None:
        point, normal, _ = face.plane
        height = float((point - origin) @ normal / np.linalg.norm(normal))
        return height * _plane_area(face, face.plane, edges)
    whole = _spline(face)
    surface = BSplineSurface(whole.kv_u, whole.kv_v, whole.coefficients - origin)
    nodes = 3 * surface.kv_u.degree // 2 + 1, 3 * surface.kv_v.degree // 2 + 1
    return sum(
        float(wu @ np.einsum("ijk,ijk->ij", x, normal) @ wv) for wu, wv, x, normal in _normals(surface, nodes)
    )


def _area(face: BrepFace, edges: Mapping[int, BrepEdge]) -> float:
    if face.plane is not None:
        return _plane_area(face, face.plane, edges)
    surface = _spline(face)
    before = np.inf
    more = 2
    while more <= MOST_NODES:
        p, q = surface.kv_u.degree, surface.kv_v.degree
        nodes = min(p + more, MOST_NODES), min(q + more, MOST_NODES)
        area = sum(
            float(wu @ np.linalg.norm(normal, axis=2) @ wv) for wu, wv, _, normal in _normals(surface, nodes)
        )
        if abs(area - before) <= ACCURACY * area:
            return area
        before = area
        more = more + max(2, more // 2)
    raise ValueError(
        f"the area of face #{face.number} cannot be found to {ACCURACY:g} with {MOST_NODES} nodes per span"
    )


def _plane_area(face: BrepFace, plane: Floats, edges: Mapping[int, BrepEdge]) -> float:
    """Return |1/2 n . integral of X x dX| around the loops of a plane face."""
    point, normal, _ = plane
    twice = np.zeros(3)
    for number, along in (use for loop in face.loops for use in loop):
        edge = edges[number]
        poles = _poles(edge) - point
        if edge.kv is None:
            part = np.cross(poles[0], poles[1])
        else:
            (x, w), kv = gauss_rule(edge.kv.breaks, edge.kv.degree), edge.kv
            part = w @ np.cross(kv.collocation(x) @ poles, kv.collocation(x, 1) @ poles)
        twice += part if along else -part
    return abs(float(twice @ normal)) / (2 * float(np.linalg.norm(normal)))


def _normals(
    surface: BSplineSurface, nodes: tuple[int, int]
) -> Iterator[tuple[Floats, Floats, Floats, Floats]]:
    """Yield (weights in u, weights in v, X, X_u x X_v) at Gauss nodes of all spans, strip by strip."""
    (u, wu), (v, wv) = (gauss_rule(kv.breaks, n) for kv, n in zip((surface.kv_u, surface.kv_v), nodes))
    step = max(1, STRIP // len(v))
    for first in range(0, len(u), step):
        part = u[first : first + step]
        x, by_u, by_v = (surface.grid(part, v, orders) for orders in ((0, 0), (1, 0), (0, 1)))
        yield wu[first : first + step], wv, x, np.cross(by_u, by_v)
