"""Conic curves in space, as ISO 10303-42 parametrises them.

A placement has a centre C, an axis and a first direction; P3 is the axis and P1 the part of the first
direction across it, both of length 1, and P2 = P3 x P1.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from thbcad.checks import Floats

Order = Literal[0, 1]  # of a derivative


@dataclass(frozen=True, eq=False)
class ConicCurve:
    """A circle, an ellipse, a hyperbola or a parabola.

        circle, ellipse   C + a cos t P1 + b sin t P2
        hyperbola         C + a cosh t P1 + b sinh t P2
        parabola          C + a t^2 P1 + 2 a t P2

    kind : "CIRCLE", "ELLIPSE", "HYPERBOLA" or "PARABOLA".
    placement : (3, 3) float, rows C, axis and first direction, as the file has them; in a plane of parameters
        the third components are those of (., ., 0), (0, 0, 1) and (., ., 0).
    sizes : (a, b) float; twice the radius of a circle, twice the focal distance of a parabola.
    """

    kind: str
    placement: Floats
    sizes: Floats

    @property
    def closed(self) -> bool:
        """Whether the whole curve is closed."""
        return self.kind in ("CIRCLE", "ELLIPSE")

    def points(self, t: Floats, derivative: Order = 0) -> Floats:
        """Return the points at the parameters t, (n,), or their derivatives, (n, 3)."""
        a, b = self.sizes
        if self.closed:
            by_order = (a * np.cos(t), b * np.sin(t)), (-a * np.sin(t), b * np.cos(t))
        elif self.kind == "HYPERBOLA":
            by_order = (a * np.cosh(t), b * np.sinh(t)), (a * np.sinh(t), b * np.cosh(t))
        else:
            by_order = (a * t * t, 2 * a * t), (2 * a * t, 2 * a + 0 * t)
        along: Floats = np.stack(by_order[derivative], axis=1) @ axes(self.placement)[:2]
        return along if derivative else self.placement[0] + along

    def parameters(self, points: Floats) -> Floats:
        """Return the parameters of points of the curve, (n, 3), as (n,); angles lie within -pi to pi."""
        a, b = self.sizes
        x, y = axes(self.placement)[:2] @ (points - self.placement[0]).T
        t: Floats = y / (2 * a)
        if self.closed:
            t = np.arctan2(y / b, x / a)
        elif self.kind == "HYPERBOLA":
            t = np.arcsinh(y / b)
        return t


def axes(placement: Floats) -> Floats:
    """Return P1, P2 and P3 of a placement with rows centre, axis and first direction, (3, 3) float."""
    _, axis, first = placement
    axis = axis / np.linalg.norm(axis)
    across = first - (first @ axis) * axis
    across = across / np.linalg.norm(across)
    return np.stack([across, np.cross(axis, across), axis])
