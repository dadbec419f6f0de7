"""The sharp light to aim at where light is blurred, or displaced by the lenses of a plate: that whose blur
comes nearest to the target.

    |K E - T|^2 / 2 + LOST sum over P of E_P (1 - (K' 1)_P)  ->  min,      0 <= E <= PEAK max T

with the blur K and T of unit rms.  (K' 1)_P is the share of a pixel's light that lands on the target; that of
pixels beside it, as far as the blur reaches, helps even borders.  Solved by projected gradients with momentum
(FISTA; Beck, Teboulle, SIAM J. Imaging Sciences 2 (2009) 183).  K never amplifies, so that steps are 1.

`etendue` solves the like without the price and the limit, to a certificate; here 1e-3 is enough.

A lens is far easier to shape towards E than towards the least |K E - T|: the blur hides what single pixels
lack, and the loss with it.  A photograph in the sun (`examples/others/hobby.toml`), of which one blur allows
rel_l2 = 0.100: 50 evaluations of sharp light and 50 of blurred light end at 0.106, 122 of blurred light alone
at 0.110.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil

import numpy as np

from optics.base.runtime import Backend
from optics.light.blur.displacements import Spread, spreads_of
from optics.scene.receivers import Screen
from optics.scene.system import System
from thbcad.checks import Floats

PEAK = 3.0  # of the brightest pixel: without a limit a few pixels would be 25 times as bright as the mean
LOST = 0.01  # costs 1 % of rel_l2 and brings 5 % of the flux to the target that would miss it
FARTHEST = 64  # pixels that a blur reaches: for wider ones pixels are merged
STEPS = 200  # rel_l2 of the blurred light then falls by less than 1e-3 of itself


def aimed(system: System, backend: Backend) -> System:
    """Return the sharp system that stands for a blurred one, or for a plate, with its aim for the blur of a
    lens; another one as it is."""
    if system.shaping is system:
        return system
    return aimed_through(system, spreads_of(system, system.path, backend))


def aimed_through(system: System, spreads: Sequence[Spread]) -> System:
    """Return the sharp system that stands for a blurred one, or for a plate, with the aim for known spreads.

    Raises UserError : see `Blur.widened`; before any work is done, and where the design would be measured.
    """
    target, merge = system.target, system.problem.optimizer.merge
    for spread in spreads:
        spread.widened(target.screen())
    reach = max(spread.reach(target.screen(merge)) for spread in spreads)
    screen = target.screen(merge * max(1, ceil(reach / FARTHEST)))
    light = target.irradiance(screen, 1.0)
    for spread in spreads:
        screen, light = aimed_light(spread, screen, light)
    return system.sharp.with_prescription(aim=target.of_light(screen, light))


def aimed_light(blur: Spread, screen: Screen, target: Floats) -> tuple[Screen, Floats]:
    """Return (a screen that is wider by the reach of the blur, the light to aim at on its pixels).

    target : (rows, columns) of the narrow screen, at any scale.
    """
    blurred = blur.onto(screen)
    goal = target / np.sqrt(np.mean(target**2))
    cost = LOST * (1 - blurred.back(np.ones(goal.shape)))
    light = ahead = blurred.spread(goal)
    momentum = 1.0
    for _ in range(STEPS):
        gradient = blurred.back(blurred(ahead) - goal) + cost
        following = np.clip(ahead - gradient, 0.0, PEAK * goal.max())
        faster = (1 + np.sqrt(1 + 4 * momentum**2)) / 2
        ahead = following + (momentum - 1) / faster * (following - light)
        light, momentum = following, faster
    return blurred.wide, light
