"""The body that leaves a mould, of lenses that are made as one."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

from optics.base.runtime import UserError
from optics.scene.problem import Optic
from optics.scene.system.placed_faces import clear_aperture_of
from thbcad.lens import Lens
from thbcad.moulds import BodyOptions
from thbcad.outlines import Outline

if TYPE_CHECKING:
    from thbcad.moulds import MouldedBody, Solid


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


@lru_cache(maxsize=2)
def moulded(lens: Lens, options: BodyOptions, clear: tuple[Outline, Outline] | None) -> MouldedBody:
    """Return the body that is made of a lens, proven.  Who asks again gets the same.

    Raises
    ------
    UserError : as `MouldedBody.of`.
    """
    from thbcad.moulds import MouldedBody  # other lenses need none of its proofs

    try:
        return MouldedBody.of(lens, options, clear)
    except ValueError as error:
        raise UserError(f"the lens has no such body for a mould: {error}") from None
