"""Fans of rays of a spreading source through the closed lens, for drawing."""

from __future__ import annotations

import numpy as np

from optics.base.runtime import Backend
from optics.light.tracing import RayPath, TargetArea, trace_paths
from optics.scene.sources import Rays
from optics.scene.system import OpticalSystem
from thbcad.lens import Lens

FAN = 8
WIDEST = 0.98  # of the cone's half-angle: the outermost rays of a fan


def fans(system: OpticalSystem, lens: Lens, backend: Backend) -> dict[str, list[RayPath]]:
    """Return the paths of two fans of rays from the source's centre in the plane x = 0.

    One has equal steps of the angle, the other of its sine.
    """
    source = system.problem.source
    widest = np.radians(source.half_angle) * WIDEST
    area, out = TargetArea(system.target.receiver, system.target.settings.half_width), {}
    for name, sine in (
        ("equal angles", np.sin(np.linspace(-widest, widest, FAN))),
        ("equal steps of the sine", np.linspace(-1, 1, FAN) * np.sin(widest)),
    ):
        origin, direction = np.zeros((2, 3, FAN))
        origin[2] = -source.distance
        direction[1], direction[2] = sine, np.sqrt(1 - sine**2)
        out[name] = trace_paths(backend, lens, Rays(origin, direction, np.ones(FAN)), area)
    return out
