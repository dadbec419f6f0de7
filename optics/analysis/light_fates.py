"""Where the light of a spreading source goes in the closed lens: edges, reflections and all."""

from __future__ import annotations

from dataclasses import asdict
from math import isinf
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from optics.system import problem_rays, target_screen
from optics.tracing import RayPath, SourceRays, TargetPlane, trace_nonsequential, trace_paths

if TYPE_CHECKING:
    from optics.problem import Problem
    from optics.runtime import Backend
    from thbcad.lens import Lens

RAYS = (256, 256)
FAN = 8
WIDEST = 0.98  # of the cone's half-angle: the outermost rays of a fan


def follows_edges(problem: Problem) -> bool:
    """Return whether light may reach the target by other ways than through front and rear.

    The non-sequential trace needs a target plane.  Parallel beams are left out: where a curved front sends
    them into the edges, the fate `missed_rear` tells.
    """
    return problem.source.kind != "collimated" and not isinf(problem.target_z)


def nonsequential_figures(
    backend: Backend, problem: Problem, lens: Lens, target: NDArray[np.float64]
) -> dict[str, Any]:
    """Return the flux by fate, and the flux on the lit pixels of the target by any way, W.

    backend : of double precision.  target : (rows, columns); pixels above zero are lit.
    """
    rays = problem_rays(problem, RAYS, np.random.default_rng(problem.run.seed))
    flux = np.broadcast_to(rays.ray_flux, rays.origin.shape[1])
    result = trace_nonsequential(
        backend, lens, SourceRays(rays.origin, rays.direction, flux), _plane(problem)
    )
    landings, screen = result.landings, target_screen(problem)
    (sx, ox), (sy, oy) = screen.pixel_map()
    column, row = (np.floor(a).astype(np.int64) for a in (landings.x * sx + ox, landings.y * sy + oy))
    on = (column >= 0) & (row >= 0) & (column < screen.pixels[0]) & (row < screen.pixels[1])
    lit = np.zeros_like(on)
    lit[on] = target[row[on], column[on]] > 0
    return {
        "lit": float(landings.flux[lit].sum()),
        "lit_direct": float(landings.flux[lit & landings.direct].sum()),
        "target": float(landings.flux[on].sum()),
        **{f"fate_{name}": value for name, value in asdict(result.fates).items()},
    }


def fans(backend: Backend, problem: Problem, lens: Lens) -> dict[str, list[RayPath]]:
    """Return the paths of two fans of rays from the source's middle in the plane x = 0: equal steps of the
    angle, and of its sine."""
    widest = np.radians(problem.source.half_angle) * WIDEST
    out = {}
    for name, sine in (
        ("equal angles", np.sin(np.linspace(-widest, widest, FAN))),
        ("equal steps of the sine", np.linspace(-1, 1, FAN) * np.sin(widest)),
    ):
        origin, direction = np.zeros((2, 3, FAN))
        origin[2] = -problem.source.distance
        direction[1], direction[2] = sine, np.sqrt(1 - sine**2)
        out[name] = trace_paths(backend, lens, SourceRays(origin, direction, np.ones(FAN)), _plane(problem))
    return out


def _plane(problem: Problem) -> TargetPlane:
    return TargetPlane(problem.target_z, problem.target.half_width)
