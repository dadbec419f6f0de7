"""Where light is received: a plane, cylinder, sphere or the far field, each with the chart of its picture.

A chart names a point of the receiver by two coordinates (u, v): lengths along a surface, angles in the far
field.  (u, v, direction of the light) are right-handed: light travels to +z of the receiver's own frame, and
what comes from behind, or along it, never meets it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from math import isinf
from types import ModuleType
from typing import Any, ClassVar, NamedTuple, Self, TypeAlias

import numpy as np

from thbcad.poses import IDENTITY, Pose
from thbcad.values import Value

Triple: TypeAlias = Any  # of numbers or arrays, one for each coordinate

DEGREES = 180 / np.pi


class LandingPoint(NamedTuple):
    """Where rays meet a receiver.

    u, v : of its chart.  length : mm, from the rays' points; 0 in the far field.
    p, q : the rays' directions along its own x and y.  met : whether they come from before it.
    """

    u: Any
    v: Any
    length: Any
    p: Any
    q: Any
    met: Any


@dataclass(frozen=True, eq=False)
class Receiver(Value, ABC):
    """What receives light.

    pose : from its own frame to that of the scene.
    unit, area_unit : of the chart's coordinates, and of their product.  far_field : they are directions, and
        no lengths.
    """

    pose: Pose = IDENTITY

    unit: ClassVar[str] = "mm"
    area_unit: ClassVar[str] = "mm^2"
    far_field: ClassVar[bool] = False

    def land(
        self,
        point: Triple,
        direction: Triple,
        library: ModuleType = np,
        number: Callable[[float], Any] = float,
    ) -> LandingPoint:
        """Return where rays land.

        point, direction : triples of arrays, mm and unit vectors.  library : of the arrays, numpy or Dr.Jit.
        number : makes numbers for them that do not become part of a compiled kernel.
        """
        own, (p, q, r) = seen_from(self.pose, point, direction, number)
        met = r > 0
        u, v, length, lands = self._chart(own, (p, q, choose_by(library)(met, r, 1)), library, number)
        return LandingPoint(u, v, length, p, q, met if lands is True else met & lands)

    @abstractmethod
    def _chart(
        self, point: Triple, direction: Triple, library: ModuleType, number: Callable[[float], Any]
    ) -> tuple[Any, Any, Any, Any]:
        """Return u, v, the length and whether there is a meeting, of rays that go to +z, in the own frame."""

    @abstractmethod
    def points(self, u: Any, v: Any) -> Any:
        """Return where (u, v) lies, mm; in the far field a point in that direction from its frame."""

    @abstractmethod
    def normal(self, u: Any, v: Any) -> Any:
        """Return the unit normal there, along which light goes through it; the direction in the far field."""

    def toward(self, point: Triple, u: Any, v: Any) -> tuple[Any, Any, Any]:
        """Return directions of any length from points to where light shall land."""
        x, y, z = (a - b for a, b in zip(self.points(u, v), point))
        return x, y, z

    def area(self, u: Any, v: Any) -> Any:
        """Return the area over du dv, mm^2 or solid angle in square degrees: pictures are light per area.

        Where all are the same they are one number in memory, which is not to be written.
        """
        return np.broadcast_to(1.0, np.broadcast_shapes(np.shape(u), np.shape(v)))

    @property
    def across_axis(self) -> bool:
        """Whether it is a plane across the axis z with its middle on it, or the far field around it."""
        return not self.pose.rotates and not self.pose.shift[:2].any()

    def moved(self, motion: Pose) -> Self:
        """Return the receiver elsewhere.  motion : in the frame of the scene."""
        return self if motion.is_identity else replace(self, pose=motion @ self.pose)

    def seen_from(self, pose: Pose) -> Self:
        """Return the receiver in the frame of a body with this pose."""
        return self.moved(pose.inverse())


class Plane(Receiver):
    """The plane z = 0 of its frame, with u = x and v = y in mm."""

    def _chart(
        self, point: Triple, direction: Triple, library: ModuleType, number: Callable[[float], Any]
    ) -> tuple[Any, Any, Any, Any]:
        """u = x - z p / r, v = y - z q / r for the ray (x, y, z) + t (p, q, r)."""
        (x, y, z), (p, q, r) = point, direction
        length = -z / r
        return x + length * p, y + length * q, length, True

    def points(self, u: Any, v: Any) -> Any:
        return self.pose.points((u, v, 0.0))

    def normal(self, u: Any, v: Any) -> Any:
        return self.pose.directions((0.0 * u, 0.0 * v, 1.0))


class FarField(Receiver):
    """All directions (p, q, r) before a frame, with u = atan(p / r) and v = atan(q / r) in degrees.

    The points from which rays come do not matter.
    """

    unit = "degrees"
    area_unit = "square degrees"
    far_field = True

    def _chart(
        self, point: Triple, direction: Triple, library: ModuleType, number: Callable[[float], Any]
    ) -> tuple[Any, Any, Any, Any]:
        p, q, r = direction
        u, v = (DEGREES * library.atan(d / r) for d in (p, q))
        return u, v, 0.0, True

    def points(self, u: Any, v: Any) -> Any:
        return self.pose.points(self._tangents(u, v))

    def toward(self, point: Triple, u: Any, v: Any) -> tuple[Any, Any, Any]:
        x, y, z = self.pose.directions(self._tangents(u, v))
        return x, y, z

    def normal(self, u: Any, v: Any) -> Any:
        x, y, z = self.toward((0.0, 0.0, 0.0), u, v)
        length = np.sqrt(x * x + y * y + z * z)
        return x / length, y / length, z / length

    def _tangents(self, u: Any, v: Any) -> tuple[Any, Any, Any]:
        p, q = (np.tan(np.radians(angle)) for angle in (u, v))
        return p, q, np.ones_like(p)

    def area(self, u: Any, v: Any) -> Any:
        """d Omega / (du dv) = (1 + a^2)(1 + b^2) / (1 + a^2 + b^2)^(3/2) with a = tan u, b = tan v."""
        a, b = (np.tan(np.radians(angle)) ** 2 for angle in (u, v))
        return (1 + a) * (1 + b) / (1 + a + b) ** 1.5


def choose_by(library: ModuleType) -> Callable[..., Any]:
    """Return what takes one of two arrays by a mask."""
    return np.where if library is np else library.select  # numpy's `select` is another function


def receiver_at(z: float, pose: Pose = IDENTITY) -> Receiver:
    """Return what receives light at a height along the axis.

    z : mm, inf is the far field.  pose : of the whole, from the frame in which z is meant.
    """
    return FarField(pose) if isinf(z) else Plane(pose @ Pose.at((0.0, 0.0, z)))


def seen_from(
    pose: Pose, point: Triple, direction: Triple, number: Callable[[float], Any]
) -> tuple[Triple, Triple]:
    """Return points and directions in the frame of a body.  point, direction, number : as of `land`."""
    apart = [x - number(s) if s else x for x, s in zip(point, pose.shift.tolist())]
    return _rotated(pose, apart, number), _rotated(pose, direction, number)


def _rotated(pose: Pose, vector: Triple, number: Callable[[float], Any]) -> Triple:
    """Return R^T of a vector."""
    if not pose.rotates:
        return vector
    return [sum(number(c) * v for c, v in zip(column, vector)) for column in pose.rotation.T.tolist()]
