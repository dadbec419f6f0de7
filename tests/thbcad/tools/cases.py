"""Graphs of 10 mm by 10 mm for tools: bowls, cylinders, planes and rough ones."""

import numpy as np

from thbcad.sags import square_coefficients
from thbcad.splines import BSplineSurface, KnotVector

KV = KnotVector.uniform(3, 4, -5.0, 5.0)
ONES = np.ones(KV.dim)


def paraboloid(radius, constant=0.0):
    """z = (x^2 + y^2) / 2R + constant."""
    square = square_coefficients(KV)
    return BSplineSurface(KV, KV, (square[:, None] + square) / (2 * radius) + constant)


def cylinder(radius):
    """z = x^2 / 2R."""
    return BSplineSurface(KV, KV, square_coefficients(KV)[:, None] / (2 * radius) + 0 * ONES)


def saddle(radius):
    """z = (x^2 - y^2) / 2R."""
    square = square_coefficients(KV)
    return BSplineSurface(KV, KV, (square[:, None] - square) / (2 * radius))


def plane(a, b):
    """z = a x + b y."""
    x = KV.greville()
    return BSplineSurface(KV, KV, a * x[:, None] + b * x)


def rough(rng, height=0.15):
    """A bowl with random control points."""
    return BSplineSurface(
        KV, KV, paraboloid(30.0).coefficients + height * rng.standard_normal((KV.dim, KV.dim))
    )
