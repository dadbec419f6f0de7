"""Rigid motions, x -> R x + s: of a lens, its source and its target."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

from optics.sources import Rays

if TYPE_CHECKING:
    from optics.runtime import DrArray

Floats = NDArray[np.float64]
Vector: TypeAlias = "tuple[DrArray, DrArray, DrArray]"


@dataclass(frozen=True, eq=False)
class RigidMotion:
    """The map x -> turn x + shift.  turn : (3, 3), a rotation.  shift : (3,), mm."""

    turn: Floats
    shift: Floats

    @classmethod
    def about(cls, centre: Sequence[float], tilt: Sequence[float], shift: Sequence[float]) -> RigidMotion:
        """Return a rotation about a centre, mm, with a shift behind it, mm.

        tilt : rotation vector, rad: its direction is the axis, its length the angle.
        """
        from scipy.spatial.transform import Rotation

        turn = np.array(Rotation.from_rotvec(tilt).as_matrix()) if any(tilt) else np.eye(3)
        middle = np.asarray(centre, dtype=float)
        return cls(turn, middle - turn @ middle + np.asarray(shift, dtype=float))

    @property
    def turns(self) -> bool:
        """Whether it is more than a shift."""
        return bool((self.turn != np.eye(3)).any())

    @property
    def rests(self) -> bool:
        """Whether it moves nothing."""
        return not self.turns and not self.shift.any()

    def inverse(self) -> RigidMotion:
        return RigidMotion(self.turn.T, -self.turn.T @ self.shift)

    def after(self, first: RigidMotion) -> RigidMotion:
        """Return the motion that does another one first."""
        if not self.turns and not first.turns:
            return RigidMotion(np.eye(3), self.shift + first.shift)
        return RigidMotion(self.turn @ first.turn, self.turn @ first.shift + self.shift)

    def rays(self, rays: Rays) -> Rays:
        """Return moved rays."""
        return Rays(self.turn @ rays.origin + self.shift[:, None], self.turn @ rays.direction, rays.flux)

    def turned(self, vector: Vector) -> Vector:
        """Return a turned vector of Dr.Jit arrays."""
        x, y, z = (sum(float(c) * v for c, v in zip(row, vector)) for row in self.turn)
        return x, y, z

    def points(self, point: Vector) -> Vector:
        """Return a moved point of Dr.Jit arrays."""
        x, y, z = (v + float(s) for v, s in zip(self.turned(point), self.shift))
        return x, y, z
