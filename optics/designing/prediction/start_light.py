"""The light of a lens that only follows the transport map, and how much of its detail a blur leaves to see.

A blur hides what is finer than its spot, however fine the net is that makes it.  A logo in the sun, blurred
over nine pixels, has a transport map with detail of 0.2 pixels on level 6.  Its design ends at
rel_l2 = 0.211 there (195 000 coefficients), at 0.209 on level 5, 0.207 on level 4 and 0.215 on level 3
(3 500 coefficients).
"""

from __future__ import annotations

from dataclasses import replace

from optics.base.runtime import Backend
from optics.designing.starts import TransportStart, light_before, spot_system
from optics.light.blur import blur_of
from optics.scene.system import System

ACROSS = 4  # pixels across the spot of a blur: finer ones change the blurred rel_l2 of a level by 1 % or less
# of rel_l2: what another level must take off.  Optimised designs gain about as much as their starts: 8 % of
# the start are 10 % of the design (a logo of wide strokes in the sun), 2 % are 4 % (of thin ones)
WORTH = 0.03


def blocking(system: System, backend: Backend, coarsening: int = 1) -> dict[str, float]:
    """Return the share of the source's flux that each thing would block alone, by name, as `light_before`."""
    path = system.shaded_path
    bare = path.without_stops()
    alone = {"the clear aperture": replace(path, stops=(), bodies=())}
    alone |= {stop.name: replace(bare, stops=(stop,)) for stop in path.stops}
    alone |= {body.name: replace(bare, bodies=(body,)) for body in path.bodies}
    fates = {name: light_before(system, backend, coarsening, way)[0] for name, way in alone.items()}
    return {name: f.blocked / system.problem.flux for name, f in fates.items() if f.blocked}


def seen_level(system: System, start: TransportStart, backend: Backend, least: int, finest: int) -> int:
    """Return the coarsest level, from `least` to `finest`, from which on another one hardly shows.

    It hardly shows where it takes less than WORTH off the rel_l2 of the start's light behind the blur.  Light
    without blur shows everything.
    """
    if not system.blurred:
        return finest
    blur = blur_of(system, spot_system(system, backend).path, backend)
    coarsening = max(1, int(blur.width / (ACROSS * max(system.target.screen().pitch))))
    level, error = least, _error(system, start, backend, least, coarsening)
    while level < finest:
        finer = _error(system, start, backend, level + 1, coarsening)
        if finer > (1 - WORTH) * error:
            break
        level, error = level + 1, finer
    return level


def _error(system: System, start: TransportStart, backend: Backend, level: int, coarsening: int) -> float:
    """Return the rel_l2 of a blurred system's start on the whole mesh of a level."""
    fit = start.fit(system.base.sags[-1].space.uniform(level))
    _, error = light_before(system.with_sags([*system.sags[:-1], fit.sag]), backend, coarsening)
    assert error is not None, "light of sources with extent is not blurred"
    return error
