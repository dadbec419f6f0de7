"""The light of a lens that is not optimised yet, traced in cells of its source."""

from __future__ import annotations

from functools import reduce
from math import sqrt
from operator import add

from optics.base.runtime import Backend
from optics.light.analysis import cell_irradiance, coloured, rel_l2
from optics.light.blur import blur_of
from optics.light.tracing import SequentialFates, Tracer
from optics.scene.paths import LightPath
from optics.scene.system import System

CELLS_PER_PIXEL, MOST_CELLS = 3, 2048  # of the source in each direction
RAYS = 1 << 17  # of an extended source


def light_before(
    system: System, backend: Backend, coarsening: int = 1, path: LightPath | None = None
) -> tuple[SequentialFates, float | None]:
    """Return the flux by fate and the rel_l2 of a lens; None for the latter where the source has extent.

    Light of a spectrum is that of all its wavelengths, and light of a plate the mean of that of its lenses,
    which is displaced on a plane.  The fates of blurred light are those of the sharp light on a target that
    is wider by the blur's reach.
    coarsening : pixels that are merged in each direction.  path : another one through the lens.
    """
    seen, blurred, path = system.target.screen(coarsening), None, path or system.shaded_path
    screen, target = seen, system.target
    if system.blurred:
        blurred, system = blur_of(system, path, backend).onto(seen), system.sharp
        screen = blurred.wide
    receivers, side = system.seen_receivers, round(sqrt(RAYS))
    lights = [
        (share / len(receivers), way.onto(receiver))
        for share, way in coloured(system, path)
        for receiver in receivers
    ]
    if system.source.extended:
        rays = system.source.rays((side, side))
        tracers = [(share, Tracer(backend, way, rays)) for share, way in lights]
        return reduce(add, (t.fates(t.landed(), screen.half_width) * share for share, t in tracers)), None
    counts = [min(CELLS_PER_PIXEL * n, MOST_CELLS) + 1 for n in screen.pixels]
    cells = system.source.cells(counts)
    images, every = zip(*(cell_irradiance(way, screen, cells, backend) for _, way in lights))
    irradiance = reduce(add, (share * image for (share, _), image in zip(lights, images)))
    fates = reduce(add, (by_fate * share for (share, _), by_fate in zip(lights, every)))
    if blurred:
        irradiance = blurred(irradiance)
    shown = seen.projection()  # in the far field intensities are compared
    return fates, rel_l2(irradiance / shown, target.irradiance(seen, 1.0) / shown)
