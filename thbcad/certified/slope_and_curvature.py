"""Certified bounds of the slope and of the radii of curvature of a graph z(x, y).

With the gradient g = (z_x, z_y), W^2 = 1 + |g|^2 and the Hessian A of z, the principal curvatures
are the eigenvalues of the pencil A d = k N d, N = W (I + g g^T).

No curvature of a cell exceeds kappa >= 0 where A - kappa N has no positive eigenvalue.  Along a
direction e, with c = g . e, the second derivative of N is

    N'' = (W^2 - c^2) / W^3 (I + g g^T) + 2 c / W (e g^T + g e^T) + 2 W e e^T >= -|g|^2 / (2 W) I,

because e g^T + g e^T has the eigenvalues c +- |g|.  Hence, around any gradient g_0,

    N >= L - rho I,  L = N_0 + DN_0 (g - g_0),  rho = max |g|^2 / (4 W) |g - g_0|^2.

A - kappa L is linear in the derivatives of z and its greatest eigenvalue is convex: its greatest
value mu at the Bernstein coefficients bounds it on the cell.  As N >= W I, no curvature of the cell
exceeds kappa + max(mu + kappa rho, 0) / min W; nor max(nu, 0) / min W, with nu for kappa = 0.

Source: M. do Carmo, Differential Geometry of Curves and Surfaces, section 3-3.
"""

from dataclasses import dataclass, replace

import numpy as np

from thbcad.certified.bernstein_cells import Graph, bernstein
from thbcad.certified.extreme_values import Assessment, Enclosure, both_ends, greatest, reciprocal
from thbcad.certified.polynomial_cells import Cells, rounding, within
from thbcad.checks import EPS, Floats
from thbcad.outlines import Outline

ROUNDINGS = 40  # more than any entry or eigenvalue below takes
DERIVATIVES = ((1, 0), (0, 1), (2, 0), (1, 1), (0, 2))


@dataclass(frozen=True)
class LeastRadii:
    """Bounds of the least radius of curvature, in the unit of x, y and z.

    A side to which the graph bends nowhere has an infinite radius, at a position without meaning.

    concave : where z bends towards +z (positive second derivative)
    convex : where z bends towards -z
    """

    concave: Enclosure
    convex: Enclosure


def greatest_slope(graph: Graph, tolerance: float = 1e-9, outline: Outline | None = None) -> Enclosure:
    """Return certified bounds of the greatest slope |grad z| = sqrt(z_x^2 + z_y^2), to a relative tolerance.

    outline : Outline or None, only points inside count

    Raises ValueError : a graph that is not scalar, derivatives above 1e40.
    """
    steepest = greatest(within(bernstein(graph, ((1, 0), (0, 1))), outline), _slope, tolerance)
    return replace(steepest, lower=max(steepest.lower, 0.0))


def least_radii(graph: Graph, tolerance: float = 1e-6, outline: Outline | None = None) -> LeastRadii:
    """Return certified bounds of 1 / max k and -1 / min k over the principal curvatures k of z(x, y).

    outline : Outline or None, only points inside count

    The search ends at a relative `tolerance`.  Where the curvature is all but constant it ends
    earlier, with wider bounds that hold too.  Where the second derivatives jump both values count.
    A crease, at a knot of multiplicity p, has no curvature and is not seen.

    The bounds are those of the spline.  Where it stands for another surface, as for a sphere or another conic
    that is no paraboloid, heights agree within 1e-11 mm (`conic_graph`) but radii do not: that of a sphere of
    12 mm over |x|, |y| <= 8 mm is found in [11.998802, 11.999994].  CAD files hold the spline.

    Raises ValueError : degree 1, a graph that is not scalar, derivatives above 1e40.
    """
    bent = within(bernstein(graph, DERIVATIVES), outline)
    convex, concave = both_ends(bent, _curvature, tolerance)
    return LeastRadii(reciprocal(concave), reciprocal(convex))


def _slope(cells: Cells, best: float) -> Assessment:
    vectors, counts = cells.met()
    error = float(cells.error.sum() + rounding(4, cells.magnitude.sum()))
    values = np.where(counts, np.hypot(*vectors), -np.inf)
    upper = cells.most(np.hypot(*cells.coefficients)) + error
    return Assessment(values, error, upper, max(best, float(values.max(initial=0.0))))


