"""From a problem to the objects that are traced."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import isinf, log2
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from optics.runtime import UserError
from optics.sources import Beam, Profile, Rays, collimated_beam, lambertian_parts, point_rays
from optics.target import Screen, fit_picture, formula_light, read_picture, uniform_region
from thbcad.hierarchy import THBSpace
from thbcad.lens import FreeformSurface, Lens, Product, one_line, require_sound
from thbcad.sags import Conic
from thbcad.splines import KnotVector
from thbcad.surfaces import THBSurface

if TYPE_CHECKING:
    from optics.problem import Freeform, Front, Problem, Rear


def base_lens(problem: Problem) -> Lens:
    """Return the lens before optimisation: a THB sag of zeros on the level-0 mesh.

    Raises
    ------
    UserError : the prescription makes no lens.
    """
    spec = problem.lens
    front, rear = _surface("front", spec.front), _surface("rear", spec.rear)
    try:
        return require_sound(Lens(front, rear, spec.thickness, spec.index))
    except ValueError as error:
        raise UserError(f"lens: {error}") from None


def lens_product(problem: Problem) -> Product:
    """Return what the CAD files say about the lens."""
    spec, names = problem.lens, problem.export
    return Product(
        name=names.product or one_line(problem.title) or "lens",
        author=names.author,
        organization=names.organization,
        material=spec.material or f"transparent, n = {spec.index:g}",
        density=spec.density,
        index=spec.index,
    )


def freeforms(problem: Problem) -> tuple[Freeform, ...]:
    """Return the settings of the free surfaces, front first, as `Lens.sags`."""
    return tuple(f for f in (problem.lens.front.freeform, problem.lens.rear.freeform) if f is not None)


def source_profile(problem: Problem) -> Profile:
    """Return how the light spreads over the source's area."""
    source = problem.source
    light = read_picture(source.image, "linear") if source.profile == "image" else None
    return Profile(source.profile, source.sigma, light)


def problem_rays(
    problem: Problem, counts: Sequence[int], fresh: np.random.Generator | None = None
) -> Beam | Rays:
    """Return the rays of the problem's source, those of a collimated one only where they meet the lens.

    counts : (nx, ny); of the rays of a Lambertian source the product counts, rounded to a power of two.
    fresh : draws a shift of the grid or another scrambling; without it the set is always the same.
    """
    return next(ray_parts(problem, counts, fresh))


def ray_parts(
    problem: Problem, counts: Sequence[int], fresh: np.random.Generator | None = None, most: int = 1 << 62
) -> Iterator[Beam | Rays]:
    """Yield the rays of `problem_rays` in parts of about `most`."""
    source, profile = problem.source, source_profile(problem)
    shift = (0.0, 0.0) if fresh is None else fresh.uniform(-0.5, 0.5, 2)
    if source.kind == "collimated":
        yield from collimated_beam(
            source.half_width, source.flux, problem.lens.front.half_width, counts, shift, profile
        ).slices(most)
    elif source.kind == "point":
        yield from point_rays(
            source.distance, source.flux, source.half_angle, source.exponent, counts, shift
        ).slices(most)
    else:
        count = 1 << max(2, round(log2(counts[0] * counts[1])))
        seed = 0 if fresh is None else int(fresh.integers(1, 1 << 31))
        yield from lambertian_parts(
            source.half_width, source.distance, source.flux, source.half_angle, profile, count, seed, most
        )


def _surface(name: str, spec: Front | Rear) -> FreeformSurface:
    """Return a surface of the prescription, with a sag of zeros on the level-0 mesh where it is free."""
    sag = None
    if spec.freeform is not None:
        kv = [
            KnotVector.uniform(spec.freeform.degree, n, -h, h)
            for n, h in zip(spec.freeform.spans, spec.half_width)
        ]
        space = THBSpace(*kv)
        sag = THBSurface(space, np.zeros(space.dim))
    try:
        return FreeformSurface(spec.half_width, Conic(spec.radius, spec.conic), sag)
    except ValueError as error:
        raise UserError(f"lens.{name}: {error}") from None


def target_screen(problem: Problem, coarsening: int = 1, margin: int = 0) -> Screen:
    """Return the Screen of the target, with pixels merged `coarsening` times in each direction."""
    pixels = tuple(-(-n // coarsening) for n in problem.target.pixels)
    return Screen(problem.target.half_width, pixels, margin, isinf(problem.target.distance))


def target_light(problem: Problem) -> NDArray[np.float64]:
    """Return the target as linear light: a picture at its own resolution, a region or a formula on the
    target's pixels.

    Raises
    ------
    UserError : see `read_picture` and `formula_light`.
    """
    target = problem.target
    if target.kind == "tophat":
        return uniform_region(target.shape, target.pixels, target.lit)
    if target.kind == "function":
        return formula_light(target.formula, target.pixels)
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
    behind_plane = isinf(lens.front.radius) and lens.front.freeform is None
    if problem.source.kind != "collimated" or not behind_plane or isinf(target.distance):
        return
    screen = target_screen(problem)
    lit = target_irradiance(light, screen, target.placing, 1.0) > 0
    beam = [min(s, f) for s, f in zip(problem.source.half_width, lens.front.half_width)]
    aside = [
        np.maximum(np.abs((2 * np.arange(n) + 1) / n - 1) * h - b, 0)[lit.any(axis=1 - d)].max()
        for d, (n, h, b) in enumerate(zip(screen.pixels[::-1], target.half_width[::-1], beam[::-1]))
    ]
    needed, most = np.degrees(np.arctan(max(aside) / target.distance)), np.degrees(np.arccos(1 / lens.index))
    if needed >= most:
        raise UserError(
            f"the target asks for light {needed:.1f} degrees aside from the beam, but a surface of index "
            f"{lens.index:g} bends rays by less "
            f"than {most:.1f} degrees; make target.half_width smaller or target.distance larger"
        )


def require_place(problem: Problem, lens: Lens) -> None:
    """Refuse a source that reaches into the lens, and a target plane that cuts it.

    Raises
    ------
    UserError : names the planes and how far the surfaces reach.
    """
    source, distance = problem.source, problem.target.distance
    x, y = (min(s, h) for s, h in zip(source.half_width, lens.front.half_width))
    front = min(0.0, float(lens.front.conic(x, y)))
    if source.kind == "lambertian" and front <= -source.distance:
        raise UserError(
            f"the source touches the lens or lies in it: its plane is z = {0.0 - source.distance:g} mm and "
            "the front reaches "
            f"to z = {front:.4g} mm there; make source.distance larger or source.half_width smaller"
        )
    freeform = problem.lens.rear.freeform
    top = max(0.0, float(lens.rear.conic(*lens.rear.half_width))) + freeform.z_freedom
    if distance <= top:
        raise UserError(
            f"target.distance must be greater than {top:.4g} mm, to where the rear surface may reach, got "
            f"{distance:g}"
        )


def target_irradiance(
    light: NDArray[np.float64], screen: Screen, fit: str, flux: float
) -> NDArray[np.float64]:
    """Return the light asked for on a screen's pixels, W/mm^2 (in the far field W per square degree), with
    the given total flux."""
    aspect = screen.half_width[0] / screen.half_width[1]
    image = fit_picture(light, screen.pixels, aspect, fit) * screen.projection()
    total = image.sum() * screen.pixel_area
    if total <= 0:
        raise UserError("no light is left of the picture inside the target; choose another target.fit")
    return image * (flux / total)
