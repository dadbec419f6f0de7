"""The light of a lens by all the ways on which it comes, by as many rays as tell how uniform it is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial, reduce
from math import ceil
from operator import add

from optics.base.runtime import Backend
from optics.light.analysis.bypassing_light import PastLight, light_past_elements
from optics.light.analysis.closed_lens_light import (
    NEGLIGIBLE,
    REPLICATES as OTHER_REPLICATES,
    OtherLight,
    nonsequential_light,
)
from optics.light.analysis.light_estimate import LightEstimate
from optics.light.analysis.light_of_beams import beam_irradiance
from optics.light.analysis.light_of_cells import grid_irradiance
from optics.light.analysis.light_of_rays import MOST_RAYS, ray_count, ray_irradiance
from optics.light.analysis.light_of_wavelengths import SpectralLight, light_of_plate
from optics.light.analysis.photometric_metrics import uniformity_metrics
from optics.light.measuring import light_axes
from optics.light.tracing import SequentialFates
from optics.scene.photometry import NOISE
from optics.scene.receivers import Screen
from optics.scene.system import OpticalSystem
from thbcad.lens import Lens

MOST_MORE = 8.0  # times the usual rays, which a measurement takes before it says that noise hides a number
SURER = 1.2  # times the rays that the noise of the first ones asks for
ESTIMATES = {"cells": grid_irradiance, "beams": beam_irradiance}


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
