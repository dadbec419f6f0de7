"""Rays as Dr.Jit arrays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from optics.runtime import DrArray

Vector: TypeAlias = "tuple[DrArray, DrArray, DrArray]"


@dataclass(eq=False)
class DeviceRays:
    """Rays on the device of the backend.

    origin : mm.  direction : unit vectors.  flux : W.  inside : the mask of rays in glass.
    """

    origin: Vector
    direction: Vector
    flux: DrArray = None
    inside: DrArray | bool = False

    def at(self, t: DrArray) -> Vector:
        """Return the points at the path length t, mm."""
        x, y, z = (o + t * d for o, d in zip(self.origin, self.direction))
        return x, y, z
