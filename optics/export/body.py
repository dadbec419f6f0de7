"""The solid of a lens for a solid format: plain, cut to an aperture, with a flange, or of patches."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from optics.runtime import UserError
from thbcad.lens import Flange, aperture_volume, flanged_volume
from thbcad.meshes import body_mesh

if TYPE_CHECKING:
    from thbcad.cad.shapes import Part
    from thbcad.lens import Lens, Tessellation


@dataclass(frozen=True)
class Body:
    """Options of the solid.

    aperture : (a, b), mm, semi-axes of an elliptic aperture; None is the rectangle of the lens
    flange : Flange or None
    patches : one face per patch of same-level cells instead of one face for front and rear each
    separate : no solid, but front and rear as loose faces in two files

    Raises
    ------
    UserError : patches or separate together with another option.
    """

    aperture: tuple[float, float] | None = None
    flange: Flange | None = None
    patches: bool = False
    separate: bool = False

    def __post_init__(self) -> None:
        if self.patches + self.separate + self.shaped > 1:
            raise UserError("--patches, --separate and --aperture or --flange exclude each other")

    @property
    def shaped(self) -> bool:
        """Whether it has an aperture or a flange."""
        return self.aperture is not None or self.flange is not None

    def part(self, lens: Lens) -> Part:
        """Return the solid with named faces.

        Raises
        ------
        ValueError : an aperture or a flange that the lens has no room for.
        """
        from thbcad.cad.shapes import flanged_part, lens_part, patched_part, trimmed_part

        if self.patches:
            return patched_part(lens)
        if self.flange:
            return flanged_part(lens, self.flange, self.aperture)
        return trimmed_part(lens, self.aperture) if self.aperture else lens_part(lens)

    def mesh(self, lens: Lens, chord: float, single: bool) -> Tessellation:
        """Return the mesh within a chord error in mm, with named faces; single : rounded to float32.

        Raises
        ------
        ValueError : as `body_mesh`.
        """
        return body_mesh(lens, chord, self.aperture, self.flange, single)

    def volume(self, lens: Lens) -> float:
        """Return the volume in mm^3 by quadrature over the splines."""
        if self.flange:
            return flanged_volume(lens, self.flange, self.aperture)
        return aperture_volume(lens, self.aperture) if self.aperture else lens.volume()
