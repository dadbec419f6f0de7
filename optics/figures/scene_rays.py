"""The rays in the picture of a scene."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from optics.receivers import receiver_at
from optics.sources import single_rays
from optics.tracing import RayPath, TargetArea, trace_paths

if TYPE_CHECKING:
    from optics.runtime import Backend
    from optics.system import OpticalSystem
    from thbcad.lens import Lens

BUNDLE = (8, 8)  # rays
FAR = 4.0  # half-widths of the rear behind its vertex, to where rays to the far field are drawn


def scene_paths(system: OpticalSystem, lens: Lens, backend: Backend) -> list[RayPath]:
    """Return the paths of some 64 rays of the source to the target or its direction.

    At every face a path follows the stronger part.

    backend : of double precision
    """
    rays, target = single_rays(system.source.rays(BUNDLE), lens), system.target
    plane = TargetArea(target.receiver, target.settings.half_width)
    if target.far_field:
        plane = TargetArea(receiver_at(lens.thickness + FAR * max(lens.rear.half_width)), (np.inf, np.inf))
    return trace_paths(backend, lens, rays, plane)
