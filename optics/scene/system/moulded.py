"""What a lens is made as: itself, or the body that leaves a mould."""

from __future__ import annotations

from typing import TYPE_CHECKING

from optics.base.runtime import UserError
from optics.scene.problem import Optic
from thbcad.lens import Lens
from thbcad.moulds import BodyOptions
from thbcad.outlines import Outline

if TYPE_CHECKING:
    from thbcad.moulds import Solid


def body_options(spec: Optic) -> BodyOptions | None:
    """Return what makes a lens a body that leaves a mould; None is the lens."""
    if spec.body is None:
        return None
    parting, land = (None if isinstance(z, str) else z for z in (spec.body.parting, spec.body.land))
    return BodyOptions(spec.body.draft, parting, spec.body.annulus, land, spec.body.edge_radius)


def solid_of(lens: Lens, options: BodyOptions | None, clear: tuple[Outline, Outline] | None) -> Solid:
    """Return a lens, or the body that is made of it, proven.

    Raises
    ------
    UserError : as `MouldedBody.of`.
    """
    if options is None:
        return lens
    from thbcad.moulds import MouldedBody  # other lenses need none of its proofs

    try:
        return MouldedBody.of(lens, options, clear)
    except ValueError as error:
        raise UserError(f"the lens has no such body for a mould: {error}") from None
