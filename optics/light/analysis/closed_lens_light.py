"""Light by non-sequential paths, which pass not just front and rear: inner reflections, edges and all.

A sample of rays is followed through the closed lens with every split, and once more through front and rear
alone.  The difference of the two images is what non-sequential paths bring; paths that both tracers know
cancel in it.  Branches of little flux are decided by Russian roulette, so that the mean stays and the work
shrinks.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass, replace
from itertools import islice

import numpy as np

from optics.base.runtime import Backend
from optics.light.analysis.light_estimate import REPLICATES, Light, LightEstimate
from optics.light.measuring import light_axes
from optics.light.tracing import (
    FATES,
    Branches,
    Fates,
    SequentialFates,
    TargetArea,
    Tracer,
    trace_nonsequential,
)
from optics.scene.receivers import Screen, with_mirror_images
from optics.scene.sources import Rays, mirror_half
from optics.scene.system import System
from thbcad.checks import Floats

NEGLIGIBLE = 0.01  # of the light on the target: non-sequential paths that may be left out
RAYS = (256, 256)  # of a replicate
AT_ONCE = 1 << 20  # rays of a source; they are joined again
PILOT = 2  # replicates, which tell whether the others are needed
ROULETTE = 0.2  # of a ray's flux: the variance times the work is least there (extended source, measured)
# fates of light that went through the lens; what passes beside it is taken as stopped by the mount
THROUGH = [k for k, fate in enumerate(FATES) if fate.endswith(("on_target", "off_target"))]
STREAM = 1  # of random numbers, other than that of the sequential trace


@dataclass(frozen=True, eq=False)
class OtherLight:
    """What non-sequential paths bring.

    light : its LightEstimate; noise may make pixels negative.  fates : of all light in the closed lens, W.
    share : of the light on the target; negative where a body takes more light away than it adds.
    onto_rear : its rays on their last way within the lens, if they leave by the rear; in the lens's frame.
    """

    light: LightEstimate
    fates: Fates
    share: float
    onto_rear: Rays | None

    @property
    def negligible(self) -> bool:
        return abs(self.share) <= NEGLIGIBLE


def nonsequential_light(
    system: System,
    screen: Screen,
    backend: Backend,
    replicates: int | None = None,
    boxes: Screen | None = None,
) -> OtherLight:
    """Return the light of non-sequential paths on a screen.

    backend : of double precision.  replicates : at least PILOT; None is REPLICATES.
    boxes : a second screen, on which the same light is measured.
    """
    rng = np.random.default_rng((system.problem.run.seed, STREAM))
    lights: list[Light] = []
    screens = [screen] if boxes is None else [screen, boxes]
    fates: list[Fates] = []
    within: list[Branches] = []
    solid, plane = system.solid, TargetArea.of(system.own_path, screen.half_width)
    axes = light_axes(system)
    copies = 2 ** len(axes)
    number = replicates or REPLICATES
    sets = system.source.replicates(number, RAYS, rng, AT_ONCE)

    def trace(count: int) -> OtherLight:
        """All at once: most generations of branches are few, and cost what they cost by their number."""
        parts = [
            Rays.joined([mirror_half(system.own_rays(part), axes) for part in each])
            for each in islice(sets, count)
        ]
        every = trace_nonsequential(
            backend, solid, Rays.joined(parts), plane, threshold=ROULETTE, roulette=rng
        )
        through, ends = np.isin(every.fate, THROUGH), np.cumsum([0, *(part.flux.size for part in parts)])
        for rays, first, stop in zip(parts, ends, ends[1:]):
            points, fluxes, direct = _through_front_and_rear(system, screen, rays, backend)
            own = through & (first <= every.ray) & (every.ray < stop)
            images = [
                s.binned(every.landings.points[own], every.landings.flux[own]) - s.binned(points, fluxes)
                for s in screens
            ]
            by_fate = Fates(*(copies * every.by_ray[:, first:stop].sum(axis=1)).tolist())
            ways = by_fate.onto - copies * direct.on_target, by_fate.beside - copies * direct.off_target
            whole = [with_mirror_images(i, axes) / s.pixel_area for i, s in zip(images, screens)]
            lights.append(Light.of(whole, *ways))
            fates.append(by_fate)
        within.append(every.onto_rear)
        light = LightEstimate.of_replicates(lights)
        mean = Fates(*np.mean([astuple(by_fate) for by_fate in fates], axis=0).tolist())
        share = light.on_target / mean.onto if mean.onto else 0.0
        last = sum(within[1:], start=within[0])
        flux = copies / len(fates) * last.flux
        onto_rear = Rays(last.origin, last.direction, flux) if flux.size else None
        return OtherLight(light, mean, share, onto_rear)

    pilot, more = trace(PILOT), number - PILOT
    if not more or pilot.negligible:
        return pilot
    whole = trace(more)
    return replace(whole, light=whole.light.grouped(REPLICATES)) if number > REPLICATES else whole


def _through_front_and_rear(
    system: System, screen: Screen, rays: Rays, backend: Backend
) -> tuple[Floats, Floats, SequentialFates]:
    """Return where rays land by the direct way, (n, 2), with which flux, (n,) W, and its fates."""
    tracer = Tracer(backend, system.own_path, rays)
    landing = tracer.landed()
    direct = tracer.fates(landing, screen.half_width)
    return np.column_stack([landing.x.numpy(), landing.y.numpy()]), landing.flux.numpy(), direct
