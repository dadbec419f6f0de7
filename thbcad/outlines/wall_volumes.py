"""The volume between two graphs within walls round an outline.

V = integral of z dx dy over the surface of the body, by the divergence theorem.  Between the points (f, z_f)
and (r, z_r) of equal parameter of the two rims a wall is ruled, and with d = r - f and
a x b = a_x b_y - a_y b_x it adds the integral along the rim of

    z_f (f' x d + d' x d / 2) + (z_r - z_f) (f' x d / 2 + d' x d / 3).
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from thbcad.checks import Floats
from thbcad.outlines.pieces import RimPiece, inside, integral_within
from thbcad.splines import BSplineSurface

UPRIGHT = (1.0, 1.0)


class Shape(Protocol):
    """What an outline encloses."""

    @property
    def area(self) -> float:
        """The area within, mm^2."""

    @property
    def pieces(self) -> tuple[RimPiece, ...]:
        """The outline, counter-clockwise."""


def walled_volume(
    graphs: tuple[BSplineSurface, BSplineSurface],
    thickness: float,
    shape: Shape,
    factors: tuple[float, float] = UPRIGHT,
) -> float:
    """Return the volume of a body from the graph of its front to that of its rear, mm^3.

    graphs : scalar splines z(x, y), mm.  thickness : of the rear's z = 0 over the front's, mm
    shape : the outline of the rear.  factors : of x and y, from it to that of the front

    The integrals are exact for the splines but for rounding.
    """
    front, rear = graphs
    low = tuple(piece.scaled(factors) for piece in shape.pieces) if factors != UPRIGHT else shape.pieces
    volume = shape.area * thickness + integral_within(rear, shape.pieces) - integral_within(front, low)
    if factors == UPRIGHT:
        return volume
    x, y = (
        np.union1d(a.breaks / factor, b.breaks)
        for a, b, factor in zip((front.kv_u, front.kv_v), (rear.kv_u, rear.kv_v), factors)
    )
    degree = max(g.kv_u.degree + g.kv_v.degree for g in graphs)
    for own, other in zip(low, shape.pieces):
        t, weights = other.rule(x, y, degree)
        f, r = own(t), other(t)
        base, top = front(*inside(front, *f)), thickness + rear(*inside(rear, *r))
        d, slope, other_slope = np.subtract(r, f), np.array(own(t, 1)), np.array(other(t, 1))
        first, second = cross(slope, d), cross(other_slope - slope, d)
        volume += float(weights @ (base * (first + second / 2) + (top - base) * (first / 2 + second / 3)))
    return volume


def cross(a: Floats, b: Floats) -> Floats:
    product: Floats = a[0] * b[1] - a[1] * b[0]
    return product
