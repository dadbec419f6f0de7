"""Stops: plates without thickness that absorb light, with a hole, or of a shape."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from types import ModuleType
from typing import Any

import numpy as np

from optics.scene.receivers import Triple, seen_from
from thbcad.outlines import Outline
from thbcad.poses import IDENTITY, Pose


@dataclass(frozen=True, eq=False)
class Stop:
    """A plate in the plane z = 0 of its own frame, which absorbs light from both sides.

    outline : of its shape.  inner : of a ring, where it begins.  pose : to the frame of the path.
    hole : the plate has no end, and the shape is the hole in it; else it has this shape.
    name : in words.
    """

    outline: Outline
    pose: Pose = IDENTITY
    inner: Outline | None = None
    hole: bool = True
    name: str = "a stop"

    def distance(
        self,
        point: Triple,
        direction: Triple,
        library: ModuleType = np,
        number: Callable[[float], Any] = float,
        gauge: Callable[[Outline, Any, Any], Any] = Outline.gauge,
    ) -> Any:
        """Return the path lengths after which rays meet the plate, mm; inf of those that do not.

        point, direction, library, number : as of `Receiver.land`.  gauge : `Outline.gauge` for these arrays.
        """
        choose = np.where if library is np else library.select
        (x, y, z), (p, q, r) = seen_from(self.pose, point, direction, number)
        along = r == 0  # rays beside the plate
        length = choose(along, -1.0, -z / choose(along, 1.0, r))
        taken = self.absorbs(x + length * p, y + length * q, gauge) & (length > 0)
        return choose(taken, length, library.inf)

    def absorbs(self, x: Any, y: Any, gauge: Callable[[Outline, Any, Any], Any] = Outline.gauge) -> Any:
        """Return the mask of points of its plane, mm, where there is a plate.  gauge : as of `distance`."""
        shape = gauge(self.outline, x, y) <= 1
        if self.inner is not None:
            shape = shape & (gauge(self.inner, x, y) >= 1)
        return ~shape if self.hole else shape

    def moved(self, motion: Pose) -> Stop:
        """Return the stop elsewhere.  motion : in the frame of the path."""
        return self if motion.is_identity else replace(self, pose=motion @ self.pose)
