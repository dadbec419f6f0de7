"""What elements are made as: lenses, or bodies that leave a mould; all of them as bodies that shade."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING

from optics.base.runtime import Check, UserError
from optics.scene.paths import Body
from optics.scene.problem import FaceMet, Optic, Problem
from optics.scene.receivers import Plane
from optics.scene.system.elements import clear_aperture_of, pose_of
from optics.scene.system.target import LightTarget
from thbcad.lens import FreeformSurface, Lens
from thbcad.moulds import BodyOptions
from thbcad.outlines import Outline

if TYPE_CHECKING:
    from thbcad.moulds import Made, MouldedBody, Plate, Solid

SCREEN = 1e-3  # of its half-width: the thickness of a screen


def bodies_of(
    met: Sequence[FaceMet], elements: Iterable[tuple[Optic, Lens]], target: LightTarget
) -> tuple[Body, ...]:
    """Return elements as bodies, and the rectangle of a plane target as a thin plate behind it.

    met : the faces along the path.  elements : with their lenses or blanks.
    """
    bodies = []
    for optic, lens in elements:
        own = {k: face.face for k, face in enumerate(met) if face.optic is optic}
        bodies.append(Body(made_of(optic, lens), pose_of(optic), own, optic.table))
    if isinstance(target.receiver, Plane):
        side = FreeformSurface(target.settings.half_width)
        plate = Lens(side, side, SCREEN * max(side.half_width), 1.0)
        bodies.append(Body(plate, target.receiver.pose, {len(met): "front"}, "the screen"))
    return tuple(bodies)


def body_options(spec: Optic) -> BodyOptions | None:
    """Return what makes a lens a body that leaves a mould; None is the lens."""
    if spec.body is None:
        return None
    parting, land = (None if isinstance(z, str) else z for z in (spec.body.parting, spec.body.land))
    return BodyOptions(spec.body.draft, parting, spec.body.annulus, land, spec.body.edge_radius)


def made_of(optic: Optic, lens: Lens) -> Solid:
    """Return what an element's lens is made as: itself, or a body as `moulded`, which also raises."""
    body = body_options(optic)
    return lens if body is None else moulded(lens, body, clear_aperture_of(optic, lens))


def possible(problem: Problem, lens: Lens) -> tuple[Problem, str]:
    """Return a problem with the body that a lens can have, and why it is not the whole body asked for, ""
    where it is: without rounded edges, else the lens with its own walls."""
    optic = problem.optic
    try:
        made_of(optic, lens)
        return problem, ""
    except UserError as error:
        unfit = str(error)
    if optic.body is not None and optic.body.edge_radius:
        sharp = problem.with_optic(body=replace(optic.body, edge_radius=0.0))
        if not possible(sharp, lens)[1]:
            return sharp, f"{unfit}; the solid has sharp edges"
    return problem.with_optic(body=None), f"{unfit}; the solid is the lens with its own walls"


def body_checks(asked: Problem, made: Problem) -> list[Check]:
    """Return the checks that a solid has the body that a problem asks for.  made : the problem as it was
    made."""
    wanted, own = asked.optic.body, made.optic.body
    if wanted is not None and own is None:
        return [Check.none_of("bodies for a mould that the lens cannot have, as the notes say", 1)]
    if wanted is None or own is None or not wanted.edge_radius:
        return []
    return [Check("edge_radius of the body", own.edge_radius, wanted.edge_radius, "mm", at_least=True)]


def whole_of(optic: Optic, lens: Lens) -> Made:
    """Return the solid of an element's file: its plate, or as `made_of`.

    Raises UserError : there is no such plate, or no such body.
    """
    if optic.array is None:
        return made_of(optic, lens)
    return _plate(lens, (optic.array.columns, optic.array.rows), optic.array.pitches)


@lru_cache(maxsize=2)
def _plate(lens: Lens, counts: tuple[int, int], pitches: tuple[float, float]) -> Plate:
    """Return the plate of like lenses, proven.  Who asks again gets the same."""
    from thbcad.moulds import Plate  # other lenses need none of its proofs

    try:
        return Plate.of(lens, counts, pitches)
    except ValueError as error:
        raise UserError(f"the lens makes no such plate: {error}") from None


@lru_cache(maxsize=2)
def moulded(lens: Lens, options: BodyOptions, clear: tuple[Outline, Outline] | None) -> MouldedBody:
    """Return the body that is made of a lens, proven.  Who asks again gets the same.

    Raises UserError : as `MouldedBody.of`.
    """
    from thbcad.moulds import MouldedBody  # other lenses need none of its proofs

    try:
        return MouldedBody.of(lens, options, clear)
    except ValueError as error:
        raise UserError(f"the lens has no such body for a mould: {error}") from None
