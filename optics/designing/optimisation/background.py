"""Light by other ways than front and rear, beside the light of a stage.

It is measured once, where the stage begins.  What of it leaves by the rear follows the rear from then on: its
rays within the lens are known, and they are traced on with the others.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from optics.base.runtime import Backend
from optics.light.analysis import nonsequential_light
from optics.light.engines import Film, LightModel, light_within
from optics.scene.system import OpticalSystem
from thbcad.checks import Floats
from thbcad.lens import Lens

REPLICATES = 4  # windows and the optimiser's steps smooth what noise is left


@dataclass(frozen=True, eq=False)
class Background:
    """What a lens sends to a screen by other ways than front and rear.

    image : irradiance, (rows, columns), W/mm^2.
    within : of that, what leaves by the rear, as a function of the rear's sag; None where nothing follows it.
    before : image of `within` at the start.
    """

    image: Floats
    within: LightModel | None = None
    before: Floats | float = 0.0


def background(
    system: OpticalSystem, backend: Backend, lens: Lens, film: Film, fixed: bool = True
) -> Background | None:
    """Return what a lens sends to a film by other ways than front and rear; None where it is negligible.

    It is averaged with its mirror images in the film's axes.
    fixed : it counts where it cannot follow the rear, too: light in cells or blurred, a rear without a sag.
    """
    sag = lens.rear.sag
    follows = sag is not None and film.window is not None and not system.blurred
    if not (system.by_edges and (follows or fixed)):
        return None
    other = nonsequential_light(system, lens, film.screen, backend, REPLICATES)
    if other.negligible:
        return None
    image = other.light.irradiance
    for axis in film.axes:
        image = (image + np.flip(image, 1 - axis)) / 2
    if not follows or sag is None or other.onto_rear is None:
        return Background(image)
    within = light_within(backend, system.own_path(lens), other.onto_rear, film)
    return Background(image, within, within.image([sag.coefficients]))
