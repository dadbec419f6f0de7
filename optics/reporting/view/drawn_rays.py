"""What stands between source and target in pictures: rays, and stops as thin plates."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from optics.base.runtime import Backend
from optics.light.tracing import RayPath, ShadingBody, TargetArea, Tracer, trace_paths
from optics.scene.paths import LightPath, Stop
from optics.scene.receivers import receiver_at
from optics.scene.sources import Rays
from optics.scene.system import System
from thbcad.checks import Floats
from thbcad.outlines import Outline

BUNDLE = (8, 8)  # rays
FAR = 4.0  # half-widths of the last surface behind it, to where rays to the far field are drawn
AROUND = 1.25  # half-widths of a hole, or of the lens: so large plates without end are drawn
POINTS = 65  # of an ellipse


def scene_paths(system: System, backend: Backend) -> list[RayPath]:
    """Return the paths of the rays with light, of some 64 of the source, to the target or its direction.

    Through a lens it follows the stronger part at every face, by a mirror it goes from surface to surface.

    backend : of double precision
    """
    path, half_width = system.shaded_path.seen_from(system.pose), system.target.settings.half_width
    rays = system.own_rays(system.source.rays(BUNDLE))
    lit = rays.flux > 0
    if lit.any():
        rays = Rays(rays.origin[:, lit], rays.direction[:, lit], rays.flux[lit])
    if system.target.far_field:
        path = path.onto(receiver_at(FAR * max(path.surfaces[-1].shape.half_width), path.leaving))
        half_width = np.inf, np.inf
    if not system.lone_lens:
        found = sequential_paths(backend, path, rays, half_width)
    else:
        found = trace_paths(backend, system.solid, rays, TargetArea.of(path, half_width))
    return [RayPath(system.pose.points(ray.points.T).T, ray.fate) for ray in found]


def sequential_paths(
    backend: Backend, path: LightPath, rays: Rays, half_width: tuple[float, float]
) -> list[RayPath]:
    """Return rays along a light path, for drawing, with fates of `SequentialFates`, or "back".

    A ray that misses a surface ends beside it; one that leaves the last away from the receiver ends there.
    """
    with backend.dr.suspend_grad():
        hits, landing = Tracer(backend, path, rays).trace_all()
    n = rays.flux.size
    ends, parts, fates = [rays.origin], np.ones(n, dtype=int), np.full(n, "on_target", dtype=object)

    def go(there: Floats, lost: dict[str, Floats]) -> None:
        """Take rays to points (3, n).  lost : who ends there by fate, first the fate that comes first."""
        going = fates == "on_target"
        for fate, some in lost.items():
            fates[(fates == "on_target") & (some > 0)] = fate
        parts[going & (fates != "back")] += 1
        ends.append(np.where(fates == "blocked", _in_the_way(backend, path, ends[-1], there), there))

    for k, (surface, passage, met) in enumerate(zip(path.surfaces, landing.passages, hits)):
        assert met is not None  # rays are given one by one
        direction = surface.pose.directions(_rows(passage.before.direction, n))
        reach = max(surface.shape.half_width) + surface.pose.shift @ direction - (ends[-1] * direction).sum(0)
        hit, found, goes_on, blocked = _rows((met.hit, passage.found, passage.goes_on, passage.blocked), n)
        there = surface.pose.points(_rows((met.x, met.y, met.z), n))
        missed = "missed_rear" if k else "beside_lens"
        go(
            np.where(hit > 0, there, ends[-1] + reach * direction),
            {"blocked": blocked, "unresolved": 1 - found, missed: 1 - hit, "total_internal": 1 - goes_on},
        )
    u, v, arrives, blocked = _rows((landing.x, landing.y, landing.arrives, landing.blocked), n)
    beside = (abs(u) > half_width[0]) | (abs(v) > half_width[1])
    there = np.stack(np.broadcast_arrays(*path.receiver.points(u, v)))
    go(there, {"blocked": blocked, "back": 1 - arrives, "off_target": beside})
    ways = np.stack(ends)
    return [RayPath(ways[:count, :, k], fate) for k, (count, fate) in enumerate(zip(parts, fates))]


def _in_the_way(backend: Backend, path: LightPath, start: Floats, end: Floats) -> Floats:
    """Return where stops and bodies take light on its way between points; its end where they do not."""
    length = np.maximum(np.sqrt(((end - start) ** 2).sum(axis=0)), np.finfo(float).tiny)
    direction, first = (end - start) / length, length
    for stop in path.stops:
        first = np.minimum(first, stop.distance(start, direction))
    for body in path.bodies:
        first = np.minimum(first, ShadingBody(backend, body).lengths(body.pose, start, direction)[1])
    return start + first * direction


def _rows(values: Iterable[Any], n: int) -> Floats:
    """Return arrays of the device, or numbers, as rows of n numbers."""
    return np.stack([np.zeros(n) + (v.numpy() if hasattr(v, "numpy") else v) for v in values])


def stop_rims(system: System) -> list[list[Floats]]:
    """Return the rims of every stop, (3, n) each, mm: the outer one first, each the other way round."""
    lens = system.designed
    hx, hy = (max(pair) for pair in zip(lens.front.half_width, lens.rear.half_width))
    return [_rims(stop, (hx, hy)) for stop in system.stops]


def _rims(stop: Stop, size: tuple[float, float]) -> list[Floats]:
    outlines = [stop.outline] if stop.inner is None else [stop.outline, stop.inner]
    if stop.hole:
        hx, hy = (AROUND * max(pair) for pair in zip(size, stop.outline.half_width))
        outlines = [Outline((hx, hy)), *outlines]
    rims = [stop.pose.points(_rim(outline)) for outline in outlines]
    return [rim[:, :: -1 if k % 2 else 1] for k, rim in enumerate(rims)]


def _rim(outline: Outline) -> Floats:
    """Return points along a rectangle or an ellipse, in its plane, (3, n)."""
    hx, hy = outline.half_width
    if outline.is_rectangle:
        return np.array([[-hx, hx, hx, -hx], [-hy, -hy, hy, hy], [0.0] * 4])
    angle = np.linspace(0, 2 * np.pi, POINTS)
    return np.stack([hx * np.cos(angle), hy * np.sin(angle), np.zeros(POINTS)])
