"""The errors of Monte Carlo samples, drawn at random.

Every tolerance is anything up to its amount, all equally likely: Sobol points fill the cube of all of them.
The form of a surface is a random field of a fixed rms, by pseudo-random numbers: it has far more dimensions
than Sobol points are even in.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import qmc

from optics.base.runtime import UserError
from optics.scene.system import System
from optics.tolerancing.perturbations import Perturbation, random_field
from thbcad.checks import require_integer, require_number

REPLICATES = 8  # independent scramblings of the points: their spread tells the error of every result
MOST_SAMPLES = 1 << 20
MOST_SEED = 1 << 63


@dataclass(frozen=True)
class FormTolerance:
    """A form error of random shape.

    surface : "front" or "rear" of a lens on the axis, a face that light meets of others, such as "L1.rear".
    rms : over the aperture, mm.  band : shortest and longest period, mm.

    Raises UserError : an rms that is not a number from 0.
    """

    surface: str
    rms: float
    band: tuple[float, float]

    def __post_init__(self) -> None:
        try:
            require_number("the rms of a form error", self.rms, least=0, finite=True)
        except ValueError as error:
            raise UserError(str(error)) from None

    @property
    def name(self) -> str:
        return f"{self.surface}.form"

    def drawn(self, system: System, seed: int) -> Perturbation:
        """Return one form error, of its rms over the outline of the surface.

        Raises UserError : a surface that is not there; see `random_field`.
        """
        faces = {face.name: face for face in system.problem.faces_met}
        if self.surface not in faces:
            names = " or ".join(f'"{name}"' for name in faces)
            raise UserError(f"a form error is one of {names}, got {self.surface!r}")
        optic, side = faces[self.surface].optic, faces[self.surface].face
        shape = getattr(next(made for one, made in system.elements if one is optic), side)
        field = random_field(self.band, self.rms, shape.half_width, seed, shape.corners)
        return Perturbation.on(optic, system.problem.optic, **{f"{side}_error": field})


@dataclass(frozen=True)
class Draw:
    """The errors of one lens.

    amounts : of every tolerance, as a part of its amount, -1 to 1.  seed : of the forms.
    sign : by which the forms are multiplied.
    """

    amounts: tuple[float, ...]
    seed: int
    sign: float = 1.0


def draws(tolerances: int, samples: int, seed: int) -> list[list[Draw]]:
    """Return the errors of `samples` lenses, in REPLICATES independent sets.

    tolerances : how many there are.  samples : REPLICATES times a power of two.

    Raises UserError : see `each_set`.
    """
    each = each_set(samples)
    rng = np.random.default_rng(seed)
    sets = []
    for _ in range(REPLICATES):
        cube = qmc.Sobol(tolerances, rng=rng).random(each) if tolerances else np.zeros((each, 0))
        seeds = rng.integers(MOST_SEED, size=each)
        sets.append([Draw(tuple(map(float, 2 * p - 1)), int(s)) for p, s in zip(cube, seeds)])
    return sets


def each_set(samples: int) -> int:
    """Return the number of lenses of each set, of `samples` in all.

    Raises UserError : a number that is not REPLICATES times a power of two.
    """
    try:
        require_integer("the number of samples", samples, 2 * REPLICATES, MOST_SAMPLES)
    except (TypeError, ValueError) as error:
        raise UserError(str(error)) from None
    each = samples // REPLICATES
    if samples % REPLICATES or each & (each - 1):
        raise UserError(
            f"the number of samples must be {REPLICATES} times a power of two, such as 128, 256 or 512, "
            f"got {samples}"
        )
    return each
