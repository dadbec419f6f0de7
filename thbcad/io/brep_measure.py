"""Volume and areas of a solid as the text of a STEP file holds it, by Gauss's theorem over its faces.

    V = sum over faces of 1/3 (integral of (X - O) . n dA),    O the mean of the vertices.

Of a spline face X(u, v) the integrand (X - O) . (X_u x X_v) is a polynomial of degree 3 p - 1 on every span:
Gauss quadrature is exact over the whole face, and over a trimmed face but for the quadrature along its edges
(`Primitive`).  On spheres, cylinders, cones, extrusions and rational splines the integrand is analytic
between knots; more nodes show the error.  On a plane face (X - O) . n is constant; its area is half of n .
(integral of X x dX) around its loops.  The area of another face is the integral of |X_u x X_v|.

Source: R. N. Goldman, Area of planar polygons and volume of polyhedra, Graphics Gems II (1991); G. H. Golub
and J. H. Welsch, Calculation of Gauss quadrature rules, Math. Comp. 23 (1969).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from thbcad.checks import MAX_DEGREE, Floats
from thbcad.io.brep_records import MATCH, TURN, Brep, BrepEdge, BrepFace, edge_span
from thbcad.io.parameter_curves import Passage, boundary, knots
from thbcad.sags import graph_of_poles
from thbcad.splines import UNIT, BSplineSurface, KnotVector, Primitive, gauss_rule, grid_integral

ACCURACY = 1e-10  # relative, of areas
FLUX = 1e-13  # of the size of the solid, cubed: some rounding errors of a sum over all cells
MORE_NODES = 48  # per span and direction, than the degree
PIECE = np.pi / 4  # of a turn, in which 16 nodes integrate sines and cosines to rounding errors
SMOOTH_NODES = 16
SMOOTH_PIECES = 4  # of a direction that is no angle
FARTHEST = 1e100  # its third power is a float64
MOST_TURNS = 2  # a face goes round once; memory grows with the number


class NotMeasured(ValueError):
    """A solid with a face or an edge of a kind that is not measured here, such as a torus."""


def volume(brep: Brep) -> float:
    """Return the volume of a solid in its unit of length, cubed; exact but for rounding and the distance of
    the edges from the faces.

    Raises NotMeasured : a face that is neither a plane, a spline up to degree 10, a sphere, a cylinder, a
        cone nor an extrusion; one that is no plane and whose edges have no closed images in its parameters;
        an edge that is neither a line, a spline nor a conic.
    Raises ValueError : edges that do not border two faces, or a solid inside out.
    """
    edges = _edges(brep)
    vertices = np.concatenate([edge.ends for edge in brep.edges])
    origin = vertices.mean(axis=0)
    size = float(abs(vertices - origin).max())
    if not size < FARTHEST:
        raise ValueError(f"vertices must lie nearer than {FARTHEST:g} to each other, got {size:g}")
    total = sum(_flux(face, edges, origin, size) for face in brep.faces) / 3
    if not total > 0:
        raise ValueError(f"the faces of the solid must point outward, got a volume of {total:.6g}")
    return total


def areas(brep: Brep) -> tuple[float, ...]:
    """Return the areas of the faces, in their order, in the unit of length squared; relative errors are below
    1e-10.

    Raises ValueError : as `volume`, or a face whose area needs more than 48 Gauss nodes per span.
    """
    edges = _edges(brep)
    return tuple(_area(face, edges) for face in brep.faces)


def _edges(brep: Brep) -> dict[int, BrepEdge]:
    """Return the edges by number; raise ValueError unless the solid is closed and its faces are known."""
    if brep.unpaired or brep.gaps:
        raise ValueError(
            f"the solid must be closed, got {brep.unpaired} edges that do not border two faces and "
            f"{brep.gaps} gaps"
        )
    for face in brep.faces:
        if not face.known:
            raise NotMeasured(
                f"face #{face.number} must be a plane, a spline up to degree {MAX_DEGREE}, a sphere, a "
                f"cylinder, a cone or an extrusion, got {face.surface_type}"
            )
    return {edge.number: edge for edge in brep.edges}


@dataclass(frozen=True, eq=False)
class Density:
    """(X - O) . (X_u x X_v) of a face, or |X_u x X_v| where no origin O is given."""

    face: BrepFace
    origin: Floats | None = None

    def __call__(self, u: Floats, v: Floats) -> Floats:
        return self._of(*(self.face.points(u, v, orders) for orders in ((0, 0), (1, 0), (0, 1))))

    def grid(self, u: Floats, v: Floats) -> Floats:
        surface = self.face.surface
        if surface is None:
            across, up = np.broadcast_arrays(u[:, None], v)
            return self(across.ravel(), up.ravel()).reshape(across.shape)
        graph = graph_of_poles(surface) if isinstance(surface, BSplineSurface) else None
        if graph is not None:
            return self._of_graph(*graph, u, v)
        return self._of(*(surface.grid(u, v, orders) for orders in ((0, 0), (1, 0), (0, 1))))

    def _of_graph(self, x: Floats, y: Floats, z: BSplineSurface, u: Floats, v: Floats) -> Floats:
        """Return the values for (x(u), y(v), z(u, v)), with the normal (-z_u y', -x' z_v, x' y')."""
        (across, per_u), (along, per_v) = (
            (kv.collocation(t) @ poles, kv.collocation(t, 1) @ poles)
            for kv, t, poles in ((z.kv_u, u, x), (z.kv_v, v, y))
        )
        by_u = z.grid(u, v, (1, 0)) * per_v
        by_v = z.grid(u, v, (0, 1)) * per_u[:, None]
        base = per_u[:, None] * per_v
        if self.origin is None:
            size: Floats = np.sqrt(by_u * by_u + by_v * by_v + base * base)
            return size
        a, b, c = self.origin
        values: Floats = (z.grid(u, v) - c) * base - (across - a)[:, None] * by_u - (along - b) * by_v
        return values

    def _of(self, x: Floats, by_u: Floats, by_v: Floats) -> Floats:
        normal = np.cross(by_u, by_v)
        if self.origin is None:
            size: Floats = np.linalg.norm(normal, axis=-1)
            return size
        values: Floats = np.einsum("...k,...k->...", x - self.origin, normal)
        return values


def _flux(face: BrepFace, edges: Mapping[int, BrepEdge], origin: Floats, size: float) -> float:
    """Return the integral of (X - O) . n dA, n the outward normal."""
    sign = 1.0 if face.outward else -1.0
    if face.plane is not None:
        point, normal, _ = face.plane
        height = float((point - origin) @ normal / np.linalg.norm(normal))
        return sign * height * _plane_area(face, face.plane, edges)
    surface = face.surface
    density = Density(face, origin)
    exact = None
    if isinstance(surface, BSplineSurface):
        p, q = surface.kv_u.degree, surface.kv_v.degree
        lines = surface.kv_u.breaks, surface.kv_v.breaks
        if _is_whole(face, surface, edges):
            return sign * grid_integral(density, *lines, (3 * p // 2 + 1, 3 * q // 2 + 1))
        exact = 3 * p // 2 + 1, 3 * q
    loops = _loops(face, edges)
    _require_on_face(face, loops)
    return _converged(face, _estimates(density, loops, exact), FLUX * size**3)


def _area(face: BrepFace, edges: Mapping[int, BrepEdge]) -> float:
    if face.plane is not None:
        return _plane_area(face, face.plane, edges)
    surface = face.surface
    density = Density(face)
    if isinstance(surface, BSplineSurface) and _is_whole(face, surface, edges):
        p, q = surface.kv_u.degree, surface.kv_v.degree
        lines = surface.kv_u.breaks, surface.kv_v.breaks
        return _converged(face, lambda more: grid_integral(density, *lines, (p + more, q + more)))
    return abs(_converged(face, _estimates(density, _loops(face, edges))))


def _converged(face: BrepFace, estimate: Callable[[int], float], within: float = 0.0) -> float:
    """Return an integral that two numbers of nodes agree on, within a number or 1e-10 of it."""
    before = np.inf
    more = 2
    while more <= MORE_NODES:
        value = estimate(more)
        if abs(value - before) <= (within or ACCURACY * abs(value)):
            return value
        before = value
        more = more + max(2, more // 2)
    raise ValueError(f"the measure of face #{face.number} needs more than {MORE_NODES} nodes per span")


def _loops(face: BrepFace, edges: Mapping[int, BrepEdge]) -> list[Passage]:
    """Return the edges of all loops of a face in its parameters."""
    loops = boundary(face, edges)
    if loops is None:
        raise NotMeasured(f"the edges of face #{face.number} must have images in its parameters that close")
    return [passage for loop in loops for passage in loop]


def _require_on_face(face: BrepFace, loops: Sequence[Passage]) -> None:
    """Raise NotMeasured unless the edges lie where their images say, at some points, and end at
    their vertices."""
    for passage in loops:
        edge = passage.edge
        t = np.linspace(*passage.span, SMOOTH_NODES)
        points = edge.points(t)
        on_face = face.points(*_inside(face, passage.points(t)).T)
        off = max(abs(on_face - points).max(), abs(points[[0, -1]] - edge.ends).max())
        if not off <= MATCH:
            raise NotMeasured(f"the edges of face #{face.number} must lie on it, got {off:.3g} beside it")


def _estimates(
    density: Density, loops: Sequence[Passage], exact: tuple[int, int] | None = None
) -> Callable[[int], float]:
    """Return the integral over the region within loops as function of how many more nodes are taken; with
    exact numbers of nodes on the cells, only those along the edges grow."""
    face = density.face
    lines = _lines(face, loops)
    pieces = [passage.pieces(lines) for passage in loops]
    # along v such a face is straight and equally wide: integrals in v are the density's multiples
    straight = face.cylinder is not None or face.extrusion is not None

    @cache
    def primitive(nodes: tuple[int, int]) -> Primitive:
        return Primitive(density, *lines, nodes)

    def estimate(more: int) -> float:
        nodes = exact or (SMOOTH_NODES // 2 + more,) * 2
        fewest = 1 if exact else SMOOTH_NODES // 4  # edges of a spline face are cut at all of its knots
        total = 0.0
        for passage, breaks in zip(loops, pieces):
            t, weights = gauss_rule(breaks, fewest + more)
            rate = weights * (-passage.rates(t)[:, 0] if straight else passage.rates(t)[:, 1])
            if rate.any():
                u, v = _inside(face, passage.points(t)).T
                inner = (v - lines[1][0]) * density(u, v) if straight else primitive(nodes)(u, v)
                part = float(rate @ inner)
                total += part if passage.along else -part
        return total

    return estimate


def _inside(face: BrepFace, points: Floats) -> Floats:
    """Return parameters (u, v), those that rounding put beside the rectangle of a spline moved onto it."""
    for axis, kv in enumerate(knots(face)):
        points[:, axis] = np.clip(points[:, axis], kv.start, kv.stop)
    return points


def _lines(face: BrepFace, loops: Sequence[Passage]) -> tuple[Floats, Floats]:
    """Return lines u = u_i and v = v_j round loops between which a face is smooth: the knots of a spline, and
    on other faces pieces of a turn."""
    points = np.concatenate([passage.samples() for passage in loops])
    lines = []
    for axis, (low, high) in enumerate(zip(points.min(axis=0), points.max(axis=0))):
        if face.surface is not None:
            breaks = knots(face)[axis].breaks
            first, last = np.searchsorted(breaks, [low, high])
            lines.append(breaks[max(first - 2, 0) : last + 2])  # samples may miss the extremes by a span
        else:
            slack = (high - low) / SMOOTH_NODES
            if face.turns[axis] and not high - low < MOST_TURNS * TURN:
                raise ValueError(f"face #{face.number} must not go round more than {MOST_TURNS} times")
            count = int(np.ceil((high - low) / PIECE)) if face.turns[axis] else SMOOTH_PIECES
            row = np.linspace(low - slack, high + slack, count + 1)
            swept = face.extrusion.curve.kv if face.extrusion is not None and axis == 0 else None
            lines.append(row if swept is None else np.union1d(row, swept.breaks))
    return lines[0], lines[1]


def _is_whole(face: BrepFace, surface: BSplineSurface, edges: Mapping[int, BrepEdge]) -> bool:
    """Return whether the edges of a spline face are the four sides of its rectangle."""
    kv_u = surface.kv_u
    kv_v = surface.kv_v
    net = surface.coefficients
    sides = [(kv_u, net[:, 0]), (kv_u, net[:, -1]), (kv_v, net[0]), (kv_v, net[-1])]
    if len(face.loops) == 1 and len(face.loops[0]) == 4:
        for number, _ in face.loops[0]:
            sides = [side for side in sides if not _covers(edges[number], *side)]
    return not sides


def _covers(edge: BrepEdge, kv: KnotVector, poles: Floats) -> bool:
    """Return whether an edge is the spline (kv, poles), of which it may lack some knots, run in either
    direction."""
    if edge.poles is None or edge.weights is not None:
        return False
    curve = edge.kv or UNIT
    points = edge.poles if edge.kv else edge.ends
    if not _same(edge.ends, points[[0, -1]]):
        return False
    if _same(poles[[0, -1]], points[[-1, 0]]):
        curve = KnotVector(curve.degree, 0.0 - curve.knots[::-1])
        points = points[::-1]
    if curve.degree != kv.degree or not _same(poles[[0, -1]], points[[0, -1]]):
        return False
    curve = curve.rescale(kv.start, kv.stop)
    both = curve.merge(kv)
    return _same(curve.prolongation(both) @ points, kv.prolongation(both) @ poles)


def _same(a: Floats, b: Floats) -> bool:
    return bool((abs(a - b) <= MATCH).all())


def _plane_area(face: BrepFace, plane: Floats, edges: Mapping[int, BrepEdge]) -> float:
    """Return |1/2 n . integral of X x dX| around the loops of a plane face."""
    point, normal, _ = plane
    twice = np.zeros(3)
    for number, along in (use for loop in face.loops for use in loop):
        t, weights = _rule(edges[number])
        part = weights @ np.cross(edges[number].points(t) - point, edges[number].points(t, 1))
        twice += part if along else -part
    return abs(float(twice @ normal)) / (2 * float(np.linalg.norm(normal)))


def _rule(edge: BrepEdge) -> tuple[Floats, Floats]:
    """Return a Gauss rule along an edge for X x dX: exact for lines and splines, and for others to rounding
    errors; raise NotMeasured for an unknown curve."""
    span = edge_span(edge)
    if span is None:
        raise NotMeasured(f"edge #{edge.number} must be a line, a spline or a conic")
    breaks = np.unique(np.clip([*span, *(edge.kv.breaks if edge.kv else ())], *span))
    if edge.conic is None and edge.weights is None:
        return gauss_rule(breaks, edge.kv.degree if edge.kv else 1)
    quarters = np.linspace(breaks[:-1], breaks[1:], 8, endpoint=False).T.ravel()
    return gauss_rule(np.r_[quarters, breaks[-1]], SMOOTH_NODES)
