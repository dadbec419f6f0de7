"""How far small errors of making and mounting move the light.

Index, grade, colours and ripple are those of rays, traced with the error and without.  Light without extent
stands for that of a source with extent: the light of the point in its middle.  A decentre d moves what each
point of the shaped surface sends, and so details of the light, by

    D d / s    of a source at the optical distance s before the shaped surface, with the lever D behind it,
    d          of a lens in parallel light, with which the light moves.

On a target that light meets at an angle both are larger by its cosine, in the worse direction.  In the far
field D is 1, and the result is in degrees.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf, pi

import numpy as np

from optics.base.runtime import Backend
from optics.light.tracing import Tracer
from optics.scene.paths import AIR, LEAST_COSINE, LightPath
from optics.scene.sources import RayGrid, Rays
from optics.scene.system import System
from thbcad.checks import Floats

INDEX = 0.001
RIPPLE, PERIOD = 1e-3, 3.0  # mm
DECENTRE = 0.1  # mm
RAYS = (61, 59)


@dataclass(frozen=True)
class Sensitivity:
    """Shifts of the light on the target, mm, in the far field degrees: means by flux.

    index, index_most : by INDEX in every lens, mean and greatest; 0 of a mirror.  grade : by INDEX in the
    lens that is designed alone.  colours : between the outermost lines of the spectrum, by all lenses.
    ripple : by a slope as steep as that of RIPPLE with the period PERIOD, in the worse of two directions.
    decentre : by DECENTRE of the source against the lens.  inf : no light arrives both ways.
    """

    index: float
    index_most: float
    grade: float
    colours: float
    ripple: float
    decentre: float


def sensitivity(system: System, backend: Backend) -> Sensitivity:
    """Return the Sensitivity of a lens.  backend : of double precision."""
    path, rays = system.path, system.source.without_extent().rays(RAYS)
    landed = _landed(backend, path, rays)

    def shifts(other: LightPath, first: LightPath = path) -> tuple[float, float]:
        """Return the mean and the greatest shift of rays that arrive by both paths."""
        if other is first:
            return 0.0, 0.0
        before, weight = landed if first is path else _landed(backend, first, rays)
        points, flux = _landed(backend, other, rays)
        both = (flux > 0) & (weight > 0)
        if not both.any():
            return inf, inf
        shift = np.hypot(*(points - before)[:, both])
        return float(np.average(shift, weights=weight[both])), float(shift.max())

    def rippled(along: tuple[float, float]) -> float:
        """Return the mean shift by ripple that is steep along x or y."""
        errors: list[Floats | None] = [None] * len(path.surfaces)
        errors[path.shaped] = 2 * pi * RIPPLE / PERIOD * np.array(along)[:, None]
        return shifts(path.with_slope_errors(errors))[0]

    def denser(of: Sequence[bool]) -> LightPath:
        """Return the path with a greater index of those media behind a face that are named, and are glass."""
        return path.in_media(
            replace(m, index=m.index + INDEX) if some and m != AIR else m for some, m in zip(of, path.media)
        )

    index = shifts(denser([True] * len(path.media)))
    own = [False, *(face.optic is system.problem.optic for face in system.problem.faces_met)]
    grade = index if all(own[1:]) else shifts(denser(own))
    blue, red = (path.in_media(system.wavelengths[k].media) for k in (0, -1))
    colours = shifts(blue, red)
    ripple = max(rippled((1.0, 0.0)), rippled((0.0, 1.0)))
    return Sensitivity(*index, grade[0], colours[0], ripple, _decentre(system, path))


def _decentre(system: System, path: LightPath) -> float:
    """Return the shift by a decentre in the worst direction."""
    if system.source.beam and path.receiver.far_field:
        return 0.0
    if system.source.beam:
        shaped, *behind = path.surfaces[path.shaped :]
        across = shaped.pose.rotation[:, :2]
        for axis in [surface.pose.rotation[:, 2] for surface in behind if surface.kind == "reflect"]:
            across = across - 2 * np.outer(axis, axis @ across)
        ray, normal = path.leaving.rotation[:, 2], np.array(path.receiver.normal(0.0, 0.0))
        cosine = float(ray @ normal)
        along = np.outer(ray, normal @ across) / np.copysign(max(abs(cosine), LEAST_COSINE), cosine)
        return DECENTRE * float(np.linalg.norm(across - along, 2))
    vertices = [np.array(system.source.middle), *(surface.pose.shift for surface in path.surfaces)]
    ways = [np.linalg.norm(b - a) / m.index for a, b, m in zip(vertices, vertices[1:], path.media)]
    return DECENTRE * path.lever / float(sum(ways[: path.shaped + 1]))


def _landed(backend: Backend, path: LightPath, rays: RayGrid | Rays) -> tuple[Floats, Floats]:
    """Return where rays land, (2, n), and their flux there, 0 of those that do not arrive."""
    with backend.dr.suspend_grad():
        _, landing = Tracer(backend, path, rays).trace()
        flux = backend.dr.select(landing.arrives, landing.flux, 0)
        backend.dr.eval(landing.x, landing.y, flux)
    return np.stack([landing.x.numpy(), landing.y.numpy()]), flux.numpy()
