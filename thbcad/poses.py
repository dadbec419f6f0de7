"""Rigid motions.

A pose says where a body lies: it takes points of the body's own frame to the frame around it,

    P = R p + s,    R^T R = 1,    det R = 1,

and directions by R alone.  Poses are a group: `a @ b` does b first, and `a @ a.inverse()` moves nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from thbcad.checks import Floats, floats, read_only, shown
from thbcad.values import Value

ORIGIN = (0.0, 0.0, 0.0)
ORTHOGONAL = 1e-9  # of R^T R - 1, at most: a matrix that was written with ten digits is a rotation


def _three(name: str, numbers: ArrayLike) -> Floats:
    """Return three finite numbers; raise ValueError for any others."""
    row = floats(numbers)
    if row.shape != (3,) or not np.isfinite(row).all():
        raise ValueError(f"{name} must be three finite numbers, got {shown(numbers)}")
    return row


def _require_triples(vectors: Any) -> None:
    if isinstance(vectors, np.ndarray) and vectors.shape[:1] != (3,):
        raise ValueError(f"points and directions are arrays (3, ...), got one of shape {vectors.shape}")


@dataclass(frozen=True, eq=False)
class Pose(Value):
    """The rigid motion x -> R x + s.

    rotation : R, (3, 3).  shift : s, (3,) mm.

    Points and directions are arrays (3, ...), or triples of whatever has sums and products, as the arrays of
    other libraries: then the result is a triple.  A pose that moves nothing returns what it is given, and one
    that only shifts multiplies nothing.

    Raises ValueError : R is no rotation; numbers that are not finite.

    >>> quarter = Pose.at((0, 0, 5), rotation_vector=(0, 0, np.pi / 2))
    >>> quarter.points(np.array([1.0, 0.0, 0.0])).round(15).tolist()
    [0.0, 1.0, 5.0]
    >>> (quarter @ quarter.inverse()).points(np.array([1.0, 2.0, 3.0])).round(14).tolist()
    [1.0, 2.0, 3.0]
    """

    rotation: Floats
    shift: Floats

    def __init__(self, rotation: ArrayLike, shift: ArrayLike) -> None:
        rotation, shift = read_only(rotation), read_only(shift)
        if rotation.shape != (3, 3) or shift.shape != (3,):
            raise ValueError(
                f"a pose has a rotation (3, 3) and a shift (3,), got {rotation.shape} and {shift.shape}"
            )
        if not (np.isfinite(rotation).all() and np.isfinite(shift).all()):
            raise ValueError("the numbers of a pose must be finite")
        off = float(np.abs(rotation.T @ rotation - np.eye(3)).max())
        if off > ORTHOGONAL:
            raise ValueError(f"a rotation has R^T R = 1, but this matrix is off by {off:.2g}; normalise it")
        if np.linalg.det(rotation) < 0:
            raise ValueError(
                "a rotation has the determinant 1, but this matrix has -1: it mirrors; change a sign"
            )
        vars(self).update(rotation=rotation, shift=shift)

    def __repr__(self) -> str:
        shift = ", ".join(f"{s:g}" for s in self.shift)
        cosine = np.clip((np.trace(self.rotation) - 1) / 2, -1, 1)
        rotated = f", rotated by {np.degrees(np.arccos(cosine)):g} degrees" if self.rotates else ""
        return f"Pose(shift ({shift}) mm{rotated})"

    @classmethod
    def at(
        cls, position: ArrayLike = ORIGIN, rotation_vector: ArrayLike = ORIGIN, about: ArrayLike = ORIGIN
    ) -> Pose:
        """Return a rotation about a point, and then a shift.

        position : mm, where the body's origin comes to lie, were it not for the rotation.
        rotation_vector : rad; its direction is the axis, right-handed, its length the angle.
        about : mm, the point that the rotation leaves where it is.
        """
        centre, rotation = _three("about", about), np.eye(3)
        vector, shift = _three("rotation_vector", rotation_vector), _three("position", position)
        if vector.any():
            from scipy.spatial.transform import Rotation  # it takes a third of a second

            rotation = np.array(Rotation.from_rotvec(vector).as_matrix())
        return cls(rotation, centre - rotation @ centre + shift)

    @classmethod
    def tilted(cls, position: ArrayLike, tilt: ArrayLike) -> Pose:
        """Return a shift of a body that is then turned about its own axes X, Y and Z, one after the other.

        position : mm.  tilt : degrees, right-handed: `Rotation.from_euler("XYZ", tilt, degrees=True)`.
        """
        rotation, degrees, shift = np.eye(3), _three("tilt", tilt), _three("position", position)
        if degrees.any():
            from scipy.spatial.transform import Rotation

            rotation = Rotation.from_euler("XYZ", degrees, degrees=True).as_matrix()
        return cls(rotation, shift)

    @classmethod
    def facing(cls, position: ArrayLike, direction: ArrayLike) -> Pose:
        """Return a shift of a body whose +z is then turned straight to a direction, of any length.

        position : mm.

        Raises ValueError : a direction of length 0.

        >>> Pose.facing((0, 0, 5), (2, 0, 0)).directions(np.array([0.0, 0.0, 1.0])).round(15).tolist()
        [1.0, 0.0, 0.0]
        """
        towards = _three("direction", direction)
        if not towards.any():
            raise ValueError("a direction must not be three zeros")
        x, y, z = towards / np.linalg.norm(towards)
        across = np.hypot(x, y)
        angle, (i, j) = np.arctan2(across, z), (-y / across, x / across) if across else (1.0, 0.0)
        return cls.at(position, (angle * i, angle * j, 0.0))

    @property
    def tilt(self) -> tuple[float, float, float]:
        """The degrees from which `tilted` makes the rotation; the last is 0 where many would do."""
        r, level = self.rotation, np.hypot(self.rotation[0, 0], self.rotation[0, 1])
        if level > ORTHOGONAL:
            first, last = np.arctan2(-r[1, 2], r[2, 2]), np.arctan2(-r[0, 1], r[0, 0])
        else:
            first, last = np.arctan2(r[2, 1], r[1, 1]), 0.0
        x, y, z = np.degrees([first, np.arctan2(r[0, 2], level), last]).tolist()
        return x, y, z

    def __matmul__(self, first: Pose) -> Pose:
        """Return the motion that does another one first."""
        if not first.rotates:
            return Pose(self.rotation, self.directions(first.shift) + self.shift)
        rotation = self.rotation @ first.rotation if self.rotates else first.rotation
        return Pose(rotation, self.directions(first.shift) + self.shift)

    def inverse(self) -> Pose:
        """Return the motion back, R^T (P - s)."""
        back = self.rotation.T
        return Pose(back, -(back @ self.shift) if self.rotates else -self.shift)

    def points(self, points: Any) -> Any:
        """Return R p + s of points, mm.

        Raises ValueError : an array whose first axis is not of 3.
        """
        _require_triples(points)
        if not self.shift.any():
            return self.directions(points)
        turned = self.directions(points)
        if isinstance(turned, np.ndarray):
            return turned + self.shift.reshape(3, *[1] * (turned.ndim - 1))
        return tuple(x + s for x, s in zip(turned, self.shift.tolist()))

    def directions(self, directions: Any) -> Any:
        """Return R d of directions; raise as `points`."""
        _require_triples(directions)
        if not self.rotates:
            return directions
        if isinstance(directions, np.ndarray):
            flat = directions if directions.ndim < 3 else directions.reshape(3, -1)
            return (self.rotation @ flat).reshape(directions.shape)
        return tuple(sum(r * d for r, d in zip(row, directions)) for row in self.rotation.tolist())

    @cached_property
    def rotates(self) -> bool:
        """Whether it is more than a shift."""
        return bool((self.rotation != np.eye(3)).any())

    @cached_property
    def is_identity(self) -> bool:
        """Whether it moves nothing."""
        return not self.rotates and not self.shift.any()

    @property
    def mirror_axes(self) -> tuple[int, ...]:
        """Directions (0 for x, 1 for y) in which a body is its own mirror image that is so in its frame."""
        turns = [np.diag([-1.0 if a == axis else 1.0 for a in range(3)]) for axis in (0, 1)]
        same = [np.array_equal(m @ self.rotation @ m, self.rotation) for m in turns]
        return tuple(axis for axis in (0, 1) if same[axis] and not self.shift[axis])

    @property
    def rotation_vector(self) -> Floats:
        """The axis of the rotation, right-handed, times its angle, (3,) rad."""
        from scipy.spatial.transform import Rotation

        return np.array(Rotation.from_matrix(self.rotation).as_rotvec())


IDENTITY = Pose.at()
