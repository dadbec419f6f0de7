"""What is left of a picture where every lens of a plate throws its own, displaced by its place, on a plane.

With the picture T and the mean D over the displacements, lenses that make T make D T together, and no light
F >= 0 of one lens that is even on every pixel comes nearer than

    min || D F - T || / || T ||      over F >= 0, beside the picture too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from optics.designing.etendue import Kernel, approximate
from optics.designing.prediction.blurred_picture import KKT, MOST_PIXELS, SMALL, STEPS
from optics.light.analysis import rel_l2
from optics.light.blur import Displacements
from optics.scene.system import System

SPOILT = 0.05  # of rel_l2, from which on a remedy is worth a word: half of what pictures may miss


@dataclass(frozen=True)
class DisplacedLimits:
    """What the displacement of the lenses of a plate leaves of a picture.

    widest : mm, from the first column of lenses to the last, and from the first row to the last.
    pixels : the same.
    plain : rel_l2 of the picture, displaced.
    least : of rel_l2 of all light of one lens; None where lenses are further apart than the target is wide.
    """

    widest: tuple[float, float]
    pixels: tuple[float, float]
    plain: float
    least: float | None


def displaced_limits(system: System) -> DisplacedLimits | None:
    """Return what displacement leaves of the target of a plate; None of one lens, and in the far field."""
    if not system.displaced:
        return None
    places = Displacements.of(system)
    screen = system.target.screen(-(-max(system.target.settings.pixels) // MOST_PIXELS))
    target, displaced, kernel = (
        system.target.irradiance(screen, 1.0),
        places.onto(screen),
        places.kernel(screen),
    )
    fits = all(np.less_equal(kernel.shape, target.shape))
    return DisplacedLimits(
        widest=places.widest,
        pixels=(places.widest[0] / screen.pitch[0], places.widest[1] / screen.pitch[1]),
        plain=rel_l2(displaced(displaced.spread(target)), target),
        least=approximate(Kernel(kernel), target, KKT, STEPS).lower_bound if fits else None,
    )


def displaced_sentence(found: DisplacedLimits, reached: float | None = None) -> str:
    """Return what displacement leaves of a picture, in words.  reached : rel_l2 of a lens."""
    (wide, high), (columns, rows) = found.widest, found.pixels
    said = (
        f"the lenses of the plate, and so their pictures, lie up to {wide:.3g} x {high:.3g} mm apart "
        f"({columns:.2g} x {rows:.2g} pixels); the picture itself, displaced so, has a rel_l2 of "
        f"{found.plain:.2g}"
    )
    if found.least is None:
        said += "; they are further apart than the target is wide"
    else:
        least = f"has {found.least:.2g}" if found.least >= SMALL else "has none"
        said += f"; the best light of one lens that is even on every pixel {least}"
    if reached is not None:
        said += f"; this plate has {reached:.2g}"
    if (found.plain if reached is None else reached) < SPOILT:
        return said
    return (
        f"{said}; a larger target, as much further away, fewer lenses or a smaller lens.array.pitch leave "
        "more of it, and the far field (target.distance = inf) leaves all"
    )
