"""A design as a dictionary for Mitsuba."""

from __future__ import annotations

from typing import Any

from optics.base.runtime import UserError
from optics.interface.api.design_result import Design


def mitsuba_scene(design: Design) -> dict[str, Any]:
    """Return a design as a dictionary for ``mi.load_dict``; lengths in mm, fluxes in W.

    It holds the lens as meshes with the splines' own normals, the source, a diffuse screen in the target
    plane, and a camera that sees it.  The irradiance of the screen is E = pi L / r, with the radiance L that
    the camera sees and the screen's reflectance r.  Mitsuba is loaded, in its mono variant where none is
    set.

    Raises UserError : Mitsuba is not installed, a target in the far field, pixels that are not square, or a
        source that Mitsuba does not have.
    """
    from optics.exchange.mitsuba import scene_dictionary  # few designs ask

    if not isinstance(design, Design):
        raise UserError(f"mitsuba_scene takes a Design, got {design!r}; optics.design makes one")
    return scene_dictionary(design.system)
