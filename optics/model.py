"""From a problem to the objects that are traced."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from optics.beam import Beam, Profile, collimated_beam
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


def problem_beam(problem: Problem, rays: Sequence[int], shift: Sequence[float] | NDArray[np.float64] = (0.0, 0.0)) -> Beam:
    """Return the rays of the problem's source that meet the lens; shift : as in `collimated_beam`."""
    source = problem.source
    profile = Profile(source.profile, source.sigma)
    return collimated_beam(source.half_width, source.flux, problem.lens.front.half_width, rays, shift, profile)


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
    if target.kind == "tophat":
        return uniform_region(target.shape, target.pixels, target.lit)
    return read_picture(target.image, target.encoding)


def require_reachable(problem: Problem, light: NDArray[np.float64]) -> None:
    """Refuse a target that no rear surface behind a plane front can light.

    A surface of index n bends parallel rays by less than arccos(1 / n) before it reflects them totally;
    a lit pixel farther aside from the beam than that, seen from the rear vertex, stays dark.

    Raises
    ------
    UserError : names the angle needed and the angle that the index allows.
    """
    lens, target = problem.lens, problem.target
    if not np.isinf(lens.front.radius):
        return
    screen = target_screen(problem)
    lit = target_irradiance(light, screen, target.fit, 1.0) > 0
    beam = [min(s, f) for s, f in zip(problem.source.half_width, lens.front.half_width)]
    aside = [
        np.maximum(np.abs((2 * np.arange(n) + 1) / n - 1) * h - b, 0)[lit.any(axis=1 - d)].max()
        for d, (n, h, b) in enumerate(zip(screen.pixels[::-1], target.half_width[::-1], beam[::-1]))
    ]
    needed, most = np.degrees(np.arctan(max(aside) / target.distance)), np.degrees(np.arccos(1 / lens.index))
    if needed >= most:
        raise UserError(
            f"the target asks for light {needed:.1f} degrees aside from the beam, but a surface of index {lens.index:g} bends rays by less "
            f"than {most:.1f} degrees; make target.half_width smaller or target.distance larger"
        )


def target_irradiance(light: NDArray[np.float64], screen: Screen, fit: str, flux: float) -> NDArray[np.float64]:
    """Return the irradiance asked for on a screen's pixels, W/mm^2, with the given total flux."""
    aspect = screen.half_width[0] / screen.half_width[1]
    image = fit_picture(light, screen.pixels, aspect, fit)
    total = image.sum() * screen.pixel_area
    if total <= 0:
        raise UserError("no light is left of the picture inside the target; choose another target.fit")
    return image * (flux / total)
