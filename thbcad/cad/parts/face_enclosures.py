"""Points whose convex hulls hold the faces and edges of any solid, piece by piece.

Planes, cylinders, cones, spheres and tori are rational Bezier patches over every rectangle of their own
parameters, splines are Bezier patches between their knots, and circles and spline curves likewise: the hull
of the control points holds the piece, and shrinks with it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve, BRepAdaptor_Surface
from OCP.BRepTools import BRepTools
from OCP.Geom import Geom_BSplineSurface, Geom_RectangularTrimmedSurface, Geom_TrimmedCurve
from OCP.GeomAbs import (
    GeomAbs_BSplineCurve,
    GeomAbs_Circle,
    GeomAbs_Cone,
    GeomAbs_Cylinder,
    GeomAbs_Ellipse,
    GeomAbs_Sphere,
    GeomAbs_Torus,
)
from OCP.GeomConvert import GeomConvert
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face

from thbcad.cad.exchange import OCCT_ERRORS
from thbcad.cad.shapes import spline_surface
from thbcad.checks import MAX_DEGREE, Floats, Integers
from thbcad.splines import BSplineSurface, KnotVector, NURBSSurface

QUARTER = np.pi / 2  # of a turn: arcs whose control points stay near
ROUNDING = 1e-6  # of a spline's interval; OCCT widens the rectangles of parameters


@dataclass(frozen=True, eq=False)
class Pieces:
    """A face or an edge over intervals of its parameters.

    roots : (n, 2 d) float, low and high of each of d parameters
    nets : from cells (n, 2 d) within the roots to points (n, k, 3), mm, whose hulls hold them
    own : whether the parameters are those of the face
    """

    roots: Floats
    nets: Callable[[Floats], Floats]
    own: bool = True


def edge_pieces(edge: TopoDS_Edge) -> Pieces | None:
    """Return the Pieces of an edge; None of a curve that is not known here."""
    curve = BRepAdaptor_Curve(edge)
    kind, ends = curve.GetType(), (curve.FirstParameter(), curve.LastParameter())
    if kind in (GeomAbs_Circle, GeomAbs_Ellipse):
        conic = curve.Circle() if kind == GeomAbs_Circle else curve.Ellipse()
        radii = (
            (conic.Radius(),) * 2 if kind == GeomAbs_Circle else (conic.MajorRadius(), conic.MinorRadius())
        )
        frame = conic.Position()
        rows = np.array([a.Coord() for a in (frame.Location(), frame.XDirection(), frame.YDirection())])
        rows[1:] *= np.array(radii)[:, None]
        return Pieces(_intervals(*ends, QUARTER), lambda cells: rows[0] + _arcs(cells) @ rows[1:])
    if kind == GeomAbs_BSplineCurve:
        return _curve_pieces(curve.BSpline(), *ends)
    try:  # lines, parabolas and hyperbolas are rational splines, too
        cut = Geom_TrimmedCurve(BRep_Tool.Curve_s(edge, *ends), *ends)
        spline = GeomConvert.CurveToBSplineCurve_s(cut)
    except OCCT_ERRORS:
        return None
    return _curve_pieces(spline, spline.FirstParameter(), spline.LastParameter())


def face_pieces(face: TopoDS_Face) -> Pieces | None:
    """Return the Pieces of the surface of a face over the rectangle of parameters round it; None of a surface
    that is not known here."""
    low_u, high_u, low_v, high_v = BRepTools.UVBounds_s(face)
    surface = BRepAdaptor_Surface(face)
    kind = surface.GetType()
    if kind in (GeomAbs_Cylinder, GeomAbs_Cone, GeomAbs_Sphere, GeomAbs_Torus):
        across = _intervals(low_u, high_u, QUARTER)
        straight = kind in (GeomAbs_Cylinder, GeomAbs_Cone)
        along = np.array([[low_v, high_v]]) if straight else _intervals(low_v, high_v, QUARTER)
        return Pieces(_cells(across, along), _revolved(surface, kind))
    geometry = BRep_Tool.Surface_s(face)
    own = isinstance(geometry, Geom_BSplineSurface)
    if not own:
        try:
            cut = Geom_RectangularTrimmedSurface(geometry, low_u, high_u, low_v, high_v)
            geometry = GeomConvert.SurfaceToBSplineSurface_s(cut)
        except OCCT_ERRORS:  # what OCCT cannot convert has no control points
            return None
    box = (low_u, high_u, low_v, high_v) if own else None
    if max(geometry.UDegree(), geometry.VDegree()) > MAX_DEGREE:
        return _spline_pieces(*_high_spline(geometry), box, own)
    surface = spline_surface(geometry)
    if isinstance(surface, BSplineSurface):
        surface = NURBSSurface.from_bspline(surface)
    return _spline_pieces((surface.kv_u, surface.kv_v), surface.homogeneous.coefficients, box, own)


def split(cells: Floats) -> Floats:
    """Return cells halved in each of their parameters."""
    for axis in range(0, cells.shape[1], 2):
        middle = cells[:, axis : axis + 2].mean(axis=1)
        low, high = cells.copy(), cells.copy()
        low[:, axis + 1] = high[:, axis] = middle
        cells = np.concatenate([low, high])
    return cells


def _intervals(low: float, high: float, most: float) -> Floats:
    ends = np.linspace(low, high, max(1, int(np.ceil((high - low) / most))) + 1)
    return np.stack([ends[:-1], ends[1:]], axis=1)


def _cells(across: Floats, along: Floats) -> Floats:
    return np.array([[*u, *v] for u in across.tolist() for v in along.tolist()]).reshape(-1, 4)


def _arcs(cells: Floats) -> Floats:
    """Return the control points of unit circles over intervals of the angle, (n, 3, 2)."""
    low, high = cells.T
    angles = np.stack([low, (low + high) / 2, high], axis=1)
    radius = np.ones_like(angles)
    radius[:, 1] = 1 / np.cos((high - low) / 2)
    return radius[..., None] * np.stack([np.cos(angles), np.sin(angles)], axis=-1)


def _revolved(surface: Any, kind: Any) -> Callable[[Floats], Floats]:
    """Return the nets of O + r(v) (cos u X + sin u Y) + h(v) Z: r and h are linear, or those of an arc."""
    name = {GeomAbs_Cylinder: "Cylinder", GeomAbs_Cone: "Cone", GeomAbs_Sphere: "Sphere"}.get(kind, "Torus")
    shape = getattr(surface, name)()
    frame = shape.Position()
    axes = frame.XDirection(), frame.YDirection(), frame.Direction()
    origin, (x, y, z) = np.array(frame.Location().Coord()), np.array([axis.Coord() for axis in axes])
    if kind == GeomAbs_Torus:
        outer, inner, slant = shape.MajorRadius(), shape.MinorRadius(), 0.0
    elif kind == GeomAbs_Sphere:
        outer, inner, slant = 0.0, shape.Radius(), 0.0
    else:
        outer = shape.RefRadius() if kind == GeomAbs_Cone else shape.Radius()
        inner, slant = 0.0, shape.SemiAngle() if kind == GeomAbs_Cone else 0.0

    def nets(cells: Floats) -> Floats:
        round_, v = _arcs(cells[:, :2]), cells[:, 2:]
        if inner:
            arc = _arcs(v)
            radius, height = outer + inner * arc[..., 0], inner * arc[..., 1]
        else:
            radius, height = outer + v * np.sin(slant), v * np.cos(slant)
        across = round_ @ np.stack([x, y])
        points = radius[:, None, :, None] * across[:, :, None] + height[:, None, :, None] * z
        return origin + points.reshape(len(cells), -1, 3)

    return nets


@dataclass(frozen=True, eq=False)
class _Knots:
    """Those of a spline with clamped ends, of any degree: OCCT makes 14 at roundings."""

    degree: int
    knots: Floats

    @property
    def start(self) -> float:
        return float(self.knots[0])

    @property
    def stop(self) -> float:
        return float(self.knots[-1])

    @property
    def breaks(self) -> Floats:
        return np.unique(self.knots)


def _within(kv: KnotVector | _Knots, low: float, high: float) -> bool:
    """Return whether an interval lies in that of a spline; of a periodic one it need not."""
    slack = ROUNDING * (kv.stop - kv.start)
    return low >= kv.start - slack and high <= kv.stop + slack


def _high_spline(surface: Geom_BSplineSurface) -> tuple[tuple[_Knots, _Knots], Floats]:
    """Return the knots of a spline in both directions, and its poles w x, w y, w z, w, (n, m, 4)."""
    surface = surface.Copy()
    surface.SetUNotPeriodic()
    surface.SetVNotPeriodic()
    u, v = np.array([*surface.UKnotSequence()]), np.array([*surface.VKnotSequence()])
    full = np.empty((surface.NbUPoles(), surface.NbVPoles(), 4))
    for i, j in np.ndindex(full.shape[:2]):
        weight = surface.Weight(i + 1, j + 1)
        full[i, j] = *(weight * np.array(surface.Pole(i + 1, j + 1).Coord())), weight
    return (_Knots(surface.UDegree(), u), _Knots(surface.VDegree(), v)), full


def _spline_pieces(
    kvs: Sequence[KnotVector | _Knots], full: Floats, box: tuple[float, ...] | None, own: bool
) -> Pieces | None:
    limits = box or (kvs[0].start, kvs[0].stop, kvs[1].start, kvs[1].stop)
    ends = limits[:2], limits[2:]
    if not all(_within(kv, *pair) for kv, pair in zip(kvs, ends)):
        return None
    roots = [_spans(kv, *pair) for kv, pair in zip(kvs, ends)]

    def nets(cells: Floats) -> Floats:
        (by_u, i), (by_v, j) = (_blossoms(kv, cells[:, 2 * k : 2 * k + 2]) for k, kv in enumerate(kvs))
        p, q = by_u.shape[2], by_v.shape[2]
        local = full[(i[:, None] + np.arange(p))[:, :, None], (j[:, None] + np.arange(q))[:, None]]
        points = np.einsum("nap,npqc,nbq->nabc", by_u, local, by_v).reshape(len(cells), -1, 4)
        return points[..., :3] / points[..., 3:]

    return Pieces(_cells(*roots), nets, own)


def _curve_pieces(curve: Any, low: float, high: float) -> Pieces | None:
    curve = curve.Copy()
    if curve.IsPeriodic():
        curve.SetNotPeriodic()
    weights = np.array([curve.Weight(k) for k in range(1, curve.NbPoles() + 1)])
    full = np.column_stack([weights[:, None] * [pole.Coord() for pole in curve.Poles()], weights])
    kv = _Knots(curve.Degree(), np.array([*curve.KnotSequence()]))
    if not _within(kv, low, high):
        return None

    def nets(cells: Floats) -> Floats:
        by_t, i = _blossoms(kv, cells)
        points = np.einsum("nap,npc->nac", by_t, full[i[:, None] + np.arange(by_t.shape[2])])
        return points[..., :3] / points[..., 3:]

    return Pieces(_spans(kv, low, high), nets)


def _spans(kv: KnotVector | _Knots, low: float, high: float) -> Floats:
    """Return the intervals between knots from low to high."""
    low, high = max(low, kv.start), min(high, kv.stop)
    ends = np.unique(np.clip(kv.breaks, low, high))
    return np.stack([ends[:-1], ends[1:]], axis=1)


def _blossoms(kv: KnotVector | _Knots, cells: Floats) -> tuple[Floats, Integers]:
    """Return the matrices from the p + 1 poles of a span to the Bezier points over intervals in it,
    (n, p + 1, p + 1), and the numbers of the first of these poles, (n,).

    The k-th Bezier point over [a, b] is the blossom of the spline at a, p - k times, and b, k times.
    """
    p, knots = kv.degree, kv.knots
    low, high = cells.T
    middle = cells.mean(axis=1)
    span = np.clip(np.searchsorted(knots, middle, side="right") - 1, p, len(knots) - p - 2)
    rows = []
    for k in range(p + 1):
        poles = np.broadcast_to(np.eye(p + 1), (len(cells), p + 1, p + 1))  # (n, pole, of which)
        for r in range(p):
            t = low if r < p - k else high
            first = span[:, None] - p + r + 1 + np.arange(p - r)
            left, right = knots[first], knots[first + p - r]
            share = ((t[:, None] - left) / (right - left))[..., None]
            poles = (1 - share) * poles[:, :-1] + share * poles[:, 1:]
        rows.append(poles[:, 0])
    return np.stack(rows, axis=1), span - p
