"""The lens of a problem before optimisation, and what its CAD files say about it."""

from __future__ import annotations

import numpy as np

from optics.base.runtime import UserError
from optics.scene.problem import Freeform, Front, MirrorElement, Optic, Problem, Rear, base_of
from thbcad.hierarchy import THBSpace
from thbcad.lens import FreeformSurface, Lens, Product, one_line, require_sound
from thbcad.sags import Conic
from thbcad.splines import KnotVector
from thbcad.surfaces import THBSurface


def base_lens(spec: Optic) -> Lens:
    """Return a lens before optimisation: with THB sags of zeros on the level-0 mesh where it is free.

    Raises UserError : the prescription makes no lens.
    """
    front, rear = (_surface(spec, name) for name in ("front", "rear"))
    try:
        return require_sound(Lens(front, rear, spec.thickness, spec.known_index))
    except ValueError as error:
        raise UserError(f"{spec.table}: {error}".replace("lens.", f"{spec.table}.")) from None


def lens_product(problem: Problem, fixed: Optic | None = None) -> Product:
    """Return what the CAD files say about the lens, or about a fixed element, under its own name."""
    spec, names = fixed or problem.optic, problem.export
    glass = None if isinstance(spec, MirrorElement) else spec.known_index
    return Product(
        name=fixed.called if fixed else names.product or one_line(problem.title) or "lens",
        author=names.author,
        organization=names.organization,
        material=spec.material or (f"transparent, n = {glass:g}" if glass else "blank of a mirror"),
        density=spec.density,
        index=glass,
        sides=(spec.face_name("front"), spec.face_name("rear")),
    )


def freeforms(problem: Problem) -> tuple[Freeform, ...]:
    """Return the settings of the free surfaces of all elements, in the order in which light meets them."""
    return tuple(freeform for optic in problem.free_optics for freeform in optic.free.values())


def _surface(optic: Optic, name: str) -> FreeformSurface:
    """Return a surface of the prescription, with a sag of zeros on the level-0 mesh where it is free."""
    spec: Front | Rear = getattr(optic, name)
    sag = None
    if spec.freeform is not None:
        kv = [
            KnotVector.uniform(spec.freeform.degree, n, -h, h)
            for n, h in zip(spec.freeform.spans, spec.half_width)
        ]
        space = THBSpace(*kv)
        sag = THBSurface(space, np.zeros(space.dim))
    try:
        return FreeformSurface(spec.half_width, Conic(*base_of(spec)), sag, optic.corners(spec.half_width))
    except ValueError as error:
        raise UserError(
            f"{optic.key(name)}: {error}; make its radius larger in size or its half_width smaller"
        ) from None
