"""Light along z that comes through a plane, and so to known points of the surface behind it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from optics.base.runtime import Backend, DrArray
from optics.light.intersections import DeviceRays, gauge
from optics.light.tracing.traced_surface import TracedSurface, blocked_rays
from optics.scene.paths import LightPath, Stop
from optics.scene.sources import RayGrid


def through_plane(
    backend: Backend, plane: TracedSurface, grid: RayGrid, start: float, stops: Sequence[Stop]
) -> tuple[DrArray | bool, DrArray | bool]:
    """Return the masks of rays that come through a plane z = 0, and of those that are blocked before.

    start : z, mm, from which the rays come.  stops : before the plane.
    """
    outline, hit = plane.surface.shape.outline, True
    if outline.is_rectangle and not (stops or plane.surface.clear):
        return True, False
    x, y = (backend.array(row.ravel()) for row in np.meshgrid(grid.x, grid.y, indexing="ij"))
    if not outline.is_rectangle:
        hit = gauge(backend, outline, x, y) <= 1
    rays = DeviceRays((x, y, start), (0.0, 0.0, 1.0))
    kept = plane.kept(hit, blocked_rays(backend, stops, rays, -start), x, y)
    backend.dr.eval(kept)
    return kept


def stays_parallel(path: LightPath) -> bool:
    """Whether light along z is still along z where it meets the second surface, which carries a sag."""
    if len(path.surfaces) < 2:
        return False
    first, second = path.surfaces[:2]
    return (
        second.shape.sag is not None
        and first.kind == "refract"
        and first.shape.is_plane
        and first.slope_error is None
        and first.height_error is None
        and first.pose.is_identity
        and not (second.pose.rotates or second.pose.shift[:2].any())
    )
