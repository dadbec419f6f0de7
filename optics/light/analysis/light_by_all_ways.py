"""The light of a lens by all the ways on which it comes: along the path, by edges, and past elements.

Light that misses an element goes on past it, through the other elements, to the target.

A holder stops such light only where the problem has one: a stop, or `clear_aperture`, which is the opening of
an opaque holder.  Else light is followed along the path without the element that it misses, whose body stays
in its way.  What meets that body there meets its wall, and is not part of this light.

Light that misses several elements is followed past all of them, one set of elements after the other.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial, reduce
from math import ceil, hypot
from operator import add
from typing import Any

import numpy as np

from optics.base.runtime import Backend
from optics.light.analysis.closed_lens_light import NEGLIGIBLE, OtherLight, nonsequential_light
from optics.light.analysis.light_estimate import REPLICATES, Light, LightEstimate
from optics.light.analysis.light_of_beams import beam_irradiance
from optics.light.analysis.light_of_cells import grid_irradiance
from optics.light.analysis.light_of_rays import MOST_RAYS, light_of_parts, ray_count, ray_irradiance
from optics.light.analysis.light_of_wavelengths import SpectralLight, coloured, light_of_plate
from optics.light.measuring import light_axes
from optics.light.tracing import SequentialFates
from optics.scene.problem import Optic
from optics.scene.receivers import Screen
from optics.scene.system import System

ESTIMATES = {"cells": grid_irradiance, "beams": beam_irradiance}
WORTH = 1e-4  # of the light on the target along the path: less light past elements is not followed
ROUNDING = 1e-9  # of the source's flux
PILOT = (96, 96)  # rays of a replicate that tell how much of it meets the target
RAYS = (512, 512)  # of a replicate: no surface shapes most of this light, so that it is smooth
AT_ONCE = 1 << 18  # rays: each that comes near a body is searched for there
STREAM = 4  # of random numbers, other than those of the other traces


@dataclass(frozen=True, eq=False)
class PastLight:
    """Light that misses elements.

    light : its LightEstimate on the screen.  missed : the elements that light on the target missed.
    """

    light: LightEstimate
    missed: tuple[Optic, ...]

    def shares(self, on_target: float, flux: float) -> dict[str, Any]:
        """Return its numbers by name.  on_target, flux : of all light, W."""
        halves = [
            [max(pair) for pair in zip(optic.front.half_width, optic.rear.half_width)]
            for optic in self.missed
        ]
        return {
            "missed": [optic.called for optic in self.missed],
            "holders": [
                f"{optic.key('clear_aperture')}=[{x:g},{y:g}]" for optic, (x, y) in zip(self.missed, halves)
            ],
            "share_of_target": self.light.on_target / on_target,
            "past_on_target": self.light.on_target / flux,
            "past_off_target": self.light.off_target / flux,
        }


def light_past_elements(
    system: System,
    fates: SequentialFates,
    screen: Screen,
    backend: Backend,
    boxes: Screen | None = None,
) -> PastLight | None:
    """Return the light that misses elements, on a screen; None where next to none does.

    Light past the lenses of a plate meets its land or other lenses, and is not followed.

    fates : of the light along the whole path.  backend : of double precision.
    boxes : a second screen, on which the same light is measured.
    """
    screens = [screen] if boxes is None else [screen, boxes]
    if system.problem.optic.array is not None:
        return None
    least = max(WORTH * fates.on_target, ROUNDING * system.problem.flux)
    optics = system.problem.optics
    held = {k for k, optic in enumerate(optics) if any(optic.clear_aperture)}
    todo = [frozenset((k,)) for k in _missed_elements(system, fates, (), least) - held]
    known, lights, missed_on_target = set(todo), list[LightEstimate](), set[int]()
    while todo:
        missed = todo.pop()
        light, found = _light_past(system, missed, screens, backend, least)
        lights.append(light)
        if light.on_target > least:
            missed_on_target |= missed
        more = {missed | {k} for k in _missed_elements(system, found, missed, least) - held} - known
        known |= more
        todo.extend(more)
    if not lights:
        return None
    return PastLight(reduce(add, lights), tuple(optics[k] for k in sorted(missed_on_target)))


def _missed_elements(
    system: System, fates: SequentialFates, missed: Collection[int], least: float
) -> set[int]:
    """Return the numbers of elements that more than `least` of the light, W, misses before it meets them.

    missed : elements that the path of these fates leaves out.
    """
    left = [k for k in _owners(system) if k not in missed]
    return {
        left[fate.number]
        for fate, flux in fates.flux.items()
        if fate.what == "missed" and flux > least and left[fate.number] not in left[: fate.number]
    }


def _owners(system: System) -> list[int]:
    """Return the number of the element that each face along the path belongs to."""
    number = {id(optic): k for k, optic in enumerate(system.problem.optics)}
    return [number[id(face.optic)] for face in system.problem.faces_met]


def _light_past(
    system: System, missed: Collection[int], screens: Sequence[Screen], backend: Backend, least: float
) -> tuple[LightEstimate, SequentialFates]:
    """Return (light past some elements, its mean flux by fate).

    missed : their numbers.  least : W, no more on the screen is not worth many rays.
    """
    faces = [k for k, owner in enumerate(_owners(system)) if owner in missed]
    rough = [rms for k, rms in enumerate(system.slope_rms) if k not in faces]
    whole = system.crowded_path
    ways = [(share, way.past(faces)) for share, way in coloured(system, whole)]
    rng = np.random.default_rng((system.problem.run.seed, STREAM))

    def measured(counts: tuple[int, int]) -> tuple[LightEstimate, SequentialFates]:
        lights, every = zip(*replicates(counts))
        return LightEstimate.of_replicates(lights), reduce(add, every) / REPLICATES

    def replicates(counts: tuple[int, int]) -> Iterator[tuple[Light, SequentialFates]]:
        for parts in system.source.whole.replicates(REPLICATES, counts, rng, AT_ONCE):
            rays = [part.rays(whole.before) for part in parts]
            every = [(s, light_of_parts(way, rough, screens, iter(rays), rng, backend)) for s, way in ways]
            fates = reduce(add, (by_fate * share for share, (_, by_fate) in every))
            on, off = fates.on_target, fates.off_target
            images = (Light.of(images, 0.0, 0.0) * share for share, (images, _) in every)
            yield replace(reduce(add, images), on=np.asarray(on), off=np.asarray(off)), fates

    light, fates = measured(PILOT)
    return (light, fates) if fates.on_target <= least else measured(RAYS)


@dataclass(frozen=True, eq=False)
class AllLight:
    """The light of a lens by the ways on which it comes.

    direct : along the path.  other : by non-sequential paths, None where it is not followed.
    past : that misses elements, None where there is none.  rays : that measured the light along the path.
    """

    direct: SpectralLight
    other: OtherLight | None
    past: PastLight | None
    rays: int

    @property
    def all_ways(self) -> bool:
        """Whether light by non-sequential paths is not negligible."""
        return self.other is not None and not self.other.negligible

    @property
    def added(self) -> list[LightEstimate]:
        """What counts beside the light along the path."""
        return [each.light for each in (self.other if self.all_ways else None, self.past) if each]

    @property
    def light(self) -> LightEstimate:
        """All that counts."""
        return reduce(add, self.added, self.direct.estimate)

    @property
    def off_target(self) -> tuple[float, float]:
        """All light outside the target that is known, however little it is, and its standard error, W."""
        light, few = self.light, self.other.light if self.other and not self.all_ways else None
        if few is None:
            return light.off_target, light.error_of_off_target
        return light.off_target + few.off_target, hypot(light.error_of_off_target, few.error_of_off_target)


def all_light(
    system: System, screen: Screen, backend: Backend, more: float = 1.0, boxes: Screen | None = None
) -> AllLight:
    """Return the light of a lens by all ways.

    more : times the usual rays.  boxes : a second screen, on which the same light is measured.
    """
    path = system.shaded_path
    estimate = partial(estimate_of(estimator_of(system), system), boxes=boxes)
    rays = ray_count(screen)
    if more > 1:
        rays = max(rays, min(int(more * rays), MOST_RAYS))
        estimate = partial(estimate, count=rays)
    direct = light_of_plate(system, path, screen, backend, estimate)
    # light may come by other ways: of a beam, where its front sends enough of it beside the rear, or walls
    beside = system.body is not None or direct.fates.missed_rear > NEGLIGIBLE * system.problem.flux
    by_edges = system.by_edges and (not system.source.collimated or beside)
    replicates = ceil(more) * REPLICATES
    other = nonsequential_light(system, screen, backend, replicates, boxes) if by_edges else None
    past = light_past_elements(system, direct.fates, screen, backend, boxes)
    return AllLight(direct, other, past, rays)


def estimate_of(estimator: str, system: System) -> Callable[..., tuple[LightEstimate, SequentialFates]]:
    """Return how the light of a lens is estimated; of symmetric light half of the rays do."""
    if estimator == "rays":
        return partial(ray_irradiance, axes=light_axes(system))
    return ESTIMATES[estimator]


def estimator_of(system: System) -> str:
    """Return how light is measured: by beams of cells for all that blurs it, or by rays."""
    return "beams" if system.blurred else "rays" if system.source.extended else "cells"
