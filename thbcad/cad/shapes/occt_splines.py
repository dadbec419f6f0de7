"""Splines as OCCT geometry and back, bit for bit.

The numbers of a surface go over together, in OCCT's own binary format: one by one they take longer than OCCT
needs to read or to write the file.
"""

import io
import struct
from collections.abc import Sequence
from typing import Any

import numpy as np
from OCP.BinTools import BinTools_SurfaceSet
from OCP.Geom import Geom_BSplineCurve, Geom_BSplineSurface
from OCP.Geom2d import Geom2d_BSplineCurve
from OCP.GeomAPI import GeomAPI
from OCP.gp import gp_Pln, gp_Pnt

from thbcad.cad.occt_names import IntegerArray, PointArray, RealArray
from thbcad.checks import Floats
from thbcad.splines import BSplineCurve, BSplineSurface, KnotVector, NURBSCurve, NURBSSurface

TOLERANCE = 1e-7  # mm, OCCT's default confusion
# of one surface in OCCT's binary format: what stands before it, its kind, whether it is rational and periodic
# in u and v, its degrees, and how many poles and knots it has; poles and knots follow
BEFORE, SPLINE, HEAD = b"Surfaces 1\n", 9, struct.Struct("<B4?2h4i")
KNOTS = [("value", "<f8"), ("count", "<i4")]


def geom_surface(surface: BSplineSurface) -> Geom_BSplineSurface:
    """Return a three-component BSplineSurface as Geom_BSplineSurface."""
    (ku, mu), (kv, mv) = (_knots(k) for k in (surface.kv_u, surface.kv_v))
    linear = _linear(surface.coefficients)  # holds the poles as long as they are read
    return Geom_BSplineSurface(linear.Poles(), ku, kv, mu, mv, surface.kv_u.degree, surface.kv_v.degree)


def _linear(poles: Floats) -> Geom_BSplineSurface:
    """Return the surface of degree 1 with some poles, (m, n, 3)."""
    counts = poles.shape[:2]
    parts = [BEFORE, HEAD.pack(SPLINE, *[False] * 4, 1, 1, *counts, *counts), poles.astype("<f8").tobytes()]
    for count in counts:
        times = np.bincount([0, *range(count), count - 1])
        parts.append(np.rec.fromarrays([np.arange(count), times], dtype=KNOTS).tobytes())
    read = BinTools_SurfaceSet()
    read.Read(io.BytesIO(b"".join(parts)))
    return read.Surface(1)


def rational_geom(surface: NURBSSurface) -> Geom_BSplineSurface:
    """Return a NURBSSurface as Geom_BSplineSurface; equal weights make a polynomial one."""
    geom = geom_surface(BSplineSurface(surface.kv_u, surface.kv_v, surface.coefficients))
    if np.ptp(surface.weights) == 0:
        return geom
    for i, weights in enumerate(surface.weights.tolist(), 1):
        geom.SetWeightRow(i, _filled(RealArray, weights))
    return geom


def geom_curve(kv: KnotVector, poles: Floats) -> Geom_BSplineCurve:
    """Return the spline curve with poles (n, 3) as Geom_BSplineCurve."""
    return Geom_BSplineCurve(_row_of_points(poles), *_knots(kv), kv.degree)


def rational_geom_curve(curve: NURBSCurve) -> Geom_BSplineCurve:
    """Return a NURBSCurve with points (n, 3) as Geom_BSplineCurve; equal weights make a polynomial one."""
    if np.ptp(curve.weights) == 0:
        return geom_curve(curve.kv, curve.coefficients)
    weights = _filled(RealArray, curve.weights.tolist())
    return Geom_BSplineCurve(_row_of_points(curve.coefficients), weights, *_knots(curve.kv), curve.kv.degree)


def trace(kv: KnotVector, poles: Floats) -> Geom2d_BSplineCurve:
    """Return a spline with poles (n, 2) as a curve in the parameters of a face."""
    return GeomAPI.To2d_s(geom_curve(kv, np.column_stack([poles, np.zeros(len(poles))])), gp_Pln())


def spline_surface(geom: Geom_BSplineSurface) -> BSplineSurface | NURBSSurface:
    """Return a Geom_BSplineSurface with the very numbers of the file; a periodic one is cut at its ends."""
    geom = geom.Copy()
    geom.SetUNotPeriodic()
    geom.SetVNotPeriodic()
    ends = geom.FirstUKnotIndex(), geom.FirstVKnotIndex(), geom.LastUKnotIndex(), geom.LastVKnotIndex()
    if ends != (1, 1, geom.NbUKnots(), geom.NbVKnots()):
        geom.Segment(*geom.Bounds())  # clamps the knots; drops spans below 1e-9
    kv_u = KnotVector(geom.UDegree(), [*geom.UKnotSequence()])
    kv_v = KnotVector(geom.VDegree(), [*geom.VKnotSequence()])
    written, text = BinTools_SurfaceSet(), io.BytesIO()
    written.Add(geom)
    written.Write(text)
    rational, shape = geom.IsURational() or geom.IsVRational(), (geom.NbUPoles(), geom.NbVPoles())
    size = 4 if rational else 3
    rows = np.frombuffer(text.getbuffer(), "<f8", size * shape[0] * shape[1], len(BEFORE) + HEAD.size)
    net = rows.reshape(*shape, size).astype(np.float64)
    if not rational:
        return BSplineSurface(kv_u, kv_v, net)
    return NURBSSurface(kv_u, kv_v, net[..., :3], net[..., 3])


def spline_curve(geom: Geom_BSplineCurve, first: float, last: float) -> BSplineCurve | NURBSCurve:
    """Return the piece from `first` to `last` of a Geom_BSplineCurve; the whole has the very numbers of the
    file."""
    geom = geom.Copy()
    if geom.IsPeriodic():
        geom.SetOrigin(first, TOLERANCE)
        geom.SetNotPeriodic()
    clamped = all(geom.Multiplicity(k) == geom.Degree() + 1 for k in (1, geom.NbKnots()))
    if not clamped or (first, last) != (geom.FirstParameter(), geom.LastParameter()):
        geom.Segment(first, last)  # clamps the knots; drops spans below 1e-9
    kv = KnotVector(geom.Degree(), [*geom.KnotSequence()])
    points = np.array([pole.Coord() for pole in geom.Poles()])
    if not geom.IsRational():
        return BSplineCurve(kv, points)
    weights = RealArray(1, len(points))
    geom.Weights(weights)
    return NURBSCurve(kv, points, np.array([*weights]))


def _filled(kind: Any, values: Sequence[Any]) -> Any:
    """Return an array of OCCT of some kind that holds values."""
    array = kind(1, len(values))
    for k, value in enumerate(values, 1):
        array.SetValue(k, value)
    return array


def _row_of_points(poles: Floats) -> PointArray:
    return _filled(PointArray, [gp_Pnt(*point) for point in poles.tolist()])


def _knots(kv: KnotVector) -> tuple[RealArray, IntegerArray]:
    values, counts = np.unique(kv.knots, return_counts=True)
    return _filled(RealArray, values.tolist()), _filled(IntegerArray, counts.tolist())
