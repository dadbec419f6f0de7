"""Where light is received: a plane, or the directions of the far field, each with the chart of its picture.

A chart names a point of the receiver by two coordinates (u, v): lengths in a plane, angles in the far field.
Light travels to +z of the receiver's own frame; what comes from behind, or along it, never meets it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import isinf
from types import ModuleType
from typing import Any, ClassVar, NamedTuple, Protocol, TypeAlias

import numpy as np

from thbcad.poses import Pose

Triple: TypeAlias = Any  # of numbers or arrays, one for each coordinate

DEGREES = 180 / np.pi
HERE = Pose.at()


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


class Receiver(Protocol):
    """What receives light.

    unit, area_unit : of the chart's coordinates, and of their product.  far_field : they are directions.
    """

    unit: ClassVar[str]
    area_unit: ClassVar[str]
    far_field: ClassVar[bool]

    @property
    def pose(self) -> Pose:
        """From its own frame to that of the scene."""
        ...

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
        ...

    def toward(self, point: Triple, u: Any, v: Any) -> tuple[Any, Any, Any]:
        """Return directions of any length from points to where light shall land."""
        ...

    def seen_from(self, pose: Pose) -> Receiver:
        """Return the receiver in the frame of a body with this pose."""
        ...


@dataclass(frozen=True, eq=False)
class Plane:
    """The plane z = 0 of its frame, with u = x and v = y in mm."""

    pose: Pose

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
        """See `Receiver`: u = x - z p / r, v = y - z q / r for the ray (x, y, z) + t (p, q, r)."""
        p, q, r = _turned(self.pose, direction, number)
        x, y, z = _turned(self.pose, _less(point, self.pose.shift, number), number)
        met = r > 0
        length = -z / _where(library)(met, r, 1)
        return LandingPoint(x + length * p, y + length * q, length, p, q, met)

    def toward(self, point: Triple, u: Any, v: Any) -> tuple[Any, Any, Any]:
        """See `Receiver`."""
        there = self.pose.points((u, v, 0.0))
        x, y, z = (a - b for a, b in zip(there, point))
        return x, y, z

    def seen_from(self, pose: Pose) -> Plane:
        """See `Receiver`."""
        return Plane(pose.inverse() @ self.pose)


@dataclass(frozen=True, eq=False)
class FarField:
    """All directions (p, q, r) before a frame, with u = atan(p / r) and v = atan(q / r) in degrees."""

    pose: Pose = HERE

    unit: ClassVar[str] = "degrees"
    area_unit: ClassVar[str] = "square degrees"
    far_field: ClassVar[bool] = True

    def land(
        self,
        point: Triple,
        direction: Triple,
        library: ModuleType = np,
        number: Callable[[float], Any] = float,
    ) -> LandingPoint:
        """See `Receiver`; the points do not matter."""
        p, q, r = _turned(self.pose, direction, number)
        met = r > 0
        rate = _where(library)(met, r, 1)
        u, v = (DEGREES * library.atan(d / rate) for d in (p, q))
        return LandingPoint(u, v, 0.0, p, q, met)

    def toward(self, point: Triple, u: Any, v: Any) -> tuple[Any, Any, Any]:
        """See `Receiver`; the points do not matter."""
        p, q = (np.tan(np.radians(angle)) for angle in (u, v))
        x, y, z = self.pose.directions((p, q, np.ones_like(p)))
        return x, y, z

    def seen_from(self, pose: Pose) -> FarField:
        """See `Receiver`."""
        return FarField(pose.inverse() @ self.pose)


def receiver_at(z: float, pose: Pose = HERE) -> Receiver:
    """Return what receives light at a height along the axis.

    z : mm, inf is the far field.  pose : of the whole, from the frame in which z is meant.
    """
    return FarField(pose) if isinf(z) else Plane(pose @ Pose.at((0.0, 0.0, z)))


def _turned(pose: Pose, vector: Triple, number: Callable[[float], Any]) -> Triple:
    """Return R^T of a vector."""
    if not pose.rotates:
        return vector
    return [sum(number(c) * v for c, v in zip(column, vector)) for column in pose.rotation.T.tolist()]


def _less(point: Triple, shift: Any, number: Callable[[float], Any]) -> Triple:
    return [x - number(s) if s else x for x, s in zip(point, shift.tolist())]


def _where(library: ModuleType) -> Callable[..., Any]:
    """Return what chooses between two arrays."""
    choose: Callable[..., Any] = np.where if library is np else library.select
    return choose
