"""The light that leaves a lens as an intensity over the full sphere: for luminaire files.

A sample of rays is followed through the closed lens with every split.  What leaves it by any face counts, by
its direction alone; what passes beside the lens, or is reflected at its front and never enters, does not.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import isqrt

import numpy as np

from optics.base.runtime import Backend
from optics.light.analysis import ROULETTE, plane_behind
from optics.light.tracing import TargetArea, trace_nonsequential
from optics.scene.luminaires import IntensityGrid, Luminaire, Opening
from optics.scene.receivers import receiver_at
from optics.scene.sources import single_rays
from optics.scene.system import System
from thbcad.checks import Floats
from thbcad.moulds import Plate

REPLICATES = 8  # independent ones, whose spread is the noise
RAYS_AT_ONCE = 1 << 17  # only memory: every ray has some branches
STREAM = 2  # of random numbers, other than those of the other traces


@dataclass(frozen=True, eq=False)
class OutgoingIntensity:
    """The light of a lens by direction.

    luminaire : its intensity, W/sr, with the rear as its opening.  flux : W, that left the lens.
    steps : of C and gamma, degrees; the intensity is smoothed over them.
    noise : the L2 error of the intensity over the sphere, relative to its L2 norm.
    parts : (n, k, m) W/sr, by independent parts of the rays alone; their mean is the intensity.
    """

    luminaire: Luminaire
    flux: float
    steps: tuple[float, float]
    noise: float
    parts: Floats


def outgoing_intensity(
    system: System,
    backend: Backend,
    count: int,
    step: float,
    progress: Callable[[int, int], object] = lambda done, of: None,
) -> OutgoingIntensity:
    """Return the intensity of the light behind a lens, by inner reflections and edges too, in all of the
    source's wavelengths.

    That of a plate is as many times that of the source in its middle.

    backend : of double precision.  count : of rays of all wavelengths, about.
    step : of gamma, degrees, which divides 180; that of C is twice as large.
    progress : called with the number of sets of rays that are traced, and of all.
    """
    lens = system.designed
    system = system.with_all_sources
    grid = IntensityGrid(round(180 / step), round(180 / step))
    rng = np.random.default_rng((system.problem.run.seed, STREAM))
    lights = system.wavelengths
    side = isqrt(max(1, count // (REPLICATES * len(lights))) - 1) + 1
    path = system.path.onto(receiver_at(plane_behind(system)))
    total, flux = [np.zeros((grid.turns, grid.tilts + 1)) for _ in range(REPLICATES)], 0.0
    for k, light in enumerate(lights):
        plane = TargetArea.of(path.in_media(light.media), lens.rear.half_width)
        shown = replace(lens, index=light.media[1].index) if system.spectral else lens
        solid = system.with_lens(shown).made
        sets = system.source.replicates(REPLICATES, (side, side), rng, RAYS_AT_ONCE)
        for done, (nodes, parts) in enumerate(zip(total, sets), k * REPLICATES):
            progress(done, len(lights) * REPLICATES)
            for part in parts:
                out = trace_nonsequential(
                    backend, solid, single_rays(part, lens), plane, threshold=ROULETTE, roulette=rng
                ).departures
                nodes += light.weight * grid.flux(out.direction, out.flux)
                flux += light.weight * float(out.flux.sum()) / REPLICATES
    outline = solid.outline if isinstance(solid, Plate) else lens.rear.outline
    hx, hy = outline.half_width
    opening = Opening((2 * hx, 2 * hy), round=outline.is_ellipse)
    luminaire = grid.luminaire(np.mean(total, axis=0), opening)
    error = grid.intensity(np.std(total, axis=0, ddof=1) / np.sqrt(REPLICATES))
    each = np.stack([grid.intensity(nodes) for nodes in total])
    weights = luminaire.node_solid_angles
    noise = np.sqrt((weights * error**2).sum() / (weights * luminaire.candela**2).sum())
    return OutgoingIntensity(luminaire, flux, grid.steps, float(noise), each)
