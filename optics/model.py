"""From a problem to the objects that are traced."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from optics.errors import UserError
from optics.picture import fit_picture, read_picture
from optics.screen import Screen
from optics.shapes import uniform_region
from thbcad.bspline import KnotVector
from thbcad.conic import Conic
from thbcad.lens import FreeformSurface, Lens
from thbcad.space import THBSpace
from thbcad.thb import THBSurface

if TYPE_CHECKING:
    from optics.problem import Problem


def base_lens(problem: Problem) -> Lens:
    """Return the lens before optimisation: a THB sag of zeros on the level-0 mesh.

    Raises
    ------
    UserError : the prescription makes no lens.
    """
    spec = problem.lens
    freeform = spec.rear.freeform
    kv = [KnotVector.uniform(freeform.degree, n, -h, h) for n, h in zip(freeform.spans, spec.rear.half_width)]
    space = THBSpace(*kv)
    sag = THBSurface(space, np.zeros(space.dim))
    try:
        front = FreeformSurface(spec.front.half_width, Conic(spec.front.radius, spec.front.conic))
    except ValueError as error:
        raise UserError(f"lens.front: {error}") from None
    try:
        rear = FreeformSurface(spec.rear.half_width, Conic(spec.rear.radius, spec.rear.conic), sag)
    except ValueError as error:
        raise UserError(f"lens.rear: {error}") from None
    try:
        return Lens(front, rear, spec.thickness, spec.index)
    except ValueError as error:
        raise UserError(f"lens: {error}") from None


def target_screen(problem: Problem, coarsening: int = 1, margin: int = 0) -> Screen:
    """Return the Screen of the target, with pixels merged `coarsening` times in each direction."""
    pixels = tuple(-(-n // coarsening) for n in problem.target.pixels)
    return Screen(problem.target.half_width, pixels, margin)


def target_light(problem: Problem) -> NDArray[np.float64]:
    """Return the target as linear light: a picture at its own resolution, a region on the target's pixels.

    Raises
    ------
    UserError : see `read_picture`.
    """
    target = problem.target
    if target.kind == "uniform":
        return uniform_region(target.shape, target.pixels, target.lit)
    return read_picture(target.image, target.encoding)


def target_irradiance(light: NDArray[np.float64], screen: Screen, fit: str, flux: float) -> NDArray[np.float64]:
    """Return the irradiance asked for on a screen's pixels, W/mm^2, with the given total flux."""
    aspect = screen.half_width[0] / screen.half_width[1]
    image = fit_picture(light, screen.pixels, aspect, fit)
    total = image.sum() * screen.pixel_area
    if total <= 0:
        raise UserError("no light is left of the picture inside the target; choose another target.fit")
    return image * (flux / total)
