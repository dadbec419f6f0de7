"""Light that misses an element and goes on: past it, through the other elements, to the target.

A holder stops such light only where the problem has one: a stop, or `clear_aperture`, which is the opening of
an opaque holder.  Else light is followed along the path without the element that it misses, whose body stays
in its way.  What meets that body there meets its wall, and is not part of this light.

Light that misses several elements is followed past all of them, one set of elements after the other.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from functools import reduce
from operator import add
from typing import Any

import numpy as np

from optics.base.runtime import Backend
from optics.light.analysis.light_estimate import LightEstimate
from optics.light.analysis.light_of_rays import light_of_parts
from optics.light.analysis.light_of_wavelengths import coloured
from optics.light.tracing import SequentialFates
from optics.scene.problem import Optic
from optics.scene.receivers import Screen
from optics.scene.system import OpticalSystem
from thbcad.checks import Floats
from thbcad.lens import Lens

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
