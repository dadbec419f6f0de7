"""What takes light on its way through air: plates, and bodies that it does not mean to meet.

Light that leaves a face of a body, or comes to it, cannot meet that body anywhere else where it is steeper
than the body's faces,

    |d_z| > S |(d_x, d_y)|,    S the greatest slope of front and rear,

in the frame of the body.  All other rays are searched for where they come into its bounding box.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from optics.base.runtime import Backend, DrArray
from optics.light.intersections import DeviceRays, Vector, gauge
from optics.light.tracing.branches import FRONT, NEVER, OUTSIDE, REAR, UNDECIDED, Branches, ClosedLens
from optics.scene.paths import Body, Stop
from optics.scene.receivers import seen_from
from optics.scene.sources import Rays
from thbcad.checks import Floats
from thbcad.poses import Pose

FACES = {"front": FRONT, "rear": REAR}
GRAZE = 1e-6  # of a body's size: light that meets it so near to where it means to go meets it there


class ShadingBody:
    """A body on the device."""

    def __init__(self, backend: Backend, body: Body) -> None:
        self.body, self._backend = body, backend
        self._number = backend.opaque
        self._graze = GRAZE * float(np.ptp(body.box))

    @cached_property
    def _closed(self) -> ClosedLens:
        return ClosedLens(self._backend, self.body.solid)

    def may_take(self, pose: Pose, rays: DeviceRays, reach: DrArray, own: bool) -> DrArray:
        """Return the mask of rays that come into its box, and may meet it there.

        pose : of the body, in the frame of the rays.  reach : path lengths, mm, before which they may.
        own : the rays come from a face of it, or go to one.
        """
        dr = self._backend.dr
        origin, direction = seen_from(pose, rays.origin, rays.direction, self._number)
        start, stop = self._number(0.0), reach
        for o, d, low, high in zip(origin, direction, *self.body.box):
            ends = [(self._number(end) - o) / d for end in (low - self._graze, high + self._graze)]
            start, stop = dr.maximum(start, dr.minimum(*ends)), dr.minimum(stop, dr.maximum(*ends))
        x, y, z = direction
        may = start < stop
        return may & (z * z <= self._number(self.body.steepest**2) * (x * x + y * y)) if own else may

    def takes(self, pose: Pose, origin: Floats, direction: Floats, reach: Floats) -> NDArray[np.int8]:
        """Return which of its faces rays meet before path lengths, mm, (n,); NEVER is none.

        origin, direction : (3, n).
        """
        face, length = self.lengths(pose, origin, direction)
        return np.where(length < reach - self._graze, face, NEVER).astype(np.int8)

    def lengths(self, pose: Pose, origin: Floats, direction: Floats) -> tuple[NDArray[np.int8], Floats]:
        """Return which of its faces rays meet, and after which path lengths, mm; inf where not surely any.

        pose, origin, direction : as of `takes`.
        """
        rays = Rays(origin, direction, np.ones(origin.shape[1])).posed(pose.inverse())
        met = self._closed.meet(Branches.start(rays))
        length = np.linalg.norm(met.point - rays.origin, axis=0)
        return met.face, np.where(np.isin(met.face, (NEVER, UNDECIDED)), np.inf, length)


class Obstruction:
    """What takes light on its way through air to a surface, or to the receiver.

    stops : in the frame of the rays.  bodies : with their poses there, and whether the way begins or ends on
    their own faces.  start : mm, of the way that lies before the source.  left : the surface on which it
    begins, by its number.
    """

    def __init__(
        self,
        backend: Backend,
        stops: Sequence[Stop],
        bodies: Sequence[tuple[ShadingBody, Pose, bool]],
        start: float,
        left: int,
    ) -> None:
        self._backend, self._stops, self._bodies, self._start = backend, stops, bodies, start
        self._left = left

    def __bool__(self) -> bool:
        """Whether there is anything in the way."""
        return bool(self._stops or self._bodies)

    def takes(
        self, rays: DeviceRays, meets: DrArray | bool, end: Vector | DrArray | float
    ) -> tuple[DrArray | bool, DrArray | bool]:
        """Return the masks of rays that are taken, and of those that meet the face again that they left.

        False stands for a free way.

        meets : rays that would get to the end of the way.  end : there, points or path lengths, mm.
        What does not get there is taken by stops, wherever they are, and by no body.
        """
        if not self:
            return False, False
        dr, number = self._backend.dr, self._backend.opaque
        if isinstance(end, tuple):
            end = sum((a - o) * d for a, o, d in zip(end, rays.origin, rays.direction))
        blocked: DrArray | bool = False
        reach = dr.select(meets, end, dr.inf) if self._stops else dr.inf
        for stop in self._stops:
            length = stop.distance(rays.origin, rays.direction, dr, number, partial(gauge, self._backend))
            blocked = length < reach if blocked is False else blocked | (length < reach)
        if not self._bodies:
            return blocked, False
        shaded, again = self._shaded(rays, dr.select(meets, self._backend.Float(end), -dr.inf))
        return blocked | shaded, again

    def _shaded(self, rays: DeviceRays, reach: DrArray) -> tuple[DrArray | bool, DrArray | bool]:
        """Return the masks of rays that a body takes before the path lengths `reach`, mm, as `takes`."""
        dr, Float = self._backend.dr, self._backend.Float
        if self._start:
            rays, reach = DeviceRays(rays.at(Float(self._start)), rays.direction), reach - self._start
        may = [body.may_take(pose, rays, reach, own) for body, pose, own in self._bodies]
        dr.eval(may)  # as a rule no ray may meet one, and nothing else is needed
        shaded: list[DrArray | bool] = [False, False]
        for (body, pose, _), mask in zip(self._bodies, may):
            chosen = dr.compress(mask)
            if dr.width(chosen):
                table = [*rays.origin, *rays.direction, reach]
                dr.eval(table)
                parts = [dr.gather(Float, dr.select(mask, part, 0), chosen).numpy() for part in table]
                met = body.takes(pose, np.array(parts[:3]), np.array(parts[3:6]), parts[6])
                left = FACES.get(body.body.faces.get(self._left, ""), OUTSIDE)
                for k, taken in enumerate((met != NEVER, met == left)):
                    if taken.any():
                        mine = dr.zeros(Float, dr.width(mask))
                        dr.scatter(mine, self._backend.array(taken.astype(float)), chosen)
                        shaded[k] = shaded[k] | (mine > 0)
        return shaded[0], shaded[1]