def _curvature(cells: Cells, best: float) -> Assessment:
    """Assess max(k, 0) of the greater principal curvature k."""
    degrees = tuple(n - 1 for n in cells.coefficients.shape[1:3])
    if min(degrees) < 2:
        raise ValueError(f"curvature needs degree 2 or more in x and y, got degrees {degrees}")
    e_x, e_y, e_xx, e_xy, e_yy = cells.error
    slope_error = e_x + e_y
    size = cells.magnitude[2:].sum()
    error = max(e_xx, e_yy) + e_xy + rounding(ROUNDINGS, size)
    vectors, counts = cells.met()
    values = np.where(counts, np.maximum(_greater_curvature(*vectors), 0), -np.inf)
    kappa = max(best, float(values.max(initial=0.0)))
    upper = np.maximum(cells.most(_greater_eigenvalue(*cells.coefficients[2:])) + error, 0)  # as W >= 1
    if (near := upper > kappa).any():
        upper[near] = _upper(cells.take(near), kappa, upper[near], slope_error, error)
    # k is a quotient of A, of norm `size` at most, and N, whose relative derivative is 5/2 at most
    return Assessment(values, float(error + 3 * slope_error * size), upper, kappa)


def _greater_curvature(z_x: Floats, z_y: Floats, z_xx: Floats, z_xy: Floats, z_yy: Floats) -> Floats:
    """Return the greater eigenvalue of S A S / W with S = (I + g g^T)^(-1/2) = I - g g^T / (W (W + 1))."""
    w = np.sqrt(1 + z_x**2 + z_y**2)
    factor = 1 / (w * (w + 1))
    s_xx, s_xy, s_yy = 1 - factor * z_x**2, -factor * z_x * z_y, 1 - factor * z_y**2
    b_xx, b_xy, b_yx, b_yy = (
        s_xx * z_xx + s_xy * z_xy,
        s_xx * z_xy + s_xy * z_yy,
        s_xy * z_xx + s_yy * z_xy,
        s_xy * z_xy + s_yy * z_yy,
    )
    return (
        _greater_eigenvalue(b_xx * s_xx + b_xy * s_xy, b_xx * s_xy + b_xy * s_yy, b_yx * s_xy + b_yy * s_yy)
        / w
    )


def _upper(cells: Cells, kappa: float, nu: Floats, slope_error: float, error: float) -> Floats:
    """Return the bound of max(k, 0) on every cell.

    nu : (n,), that of the Hessian's greatest eigenvalue.  error : of the Hessian and of sums of its entries.
    """
    z_x, z_y, z_xx, z_xy, z_yy = cells.coefficients
    x, y = z_x.mean(axis=(0, 1)), z_y.mean(axis=(0, 1))
    w = np.sqrt(1 + x**2 + y**2)
    dx, dy = z_x - x, z_y - y
    stretched = w + (x * dx + y * dy) / w
    c_xx = z_xx - kappa * (stretched * (1 + x**2) + 2 * w * x * dx)
    c_xy = z_xy - kappa * (stretched * (x * y) + w * (x * dy + y * dx))
    c_yy = z_yy - kappa * (stretched * (1 + y**2) + 2 * w * y * dy)
    mu = cells.most(_greater_eigenvalue(c_xx, c_xy, c_yy)) + error
    away = np.hypot(dx, dy).max(axis=(0, 1)) * (1 + ROUNDINGS * EPS) + slope_error
    steep = cells.most(np.hypot(z_x, z_y)) + slope_error
    least_w = np.hypot(1, np.maximum(np.hypot(x, y) * (1 - ROUNDINGS * EPS) - away, 0))
    rho = (steep * away) ** 2 / (4 * np.sqrt(1 + steep**2))
    # |L| <= w^3 + 3 w^2 away, and its change with the slopes is at most 3 w^2
    mu += kappa * (rho + 3 * w**2 * slope_error + ROUNDINGS * EPS * w**2 * (w + 3 * away))
    result: Floats = np.minimum(kappa + np.maximum(mu, 0) / least_w, nu / least_w)
    return result


def _greater_eigenvalue(a: Floats, b: Floats, c: Floats) -> Floats:
    """Return the greater eigenvalue of the symmetric matrix ((a, b), (b, c))."""
    return (a + c) / 2 + np.hypot((a - c) / 2, b)
