"""The light of a lens by all the ways on which it comes: along the path, by edges, and past elements.

Light that misses an element goes on past it, through the other elements, to the target.

A holder stops such light only where the problem has one: a stop, or `clear_aperture`, which is the opening of
an opaque holder.  Else light is followed along the path without the element that it misses, whose body stays
in its way.  What meets that body there meets its wall, and is not part of this light.

Light that misses several elements is followed past all of them, one set of elements after the other.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from functools import partial, reduce
from math import ceil
from operator import add
from typing import Any

import numpy as np

from optics.base.runtime import Backend
from optics.light.analysis.closed_lens_light import (
    NEGLIGIBLE,
    REPLICATES as OTHER_REPLICATES,
    OtherLight,
    nonsequential_light,
)
from optics.light.analysis.light_estimate import LightEstimate
from optics.light.analysis.light_of_beams import beam_irradiance
from optics.light.analysis.light_of_cells import grid_irradiance
from optics.light.analysis.light_of_rays import MOST_RAYS, light_of_parts, ray_count, ray_irradiance
from optics.light.analysis.light_of_wavelengths import SpectralLight, coloured, light_of_plate
from optics.light.analysis.photometric_metrics import uniformity_metrics
from optics.light.measuring import light_axes
from optics.light.tracing import SequentialFates
from optics.scene.photometry import NOISE
from optics.scene.problem import Optic
from optics.scene.receivers import Screen
from optics.scene.system import OpticalSystem
from thbcad.checks import Floats
from thbcad.lens import Lens

MOST_MORE = 8.0  # times the usual rays, which a measurement takes before it says that noise hides a number
SURER = 1.2  # times the rays that the noise of the first ones asks for
ESTIMATES = {"cells": grid_irradiance, "beams": beam_irradiance}
WORTH = 1e-4  # of the light on the target along the path: less light past elements is not followed
ROUNDING = 1e-9  # of the source's flux
PILOT = (256, 256)  # rays that tell how much of it meets the target
RAYS = (512, 512)  # of a replicate: no surface shapes most of this light, so that it is smooth
REPLICATES = 4
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
    system: OpticalSystem, lens: Lens, fates: SequentialFates, screen: Screen, backend: Backend
) -> PastLight | None:
    """Return the light that misses elements, on a screen; None where next to none does.

    Light past the lenses of a plate meets its land or other lenses, and is not followed.

    fates : of the light along the whole path.  backend : of double precision.
    """
    if system.problem.optic.array is not None:
        return None
    least = max(WORTH * fates.on_target, ROUNDING * system.problem.flux)
    optics = system.problem.optics
    held = {k for k, optic in enumerate(optics) if any(optic.clear_aperture)}
    todo = [frozenset((k,)) for k in _missed_elements(system, fates, (), least) - held]
    known, lights, missed_on_target = set(todo), list[LightEstimate](), set[int]()
    while todo:
        missed = todo.pop()
        light, found = _light_past(system, lens, missed, screen, backend, least)
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
    system: OpticalSystem, fates: SequentialFates, missed: Collection[int], least: float
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


def _owners(system: OpticalSystem) -> list[int]:
    """Return the number of the element that each face along the path belongs to."""
    number = {id(optic): k for k, optic in enumerate(system.problem.optics)}
    return [number[id(face.optic)] for face in system.problem.faces_met]


def _light_past(
    system: OpticalSystem,
    lens: Lens,
    missed: Collection[int],
    screen: Screen,
    backend: Backend,
    least: float,
) -> tuple[LightEstimate, SequentialFates]:
    """Return (light past some elements, its mean flux by fate).

    missed : their numbers.  least : W, no more on the screen is not worth an image.
    """
    faces = [k for k, owner in enumerate(_owners(system)) if owner in missed]
    rough = [rms for k, rms in enumerate(system.slope_rms) if k not in faces]
    whole = system.crowded_path(lens)
    ways = [(share, way.past(faces)) for share, way in coloured(system, whole)]
    rng = np.random.default_rng((system.problem.run.seed, STREAM))

    def replicates(number: int, counts: tuple[int, int]) -> Iterator[tuple[Floats, SequentialFates]]:
        for parts in system.source.whole.replicates(number, counts, rng, AT_ONCE):
            rays = [part.rays(whole.before) for part in parts]
            every = [(s, light_of_parts(way, rough, screen, iter(rays), rng, backend)) for s, way in ways]
            yield (
                reduce(add, (share * image for share, (image, _) in every)),
                reduce(add, (by_fate * share for share, (_, by_fate) in every)),
            )

    ((image, fates),) = replicates(1, PILOT)
    if fates.on_target <= least:
        none = np.zeros_like(image)
        return LightEstimate(none, none, 0.0, fates.off_target), fates
    sets = [*replicates(REPLICATES, RAYS)]
    light = LightEstimate.of_replicates((image, f.on_target, f.off_target) for image, f in sets)
    return light, reduce(add, (f for _, f in sets)) / REPLICATES


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
    def everywhere(self) -> LightEstimate:
        """All that is known, however little it is."""
        every = [each.light for each in (self.other, self.past) if each]
        return reduce(add, every, self.direct.estimate)


def all_light(
    system: OpticalSystem, lens: Lens, screen: Screen, backend: Backend, more: float = 1.0
) -> AllLight:
    """Return the light of a lens by all ways.  more : times the usual rays."""
    path, estimate = system.shaded_path(lens), estimate_of(estimator_of(system), system, lens)
    rays = ray_count(screen)
    if more > 1:
        rays = max(rays, min(int(more * rays), MOST_RAYS))
        estimate = partial(estimate, count=rays)
    direct = light_of_plate(system, path, screen, backend, estimate)
    # light may come by other ways: of a beam, where its front sends enough of it beside the rear, or walls
    beside = system.body is not None or direct.fates.missed_rear > NEGLIGIBLE * system.problem.flux
    by_edges = system.by_edges and (not system.source.collimated or beside)
    replicates = ceil(more * OTHER_REPLICATES)
    other = nonsequential_light(system, lens, screen, backend, replicates) if by_edges else None
    past = light_past_elements(system, lens, direct.fates, screen, backend)
    return AllLight(direct, other, past, rays)


def more_rays(system: OpticalSystem, found: AllLight, screen: Screen, blur: float) -> float:
    """Return how many times the rays tell the uniformity that their noise hides; 1 where none does, or where
    that takes more than MOST_MORE times.  blur : as of `delivered`."""
    fixed = system.source.most_rays <= found.rays
    if system.target.uniform_region is None or estimator_of(system) != "rays" or fixed:
        return 1.0
    light = found.light.over(screen.projection())
    seen = uniformity_metrics(system, light.irradiance, light.noise, blur, light.axes, light.drift)
    if seen["min_over_mean"] is not None or seen["noise"] <= NOISE:
        return 1.0
    more = SURER * (seen["noise"] / NOISE) ** 2
    return more if more <= MOST_MORE else 1.0


def estimate_of(
    estimator: str, system: OpticalSystem, lens: Lens
) -> Callable[..., tuple[LightEstimate, SequentialFates]]:
    """Return how the light of a lens is estimated; of symmetric light half of the rays do."""
    if estimator == "rays":
        return partial(ray_irradiance, axes=light_axes(system, lens))
    return ESTIMATES[estimator]


def estimator_of(system: OpticalSystem) -> str:
    """Return how light is measured: by beams of cells for all that blurs it, or by rays."""
    return "beams" if system.blurred else "rays" if system.source.extended else "cells"
