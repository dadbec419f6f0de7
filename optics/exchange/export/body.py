"""The solid of a lens for a solid format: plain, cut to an outline, with a flange, or of patches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from optics.base.runtime import UserError
from thbcad.lens import (
    Flange,
    Lens,
    Tessellation,
    aperture_volume,
    flanged_volume,
    optical_forms,
    polygon_volume,
)
from thbcad.meshes import body_mesh
from thbcad.sags import PlacedConic

if TYPE_CHECKING:
    from thbcad.cad.shapes import Part


@dataclass(frozen=True)
class Body:
    """Options of the solid.

    aperture : (a, b), mm, semi-axes of an elliptic aperture; None is the rectangle of the lens
    flange : Flange or None
    patches : one face per patch of same-level cells instead of one face for front and rear each
    separate : no solid, but front and rear as loose faces in two files
    polygon : corners (x, y), mm, of an outline; None is no polygon

    Raises
    ------
    UserError : patches or separate together with another option; a polygon together with an aperture or a
        flange.
    """

    aperture: tuple[float, float] | None = None
    flange: Flange | None = None
    patches: bool = False
    separate: bool = False
    polygon: Sequence[tuple[float, float]] | None = None

    def __post_init__(self) -> None:
        if self.patches + self.separate + self.shaped > 1:
            raise UserError("--patches, --separate and --aperture, --polygon or --flange exclude each other")
        if self.polygon is not None and (self.aperture is not None or self.flange is not None):
            raise UserError(
                "a polygon is an outline by itself: leave out --polygon, or --aperture and --flange"
            )

    @property
    def shaped(self) -> bool:
        """True where the solid has another outline than the rectangle of the lens."""
        return any(shape is not None for shape in (self.aperture, self.flange, self.polygon))

    def fitted(self, lens: Lens) -> bool:
        """Return whether some edges are fitted, within 1e-9 mm: level lines, ellipses above curved faces,
        sides of a polygon above spheres and other curved conics."""
        curved = any(isinstance(form, PlacedConic) and form.kind != "PLANE" for form in optical_forms(lens))
        return (self.shaped or not lens.rear.outline.is_rectangle) and (self.polygon is None or curved)

    def part(self, lens: Lens) -> Part:
        """Return the solid with named faces.

        Raises
        ------
        ValueError : an aperture, a polygon or a flange that the lens has no room for.
        """
        # OCCT
        from thbcad.cad.shapes import flanged_part, lens_part, patched_part, polygon_part, trimmed_part

        if self.patches:
            return patched_part(lens)
        if self.flange:
            return flanged_part(lens, self.flange, self.aperture)
        if self.polygon is not None:
            return polygon_part(lens, self.polygon)
        return trimmed_part(lens, self.aperture) if self.aperture else lens_part(lens)

    def mesh(self, lens: Lens, chord: float, single: bool) -> Tessellation:
        """Return the mesh within a chord error in mm, with named faces; single : rounded to float32.

        Raises
        ------
        ValueError : as `body_mesh`.
        """
        return body_mesh(lens, chord, self.aperture, self.flange, single, self.polygon)

    def volume(self, lens: Lens) -> float:
        """Return the volume in mm^3 by quadrature over the splines."""
        if self.flange:
            return flanged_volume(lens, self.flange, self.aperture)
        if self.polygon is not None:
            return polygon_volume(lens, self.polygon)
        return aperture_volume(lens, self.aperture) if self.aperture else lens.volume()
