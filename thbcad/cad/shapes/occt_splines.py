"""Splines as OCCT geometry and back, bit for bit."""

from collections.abc import Callable
from itertools import chain

import numpy as np
from OCP.Geom import Geom_BSplineCurve, Geom_BSplineSurface
from OCP.Geom2d import Geom2d_BSplineCurve
from OCP.GeomAPI import GeomAPI
from OCP.gp import gp_Pln, gp_Pnt
from OCP.TColgp import TColgp_Array1OfPnt, TColgp_Array2OfPnt
from OCP.TColStd import TColStd_Array1OfInteger, TColStd_Array1OfReal

from thbcad.checks import Floats
from thbcad.splines import BSplineCurve, BSplineSurface, KnotVector, NURBSCurve, NURBSSurface

TOLERANCE = 1e-7  # mm, OCCT's default confusion


def geom_surface(surface: BSplineSurface) -> Geom_BSplineSurface:
    """Return a three-component BSplineSurface as Geom_BSplineSurface."""
    poles = surface.coefficients
    array = TColgp_Array2OfPnt(1, poles.shape[0], 1, poles.shape[1])
    put = array.SetValue
    for i, row in enumerate(np.moveaxis(poles, 2, 1), 1):
        for j, (x, y, z) in enumerate(zip(*row.tolist()), 1):
            put(i, j, gp_Pnt(x, y, z))
    (ku, mu), (kv, mv) = (_knots(k) for k in (surface.kv_u, surface.kv_v))
    return Geom_BSplineSurface(array, ku, kv, mu, mv, surface.kv_u.degree, surface.kv_v.degree)


def rational_geom(surface: NURBSSurface) -> Geom_BSplineSurface:
    """Return a NURBSSurface as Geom_BSplineSurface; equal weights make a polynomial one."""
    geom = geom_surface(BSplineSurface(surface.kv_u, surface.kv_v, surface.coefficients))
    if np.ptp(surface.weights) == 0:
        return geom
    row = TColStd_Array1OfReal(1, surface.kv_v.dim)
    for i, weights in enumerate(surface.weights.tolist(), 1):
        for j, weight in enumerate(weights, 1):
            row.SetValue(j, weight)
        geom.SetWeightRow(i, row)
    return geom


def geom_curve(kv: KnotVector, poles: Floats) -> Geom_BSplineCurve:
    """Return the spline curve with poles (n, 3) as Geom_BSplineCurve."""
    return Geom_BSplineCurve(_row_of_points(poles), *_knots(kv), kv.degree)


def rational_geom_curve(curve: NURBSCurve) -> Geom_BSplineCurve:
    """Return a NURBSCurve with points (n, 3) as Geom_BSplineCurve; equal weights make a polynomial one."""
    if np.ptp(curve.weights) == 0:
        return geom_curve(curve.kv, curve.coefficients)
    weights = TColStd_Array1OfReal(1, curve.kv.dim)
    for k, weight in enumerate(curve.weights.tolist(), 1):
        weights.SetValue(k, weight)
    return Geom_BSplineCurve(_row_of_points(curve.coefficients), weights, *_knots(curve.kv), curve.kv.degree)


def trace(kv: KnotVector, poles: Floats) -> Geom2d_BSplineCurve:
    """Return a spline with poles (n, 2) as a curve in the parameters of a face."""
    return GeomAPI.To2d_s(geom_curve(kv, np.column_stack([poles, np.zeros(len(poles))])), gp_Pln())


def spline_surface(geom: Geom_BSplineSurface) -> BSplineSurface | NURBSSurface:
    """Return a Geom_BSplineSurface with the very numbers of the file; a periodic one is cut at its ends."""
    geom = geom.Copy()
    if geom.IsUPeriodic():
        geom.SetUNotPeriodic()
    if geom.IsVPeriodic():
        geom.SetVNotPeriodic()
    ends = [
        (geom.UDegree(), geom.UMultiplicity, geom.NbUKnots()),
        (geom.VDegree(), geom.VMultiplicity, geom.NbVKnots()),
    ]
    if any(multiplicity(k) != degree + 1 for degree, multiplicity, count in ends for k in (1, count)):
        geom.Segment(*geom.Bounds())  # clamps the knots; drops spans below 1e-9
    kv_u = _knot_vector(geom.UDegree(), geom.UKnot, geom.UMultiplicity, geom.NbUKnots())
    kv_v = _knot_vector(geom.VDegree(), geom.VKnot, geom.VMultiplicity, geom.NbVKnots())
    rows, columns = range(1, geom.NbUPoles() + 1), range(1, geom.NbVPoles() + 1)
    poles = (geom.Pole(i, j).Coord() for i in rows for j in columns)
    points = np.fromiter(chain.from_iterable(poles), np.float64, 3 * len(rows) * len(columns))
    points = points.reshape(len(rows), len(columns), 3)
    if not (geom.IsURational() or geom.IsVRational()):
        return BSplineSurface(kv_u, kv_v, points)
    return NURBSSurface(kv_u, kv_v, points, np.array([[geom.Weight(i, j) for j in columns] for i in rows]))


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
    kv = _knot_vector(geom.Degree(), geom.Knot, geom.Multiplicity, geom.NbKnots())
    numbers = range(1, geom.NbPoles() + 1)
    points = np.array([geom.Pole(k).Coord() for k in numbers])
    if not geom.IsRational():
        return BSplineCurve(kv, points)
    return NURBSCurve(kv, points, np.array([geom.Weight(k) for k in numbers]))


def _row_of_points(poles: Floats) -> TColgp_Array1OfPnt:
    array = TColgp_Array1OfPnt(1, len(poles))
    for k, (x, y, z) in enumerate(poles.tolist(), 1):
        array.SetValue(k, gp_Pnt(x, y, z))
    return array


def _knots(kv: KnotVector) -> tuple[TColStd_Array1OfReal, TColStd_Array1OfInteger]:
    values, counts = np.unique(kv.knots, return_counts=True)
    knots = TColStd_Array1OfReal(1, len(values))
    multiplicities = TColStd_Array1OfInteger(1, len(values))
    for k, (value, count) in enumerate(zip(values.tolist(), counts.tolist()), 1):
        knots.SetValue(k, value)
        multiplicities.SetValue(k, count)
    return knots, multiplicities


def _knot_vector(
    degree: int, knot: Callable[[int], float], multiplicity: Callable[[int], int], count: int
) -> KnotVector:
    numbers = range(1, count + 1)
    return KnotVector(degree, np.repeat([knot(k) for k in numbers], [multiplicity(k) for k in numbers]))
