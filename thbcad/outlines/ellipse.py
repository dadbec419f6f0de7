"""Ellipses x^2 / a^2 + y^2 / b^2 = 1, and what a spline graph holds within.

Angles t of an ellipse run counter-clockwise from the longer semi-axis, as CAD kernels count them:

    (x, y) = (a cos t, b sin t) for a >= b, else (-a sin t, b cos t).

Between two crossings of knot lines a spline graph z(x, y) of degrees (p, q) is a trigonometric
polynomial of degree p + q in t there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import NdBSpline

from thbcad.checks import Floats, Integers, half_widths
from thbcad.splines import BSplineSurface, gauss_rule

LEAST_SIZE = 1e-6  # mm; CAD kernels take points within 1e-7 mm for one


@dataclass(frozen=True)
class Ellipse:
    """The ellipse x^2 / a^2 + y^2 / b^2 = 1 in mm.

    semi_axes : (a, b) float, mm

    Raises
    ------
    ValueError : semi-axes that are not two positive numbers, or are below 1e-6 mm.
    """

    semi_axes: tuple[float, float]

    def __post_init__(self) -> None:
        try:
            object.__setattr__(self, "semi_axes", half_widths(self.semi_axes))
        except ValueError:
            raise ValueError(f"semi_axes must be two positive numbers, got {self.semi_axes}") from None
        if min(self.semi_axes) < LEAST_SIZE:
            raise ValueError(f"semi_axes must be at least {LEAST_SIZE:g} mm, got {self.semi_axes}")

    @property
    def area(self) -> float:
        """pi a b, mm^2."""
        return float(np.pi * self.semi_axes[0] * self.semi_axes[1])

    @property
    def upright(self) -> bool:
        """True where the longer semi-axis lies along y."""
        return self.semi_axes[1] > self.semi_axes[0]

    def __call__(self, t: ArrayLike) -> tuple[Floats, Floats]:
        """Return (x, y) at the angles t, (n,) each, mm."""
        (a, b), t = self.semi_axes, np.asarray(t, dtype=np.float64)
        return (-a * np.sin(t), b * np.cos(t)) if self.upright else (a * np.cos(t), b * np.sin(t))

    def crossings(self, x: ArrayLike, y: ArrayLike) -> tuple[Floats, Integers]:
        """Return the angles in [0, 2 pi) at which the ellipse crosses the lines x = x_i and y = y_j.

        Returns (angles, lines): (n,) float and (n,) int, lines i of x and len(x) + j of y; not sorted.
        """
        angles = []
        lines = []
        start = 0
        for d, row in enumerate((x, y)):
            relative = np.asarray(row, dtype=np.float64) / self.semi_axes[d]
            hit = np.flatnonzero(abs(relative) <= 1)
            # angles from the axis d, then from the longer semi-axis
            turn = (np.pi / 2 if d == 1 else 0.0) - (np.pi / 2 if self.upright else 0.0)
            for sign in (1, -1):
                angles.append((turn + sign * np.arccos(relative[hit])) % (2 * np.pi))
                lines.append(start + hit)
            start += len(relative)
        return np.concatenate(angles), np.concatenate(lines)


def ellipse_integral(graph: BSplineSurface, ellipse: Ellipse) -> float:
    """Return the integral of a scalar spline z(x, y) over the inside of an ellipse within its rectangle.

    A Gauss rule with n = p + q + 8 nodes on pieces of at most a quarter turn errs by less than 1e-14 of the
    size of each harmonic, of which the last is number p + q + 2.

    Source: P. Davis, P. Rabinowitz, Methods of Numerical Integration, 2.7 (remainder of the Gauss rule).
    """
    p, q = graph.kv_u.degree, graph.kv_v.degree
    along = graph.kv_u.integrals()[:, None] * graph.coefficients
    primitive = np.concatenate([np.zeros((1, along.shape[1])), np.cumsum(along, axis=0)])
    knots = np.r_[graph.kv_u.start, graph.kv_u.knots, graph.kv_u.stop]
    angles, _ = ellipse.crossings(graph.kv_u.breaks, graph.kv_v.breaks)
    breaks = np.unique(np.r_[angles, np.pi / 2 * np.arange(5)])
    t, weights = gauss_rule(breaks, p + q + 8)
    x, y = inside(graph, *ellipse(t))
    values = NdBSpline((knots, graph.kv_v.knots), primitive, (p + 1, q))(np.column_stack([x, y]))
    a, b = ellipse.semi_axes
    return float(weights @ (values * x * (b / a)))


def inside(graph: BSplineSurface, x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Return points of the rim, those that rounding put beside the rectangle of the graph moved onto it."""
    x, y = (np.clip(row, kv.start, kv.stop) for row, kv in ((x, graph.kv_u), (y, graph.kv_v)))
    return x, y
