"""How far a spline face is from a conic of revolution at most, by the poles of both.

With homogeneous poles (x, y, z, w) in the frame of the conic,

    P = x^2 + y^2 - 2 R z w + (1 + K) z^2

is a polynomial spline, between its Bernstein coefficients.  A point of the face has F = P / w^2, the conic
has F = 0, and F_z = 2 (1 + K) z - 2 R, hence |dz| <= max |P| / (min w^2 min |F_z|).

Source: G. Farin, Curves and Surfaces for CAGD, chapters 5 and 13 (products and the convex hull property).
"""

from itertools import product

import numpy as np
from scipy.special import comb

from thbcad.checks import EPS, Floats
from thbcad.sags import Conic
from thbcad.splines import KnotVector

ROUNDINGS = 1024  # of float64: more than a product of two nets of degree 10 and its sums take


def conic_deviation(
    kv_u: KnotVector, kv_v: KnotVector, points: Floats, weights: Floats, conic: Conic
) -> float | None:
    """Return a bound of the distance in z of a spline from a conic with its vertex at 0, mm; None where it is
    not of use: weights that are not positive, poles beyond the conic or near its equator.

    points : (n, m, 3) float, poles in mm.  weights : (n, m) float
    """
    reach = float(np.hypot(points[..., 0], points[..., 1]).max())
    curved, radius = 1 + conic.constant, conic.radius
    if weights.min() <= 0 or curved * reach**2 >= radius**2:
        return None
    heights = np.append(points[..., 2].ravel(), [0.0, conic(reach, 0.0)])
    slopes = 2 * curved * np.array([heights.min(), heights.max()]) - 2 * radius
    if slopes[0] * slopes[1] <= 0:
        return None
    homogeneous = np.concatenate([points * weights[..., None], weights[..., None]], axis=-1)
    x, y, z, w = np.moveaxis(_bernstein(kv_u, kv_v, homogeneous), -1, 0)
    terms = [
        _product(x, x),
        _product(y, y),
        -2 * radius * _product(z, w),
        curved * _product(z, z),
    ]
    size = float(sum(np.abs(term).max() for term in terms))
    greatest = float(np.abs(np.sum(terms, axis=0)).max()) + ROUNDINGS * EPS * size
    return greatest / (float(weights.min()) ** 2 * float(np.abs(slopes).min()))


def _bernstein(kv_u: KnotVector, kv_v: KnotVector, poles: Floats) -> Floats:
    """Return the Bernstein coefficients of all patches, (patches, p + 1, q + 1, 4)."""
    p, q = kv_u.degree + 1, kv_v.degree + 1
    rows = (kv_u.bezier() @ poles.reshape(len(poles), -1)).reshape(-1, *poles.shape[1:])
    both = kv_v.bezier() @ rows.transpose(1, 0, 2).reshape(poles.shape[1], -1)
    net = both.reshape(kv_v.spans, q, kv_u.spans, p, 4)
    return net.transpose(2, 0, 3, 1, 4).reshape(-1, p, q, 4)


def _product(a: Floats, b: Floats) -> Floats:
    """Return the Bernstein coefficients of products, (patches, 2 p + 1, 2 q + 1)."""
    _, p, q = a.shape
    choose = np.multiply.outer(comb(p - 1, range(p)), comb(q - 1, range(q)))
    result = np.zeros((len(a), 2 * p - 1, 2 * q - 1))
    for i, j in product(range(p), range(q)):
        result[:, i : i + p, j : j + q] += (choose * a)[:, i, j, None, None] * (choose * b)
    result /= np.multiply.outer(comb(2 * p - 2, range(2 * p - 1)), comb(2 * q - 2, range(2 * q - 1)))
    return result
