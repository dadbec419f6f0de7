"""The elements of a problem: their lenses before optimisation, where they lie, and their faces on a path."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from optics.base.runtime import UserError
from optics.scene.paths import Surface
from optics.scene.problem import (
    FaceMet,
    Freeform,
    Front,
    MirrorElement,
    Optic,
    Placed,
    Problem,
    Rear,
    base_of,
)
from thbcad.hierarchy import THBSpace
from thbcad.lens import FreeformSurface, Lens, Product, one_line, require_sound
from thbcad.outlines import Outline
from thbcad.poses import IDENTITY, Pose
from thbcad.sags import Conic
from thbcad.splines import KnotVector
from thbcad.surfaces import THBSurface

TURNED = Pose(np.diag([1.0, -1.0, -1.0]), np.zeros(3))  # of a surface that light meets from its +z


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


def pose_of(optic: Optic) -> Pose:
    """Return the pose from the frame of an element, with its front vertex at 0, to that of the scene."""
    return Pose.tilted(optic.position, optic.tilt) if isinstance(optic, Placed) else IDENTITY


def clear_aperture_of(optic: Optic, lens: Lens) -> tuple[Outline, Outline] | None:
    """Return what a holder leaves free of front and rear of an element's lens; None is all."""
    if not any(optic.clear_aperture):
        return None
    front, rear = (s.outline.scaled(optic.clear(s.half_width)) for s in (lens.front, lens.rear))
    return front, rear


def surface_of(face: FaceMet, lens: Lens) -> Surface:
    """Return a face as light meets it, going to the surface's own +z.  lens : of its element, its blank."""
    optic, rear = face.optic, face.face == "rear"
    shape, vertex = (lens.rear, lens.thickness) if rear else (lens.front, 0.0)
    pose = pose_of(optic) @ Pose.at((0.0, 0.0, vertex))
    if face.backwards:
        shape, pose = _from_behind(shape), pose @ TURNED
    clear = clear_aperture_of(optic, lens)
    surface = Surface(shape, pose, share=face.share, clear=clear[rear] if clear else None)
    return replace(surface, kind="reflect") if face.reflects else surface


def _from_behind(shape: FreeformSurface) -> FreeformSurface:
    """Return a surface without a sag as seen from its +z, turned about its x: -z(x, -y)."""
    assert shape.sag is None
    return replace(shape, conic=Conic(-shape.conic.radius, shape.conic.constant))
