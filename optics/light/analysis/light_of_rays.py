"""Irradiance by rays: the mean of independent replicates, whose spread is its error.

Every replicate traces another scrambling of the source's quasi-random points, which is unbiased.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import reduce
from math import ceil, isqrt, sqrt
from operator import add
from typing import Any

import numpy as np

from optics.base.runtime import Backend, DrArray
from optics.light.analysis.light_estimate import REPLICATES, Light, LightEstimate
from optics.light.measuring import Splat
from optics.light.tracing import Landing, SequentialFates, Tracer
from optics.scene.paths import LightPath
from optics.scene.problem import MAX_PIXELS
from optics.scene.receivers import BoxWindow, Screen, with_mirror_images
from optics.scene.sources import LightSource, RayGrid, Rays, mirror_half
from optics.scene.system import System
from thbcad.checks import Floats

RAYS_PER_PIXEL = 240  # of all replicates together
LEAST_PER_PIXEL, MOST_RAYS = 18, 1 << 25  # on large screens: so many per pixel, or so many in all
RAYS_AT_ONCE = 1 << 19  # more only take more memory


def ray_irradiance(
    system: System,
    path: LightPath,
    screen: Screen,
    backend: Backend,
    count: int | None = None,
    axes: Sequence[int] = (),
    boxes: Screen | None = None,
) -> tuple[LightEstimate, SequentialFates]:
    """Return (irradiance in box pixels along a path, W/mm^2, mean flux by fate).

    system : whose source shines, and whose surfaces are rough.  count : of rays; None is `ray_count`.
    boxes : a second screen, on which the same light is measured.
    axes : directions in which the light is its own mirror image, see `light_axes`: one half of it is traced.
    """
    side = isqrt((count or ray_count(screen)) // REPLICATES) + 1
    rng = np.random.default_rng(system.problem.run.seed)
    fates: list[SequentialFates] = []
    screens = [screen] if boxes is None else [screen, boxes]

    def replicates() -> Iterator[Light]:
        for parts in system.source.replicates(REPLICATES, (side, side), rng, RAYS_AT_ONCE):
            half = (mirror_half(part, axes) if isinstance(part, Rays) else part for part in parts)
            images, by_fate = light_of_parts(path, system.slope_rms, screens, half, rng, backend)
            fates.append(by_fate * 2 ** len(axes))
            whole = [with_mirror_images(image, axes) for image in images]
            yield Light.of(whole, fates[-1].on_target, fates[-1].off_target)

    light = LightEstimate.of_replicates(replicates())
    return light, reduce(add, fates) / REPLICATES


def ray_count(screen: Screen) -> int:
    """Return how many rays of all replicates together measure the light on a screen, about."""
    pixels = screen.pixels[0] * screen.pixels[1]
    return max(LEAST_PER_PIXEL * pixels, min(RAYS_PER_PIXEL * pixels, MOST_RAYS))


def pixels_for(rays: float, pixels: Sequence[int]) -> tuple[int, int] | None:
    """Return columns and rows of pixels, in proportion, that `ray_count` measures by so many rays.

    None where the problem file takes no so many pixels.
    """
    wanted = rays / (RAYS_PER_PIXEL if rays <= MOST_RAYS else LEAST_PER_PIXEL)
    columns, rows = (ceil(n * sqrt(wanted / (pixels[0] * pixels[1]))) for n in pixels)
    return (columns, rows) if max(columns, rows) <= MAX_PIXELS else None


def ray_numbers(source: LightSource, screen: Screen, wanted: int) -> dict[str, Any]:
    """Return about how many rays measure the light, on which pixels, and how many a ray file has where it has
    no more.  wanted : rays that were asked for."""
    if source.most_rays > wanted:
        return {"rays": wanted, "pixels": list(screen.pixels)}
    return {"rays": int(source.most_rays), "rays_of_file": int(source.most_rays)}


def light_of_parts(
    path: LightPath,
    slope_rms: Sequence[float],
    screens: Sequence[Screen],
    parts: Iterator[RayGrid | Rays],
    fresh: np.random.Generator,
    backend: Backend,
) -> tuple[list[Floats], SequentialFates]:
    """Return (irradiance of every screen, (rows, columns), flux by fate) of rays, traced in parts.

    slope_rms, fresh : as of `traced_parts`.  Fates are of the first screen.
    """
    splats = [Splat(backend, screen, BoxWindow()) for screen in screens]
    images: list[DrArray] = [0.0] * len(screens)
    fates = []
    for tracer, landing in traced_parts(path, slope_rms, parts, fresh, backend):
        images = [image + splat(landing.x, landing.y, landing.flux) for image, splat in zip(images, splats)]
        fates.append(tracer.fates(landing, screens[0].half_width))
    shaped = [image.numpy().reshape(s.shape, order="F") for image, s in zip(images, screens)]
    return shaped, reduce(add, fates)


def traced_parts(
    path: LightPath,
    slope_rms: Sequence[float],
    parts: Iterator[RayGrid | Rays],
    fresh: np.random.Generator,
    backend: Backend,
) -> Iterator[tuple[Tracer, Landing]]:
    """Yield (tracer, landing) of parts of rays, without derivatives.

    slope_rms : rad, of each surface.  fresh : draws their slope errors.
    """
    for part in parts:
        errors = [fresh.normal(0, rms, (2, part.flux.size)) if rms else None for rms in slope_rms]
        tracer = Tracer(backend, path.with_slope_errors(errors), part)
        yield tracer, tracer.landed()
