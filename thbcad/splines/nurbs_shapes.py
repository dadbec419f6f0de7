"""Exact rational curves and surfaces: circular arcs, conic sections, revolution, ruled surfaces.

Source: L. Piegl and W. Tiller, The NURBS Book, chapters 7 and 8.
"""

import numpy as np
from numpy.typing import ArrayLike

from thbcad.checks import floats, require_number, require_type
from thbcad.splines.bsplines import BSplineSurface
from thbcad.splines.knot_vector import QUADRATIC, UNIT, KnotVector
from thbcad.splines.nurbs import NURBSCurve, NURBSSurface


def line(start: ArrayLike, stop: ArrayLike) -> NURBSCurve:
    """Return the straight segment (1 - u) start + u stop over [0, 1]; start and stop (d,)."""
    return NURBSCurve(UNIT, np.array([floats(start), floats(stop)]))


def circular_arc(
    radius: float, angle: float = 2 * np.pi, start: float = 0.0, centre: ArrayLike = (0.0, 0.0)
) -> NURBSCurve:
    """Return the arc of a circle in the plane, from the angle `start` to `start + angle`, over [0, 1].

    Quadratic, with the fewest segments of at most 120 degrees: then no weight is less than 1/2.
    A segment of the angle 2 a has the weights 1, cos a, 1; its middle point lies at radius / cos a.

    radius : float, mm.  angle, start : float, rad; a negative angle runs clockwise.  centre : (2,) float, mm.

    Raises ValueError : radius not positive; angle 0 or of more than one turn.

    Source: The NURBS Book, 7.5.
    """
    require_number("radius", radius, above=0, finite=True)
    for name, value in (("angle", angle), ("start", start)):
        require_number(name, value, finite=True)
    if not 0 < abs(angle) <= 2 * np.pi:
        raise ValueError(f"angle must be at most one turn (2 pi) and not 0, got {angle}")
    segments = int(np.ceil(abs(angle) / (2 * np.pi) * 3))
    at = angle * (np.arange(2 * segments + 1) / (2 * segments))
    weights = np.where(np.arange(len(at)) % 2, np.cos(angle / (2 * segments)), 1.0)
    cos, sin = np.cos(start), np.sin(start)
    points = (
        radius
        * np.stack([cos * np.cos(at) - sin * np.sin(at), sin * np.cos(at) + cos * np.sin(at)], axis=1)
        / weights[:, None]
    )
    if abs(angle) == 2 * np.pi:
        points[-1] = points[0]
    breaks = np.arange(segments + 1) / segments
    return NURBSCurve(
        KnotVector(2, np.repeat(breaks, [3, *[2] * (segments - 1), 3])), points + floats(centre), weights
    )


def conic_arc(start: ArrayLike, middle: ArrayLike, stop: ArrayLike, weight: float) -> NURBSCurve:
    """Return the conic section from `start` to `stop`, with tangents that meet in `middle`, over [0, 1].

        C(u) = ((1-u)^2 P_0 + 2 u (1-u) w P_1 + u^2 P_2) / ((1-u)^2 + 2 u (1-u) w + u^2)

    It is an ellipse for a weight below 1, a parabola for 1 and a hyperbola above.

    start, middle, stop : (d,) float.

    Raises ValueError : weight not positive.

    Source: The NURBS Book, 7.3.
    """
    points = np.array([floats(point) for point in (start, middle, stop)])
    return NURBSCurve(QUADRATIC, points, np.array([1.0, weight, 1.0]))


def revolved(curve: NURBSCurve, angle: float = 2 * np.pi) -> NURBSSurface:
    """Return the surface of a curve turned about the z axis: u along the curve, v in [0, 1] around the axis.

        S(u, v) = (x a - y b, x b + y a, z),  (x, y, z) = C(u), (a, b) = the unit arc at v

    curve : with points (r, z) in the half-plane y = 0 or (x, y, z) in space.  angle : float, rad.

    Raises ValueError : points of another dimension; angle 0 or of more than one turn.

    Source: The NURBS Book, 8.5.
    """
    require_type("curve", curve, NURBSCurve)
    if curve.coefficients.shape[1] not in (2, 3):
        raise ValueError(
            f"curve must have points (r, z) or (x, y, z), got {curve.coefficients.shape[1]} components"
        )
    arc = circular_arc(1.0, angle)
    x, z = curve.coefficients[:, :1], curve.coefficients[:, -1:]
    y = curve.coefficients[:, 1:2] if curve.coefficients.shape[1] == 3 else 0 * x
    a, b = arc.coefficients.T
    points = np.stack([x * a - y * b, x * b + y * a, np.broadcast_to(z, (len(z), len(a)))], axis=-1)
    return NURBSSurface(curve.kv, arc.kv, points, np.outer(curve.weights, arc.weights))


def ruled(curve: NURBSCurve, other: NURBSCurve) -> NURBSSurface:
    """Return the surface of the straight lines between points of equal parameters, v in [0, 1] from `curve`
    to `other`.

    It is linear in v in homogeneous coordinates.  Degrees are elevated and knots inserted until both agree.

    Raises ValueError : the parameters run over different intervals; points of different dimensions.

    Source: The NURBS Book, 8.4.
    """
    for name, c in (("curve", curve), ("other", other)):
        require_type(name, c, NURBSCurve)
    ends = [(c.kv.start, c.kv.stop) for c in (curve, other)]
    if ends[0] != ends[1]:
        raise ValueError(f"the curves must have the same interval of parameters, got {ends[0]} and {ends[1]}")
    if curve.coefficients.shape[1] != other.coefficients.shape[1]:
        raise ValueError(
            f"the curves must have points of the same dimension, got {curve.coefficients.shape[1]} and "
            f"{other.coefficients.shape[1]}"
        )
    curve, other = curve.elevate(other.kv.degree), other.elevate(curve.kv.degree)
    kv = curve.kv.merge(other.kv)
    rows = np.stack([c.kv.prolongation(kv) @ c.net for c in (curve, other)], axis=1)
    return NURBSSurface.from_homogeneous(BSplineSurface(kv, UNIT, rows))
