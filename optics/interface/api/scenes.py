"""Designs as scenes: one HTML page to be turned in a browser, and a dictionary for Mitsuba."""

from __future__ import annotations

from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import Any

from optics.base.runtime import UserError
from optics.interface.api.design_record import DesignRecord
from thbcad.io import write_text


@dataclass(frozen=True)
class SceneView:
    """Lens, rays and lit target, to be turned; a notebook shows it by itself.  page : HTML."""

    page: str = field(repr=False)

    def save(self, path: str | Path) -> Path:
        """Write the page to a file, for any browser.

        Raises UserError : the file cannot be written.
        """
        try:
            write_text(Path(path), self.page)
        except OSError as error:
            raise UserError(f"cannot write {path}: {error.strerror}; choose another path") from None
        return Path(path)

    def _repr_html_(self) -> str:
        frame = f'sandbox="allow-scripts" srcdoc="{escape(self.page)}"'
        return f'<iframe {frame} style="width:100%;height:34rem;border:0"></iframe>'


def mitsuba_scene(design: DesignRecord) -> dict[str, Any]:
    """Return a design as a dictionary for ``mi.load_dict``; lengths in mm, fluxes in W.

    It holds the lens as meshes with the splines' own normals, the source, a diffuse screen in the target
    plane, and a camera that sees it.  The irradiance of the screen is E = pi L / r, with the radiance L that
    the camera sees and the screen's reflectance r.  Mitsuba is loaded, in its mono variant where none is
    set.

    Raises UserError : Mitsuba is not installed, a target in the far field, pixels that are not square, or a
        source that Mitsuba does not have.
    """
    from optics.exchange.mitsuba import scene_dictionary  # few designs ask

    if not isinstance(design, DesignRecord):
        raise UserError(f"mitsuba_scene takes a Design, got {design!r}; optics.design makes one")
    return scene_dictionary(design.system, design.lens)
