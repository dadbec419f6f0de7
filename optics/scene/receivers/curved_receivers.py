"""Curved receivers: halves of cylinders and spheres, whose charts are arcs from the middle."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any

import numpy as np

from optics.scene.receivers.receivers import Receiver, Triple, choose_by

TOUCHES = 1e-12  # square of the sine between a ray and a curved screen: what touches it does not meet it


@dataclass(frozen=True, eq=False)
class Cylinder(Receiver):
    """A half of the cylinder x^2 + (z - R)^2 = R^2 of its frame, that round the middle: |u| < pi |R| / 2.

    u = R atan(x / (R - z)) is the arc round the axis, which lies along y, and v = y, mm.
    Light meets it at the nearer of two places where R > 0, as it bulges to the light, else at the farther.

    radius : R, mm.
    """

    radius: float = field(kw_only=True)

    def _chart(
        self, point: Triple, direction: Triple, library: ModuleType, number: Callable[[float], Any]
    ) -> tuple[Any, Any, Any, Any]:
        """c A t^2 - 2 F t = G for the ray s + t d, with c = 1 / R, A = |d|^2, F = r - c d . s and
        G = 2 z - c |s|^2; round a cylinder y and q do not count.

        t = -G / (F + S) = (F - S) / (c A), with S^2 = F^2 + c A G, is the near root where c > 0 and the far
        one else.  The first form loses no digits where F > 0, the second elsewhere.
        """
        (x, y, z), (p, q, r) = point, direction
        choose, c = choose_by(library), number(1 / self.radius)
        ca = c * self._dot(direction, direction)
        f = r - c * self._dot(direction, point)
        g = 2 * z - c * self._dot(point, point)
        square = f * f + ca * g
        meets = square > TOUCHES
        root = library.sqrt(choose(meets, square, 1))
        length = choose(f > 0, -g / (abs(f) + root), (f - root) / ca)
        x, y, z = x + length * p, y + length * q, z + length * r
        meets = meets & (c * z < 1)
        return *self._arcs(c, x, y, choose(meets, 1 - c * z, 1), library), length, meets

    def _dot(self, one: Triple, other: Triple) -> Any:
        """Return the product of two vectors across the axis."""
        return one[0] * other[0] + one[2] * other[2]

    def _arcs(self, c: Any, x: Any, y: Any, before: Any, library: ModuleType) -> tuple[Any, Any]:
        """Return u and v of a point.  c : 1 / R.  before : 1 - c z."""
        return library.atan(c * x / before) / c, y

    def points(self, u: Any, v: Any) -> Any:
        """x = R sin(u / R), y = v, z = R (1 - cos(u / R))."""
        angle = u / self.radius
        return self.pose.points((self.radius * np.sin(angle), v, self.radius * (1 - np.cos(angle))))

    def normal(self, u: Any, v: Any) -> Any:
        """(-sin(u / R), 0, cos(u / R))."""
        angle = u / self.radius
        return self.pose.directions((-np.sin(angle), 0.0 * v, np.cos(angle)))

    @property
    def across_axis(self) -> bool:
        return False


class Sphere(Cylinder):
    """The half of the sphere x^2 + y^2 + (z - R)^2 = R^2 of its frame round the middle.

    u is the arc along the equator in the plane y = 0, as of a cylinder, and v that along a meridian, mm, as
    degrees of longitude and latitude: v = R atan(y / sqrt(x^2 + (R - z)^2)).  The area is cos(v / R) du dv.
    """

    def _dot(self, one: Triple, other: Triple) -> Any:
        return one[0] * other[0] + one[1] * other[1] + one[2] * other[2]

    def _arcs(self, c: Any, x: Any, y: Any, before: Any, library: ModuleType) -> tuple[Any, Any]:
        level = library.sqrt(c * c * x * x + before * before)
        return library.atan(c * x / before) / c, library.atan(c * y / level) / c

    def points(self, u: Any, v: Any) -> Any:
        """x = R sin(u / R) cos(v / R), y = R sin(v / R), z = R (1 - cos(u / R) cos(v / R))."""
        x, y, z = self._from_centre(u, v)
        return self.pose.points((self.radius * x, self.radius * y, self.radius * (1 - z)))

    def normal(self, u: Any, v: Any) -> Any:
        """(-sin(u / R) cos(v / R), -sin(v / R), cos(u / R) cos(v / R))."""
        x, y, z = self._from_centre(u, v)
        return self.pose.directions((-x, -y, z))

    def _from_centre(self, u: Any, v: Any) -> tuple[Any, Any, Any]:
        """Return the parts of the unit vector from the centre, that along -z last."""
        a, b = u / self.radius, v / self.radius
        return np.sin(a) * np.cos(b), np.sin(b), np.cos(a) * np.cos(b)

    def area(self, u: Any, v: Any) -> Any:
        return super().area(u, v) * np.cos(np.asarray(v) / self.radius)
