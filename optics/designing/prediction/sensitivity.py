"""How far small errors of making and mounting move the light, to first order.

With the throw D to the target (over the cosine of its incidence there), the angle i of incidence and r of
refraction at the rear:

    index       D dr/dn dn = D sin i / cos r dn
    ripple      D (n - 1) 2 pi a / p              of amplitude a and period p on the rear
    decentre    D d / s                           of the source, at the optical distance s before the rear;
                d                                 of a lens in parallel light, with which the light moves

In the far field D is 1, and the result is in degrees.  Where only the front is free, the shift by the index
is that of rays traced from it with both indices.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import NDArray

from optics.designing.optimisation import RearLight
from optics.light.refraction import FixedRear, ShapedFront
from optics.scene.system import OpticalSystem

Floats = NDArray[np.float64]

INDEX = 0.001
RIPPLE, PERIOD = 1e-3, 3.0  # mm
DECENTRE = 0.1  # mm
LIT = 0.01  # weight of cells that count as lit


@dataclass(frozen=True)
class Sensitivity:
    """Shifts of the light on the target, mm, in the far field degrees.

    index, index_most : by INDEX, mean and greatest.  ripple : by RIPPLE of period PERIOD.  decentre : by
    DECENTRE of the source against the lens.
    """

    index: float
    index_most: float
    ripple: float
    decentre: float


def sensitivity(system: OpticalSystem, light: RearLight, slopes: Sequence[Floats]) -> Sensitivity:
    """Return the Sensitivity of a lens whose shaped surface has these slopes (zx, zy), (nx, ny) each, in this
    light."""
    spec, source = system.problem.lens, system.problem.source
    far = system.target.far_field
    throw = system.lever
    # sin i / cos r at the rear, (nx, ny); 0 where light does not pass
    length = np.sqrt(1 + slopes[0] ** 2 + slopes[1] ** 2)
    dx, dy, dz = light.direction
    cosine = np.clip((dz - dx * slopes[0] - dy * slopes[1]) / length, 0, 1)
    sine = np.sqrt(1 - cosine**2)
    passes = spec.known_index * sine < 1
    turn = np.where(passes, sine / np.sqrt(np.where(passes, 1 - (spec.known_index * sine) ** 2, 1)), 0)
    shift = throw * INDEX * turn
    if system.shaped == "front":
        # the front's own height hardly matters: it is taken as its conic
        x, y = light.x[:, None], light.y[None, :]
        points = x, y, system.lens.front.conic(x, y)
        landings = []
        for index in (system.lens.index, system.lens.index + INDEX):
            rear = FixedRear(index, system.lens.rear.conic, system.lens.thickness, system.target.receiver)
            landings.append(ShapedFront(rear).landing(points, light.direction, slopes))
        shift = np.hypot(*(b - a for a, b in zip(*landings)))
    lit = light.weight > LIT
    if system.source.from_afar:
        decentre = 0.0 if far else DECENTRE
    else:
        decentre = throw * DECENTRE / (source.distance + spec.thickness / spec.known_index)
    return Sensitivity(
        index=float(np.average(shift, weights=light.weight)),
        index_most=float(shift[lit].max()),
        ripple=throw * (spec.known_index - 1) * 2 * pi * RIPPLE / PERIOD,
        decentre=decentre,
    )
