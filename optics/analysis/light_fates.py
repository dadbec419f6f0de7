"""Where the light of a spreading source goes in the closed lens: edges, reflections and all."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from optics.sources import Rays, single_rays
from optics.tracing import RayPath, TargetPlane, trace_nonsequential, trace_paths

if TYPE_CHECKING:
    from optics.runtime import Backend
    from optics.system import OpticalSystem
    from thbcad.lens import Lens

RAYS = (256, 256)
FAN = 8
WIDEST = 0.98  # of the cone's half-angle: the outermost rays of a fan


def nonsequential_metrics(
    system: OpticalSystem, lens: Lens, backend: Backend, target: NDArray[np.float64]
) -> dict[str, Any]:
    """Return the flux by fate, and the flux on the lit pixels of the target by any path, W.

    backend : of double precision.  target : (rows, columns); pixels above zero are lit.
    """
    rays = system.source.rays(RAYS, np.random.default_rng(system.problem.run.seed))
    rays = single_rays(rays, lens)
    result = trace_nonsequential(backend, lens, rays, _plane(system))
    landings, screen = result.landings, system.target.screen()
    (sx, ox), (sy, oy) = screen.pixel_map()
    column, row = (np.floor(a).astype(np.int64) for a in (landings.x * sx + ox, landings.y * sy + oy))
    on = (column >= 0) & (row >= 0) & (column < screen.pixels[0]) & (row < screen.pixels[1])
    lit = np.zeros_like(on)
    lit[on] = target[row[on], column[on]] > 0
    return {
        "lit_w": float(landings.flux[lit].sum()),
        "lit_direct_w": float(landings.flux[lit & result.direct].sum()),
        "target_w": float(landings.flux[on].sum()),
        "fates_w": asdict(result.fates),
    }


def fans(system: OpticalSystem, lens: Lens, backend: Backend) -> dict[str, list[RayPath]]:
    """Return the paths of two fans of rays from the source's centre in the plane x = 0.

    One has equal steps of the angle, the other of its sine.
    """
    source = system.problem.source
    widest = np.radians(source.half_angle) * WIDEST
    out = {}
    for name, sine in (
        ("equal angles", np.sin(np.linspace(-widest, widest, FAN))),
        ("equal steps of the sine", np.linspace(-1, 1, FAN) * np.sin(widest)),
    ):
        origin, direction = np.zeros((2, 3, FAN))
        origin[2] = -source.distance
        direction[1], direction[2] = sine, np.sqrt(1 - sine**2)
        out[name] = trace_paths(backend, lens, Rays(origin, direction, np.ones(FAN)), _plane(system))
    return out


def _plane(system: OpticalSystem) -> TargetPlane:
    return TargetPlane(system.target.z, system.target.settings.half_width)
