"""The solid of a lens for a solid format: plain, cut, with a flange, of patches, or the insert of a mould."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

from optics.base.runtime import UserError
from thbcad.lens import (
    Flange,
    FreeformSurface,
    Lens,
    OpticalForm,
    Tessellation,
    aperture_volume,
    flanged_volume,
    optical_forms,
    polygon_volume,
    require_aperture,
    require_polygon,
)
from thbcad.meshes import body_mesh
from thbcad.moulds import INSERT_BACK, UNCHANGED, BodyOptions, Factors, Insert, MouldedBody, enlarged
from thbcad.outlines import Outline, Shape
from thbcad.sags import PlacedConic

if TYPE_CHECKING:
    from thbcad.cad.shapes import Part


class OpticalFace(NamedTuple):
    """A face across z: its word, as a file holds it, and as a surface at z = vertex."""

    word: str
    form: OpticalForm
    surface: FreeformSurface
    vertex: float


@dataclass(frozen=True)
class Body:
    """Options of the solid.

    aperture : (a, b), mm, semi-axes of an elliptic aperture; None is the rectangle of the lens
    flange : Flange or None
    patches : one face per patch of same-level cells instead of one face for front and rear each
    separate : no solid, but front and rear as loose faces in two files
    polygon : corners (x, y), mm, of an outline; None is no polygon
    factors : of x, y and z, by which lens and outline are enlarged, so that what has shrunk is the design
    cavity : "front" or "rear": no lens, but the insert that makes this surface; None is the lens
    back : z of the insert's plane back, mm, enlarged too; None as in `Insert.of`
    moulded : of the body that leaves a mould; None is the lens with its own walls
    clear : the outlines of front and rear that this body must leave free; None asks for nothing

    Raises UserError : patches or separate together with another option; a polygon together with an aperture
        or a flange; a flange, whose width is one number, that is enlarged unlike in x and y; a flange of an
        insert; a back without an insert; a moulded body with another shape, or enlarged unlike.
    """

    aperture: tuple[float, float] | None = None
    flange: Flange | None = None
    patches: bool = False
    separate: bool = False
    polygon: Sequence[tuple[float, float]] | None = None
    factors: Factors = UNCHANGED
    cavity: str | None = None
    back: float | None = None
    moulded: BodyOptions | None = None
    clear: tuple[Outline, Outline] | None = None

    def __post_init__(self) -> None:
        if self.cavity is not None and (self.patches or self.separate or self.flange is not None):
            raise UserError(
                "an insert is one solid within an outline: leave out --patches, --separate and --flange"
            )
        if self.back is not None and self.cavity is None:
            raise UserError("--back is that of an insert: add --cavity front or rear, or leave it out")
        if self.moulded is not None and (self.patches or self.shaped):
            raise UserError(
                "lens.body makes the walls of the solid: leave out --patches, --aperture, --polygon and "
                "--flange, or export lens.json of the result, which is the lens without its body"
            )
        if self.moulded is not None and len(set(self.factors)) > 1:
            raise UserError("the draft of lens.body needs one --shrinkage for x, y and z")
        if self.patches + self.separate + self.shaped > 1:
            raise UserError("--patches, --separate and --aperture, --polygon or --flange exclude each other")
        if self.polygon is not None and (self.aperture is not None or self.flange is not None):
            raise UserError(
                "a polygon is an outline by itself: leave out --polygon, or --aperture and --flange"
            )
        if self.flange is not None and self.factors[0] != self.factors[1]:
            raise UserError(
                "a flange is as wide along x as along y: with --flange give --shrinkage one number, or like "
                "ones of x and y"
            )

    def enlarged(self, lens: Lens) -> tuple[Lens, Body]:
        """Return the lens and the options in the size of the mould, and nothing left to enlarge."""
        if self.factors == UNCHANGED:
            return lens, self
        x, y, z = self.factors
        aperture = self.aperture and (x * self.aperture[0], y * self.aperture[1])
        flange = self.flange and Flange(x * self.flange.width, z * self.flange.low, z * self.flange.high)
        polygon = self.polygon and [(x * a, y * b) for a, b in self.polygon]
        back = None if self.back is None else z * self.back
        body = replace(self, aperture=aperture, flange=flange, polygon=polygon, factors=UNCHANGED, back=back)
        if self.moulded is not None:
            body = replace(body, moulded=self.moulded.scaled(z))
            if self.clear is not None:
                front, rear = (clear.scaled([x * h for h in clear.half_width]) for clear in self.clear)
                body = replace(body, clear=(front, rear))
        return enlarged(lens, self.factors), body

    @property
    def is_moulded(self) -> bool:
        """Whether the solid is a moulded body: inserts and loose faces are those of the lens."""
        return self.moulded is not None and self.cavity is None and not self.separate

    @property
    def shaped(self) -> bool:
        """True where the solid has another outline than the rectangle of the lens."""
        return any(shape is not None for shape in (self.aperture, self.flange, self.polygon))

    def fitted(self, lens: Lens) -> bool:
        """Return whether some edges are fitted, within 1e-9 mm: level lines, ellipses above curved faces,
        sides of a polygon above spheres and other curved conics; those of an insert may be."""
        if self.cavity is not None or self.is_moulded:
            return True
        curved = any(isinstance(form, PlacedConic) and form.kind != "PLANE" for form in optical_forms(lens))
        return (self.shaped or not lens.rear.outline.is_rectangle) and (self.polygon is None or curved)

    def part(self, lens: Lens) -> Part:
        """Return the solid with named faces.

        Raises ValueError : an aperture, a polygon or a flange that the lens has no room for; as `Insert.of`,
            `MouldedBody.of` and `moulded_part`.
        """
        # OCCT
        from thbcad.cad.shapes import (
            flanged_part,
            insert_part,
            lens_part,
            moulded_part,
            patched_part,
            polygon_part,
            trimmed_part,
        )

        if self.cavity is not None:
            return insert_part(self._insert(lens, self.cavity))
        if self.moulded is not None:
            return moulded_part(MouldedBody.of(lens, self.moulded, self.clear))
        if self.patches:
            return patched_part(lens)
        if self.flange:
            return flanged_part(lens, self.flange, self.aperture)
        if self.polygon is not None:
            return polygon_part(lens, self.polygon)
        return trimmed_part(lens, self.aperture) if self.aperture else lens_part(lens)

    def mesh(self, lens: Lens, chord: float, single: bool) -> Tessellation:
        """Return the mesh within a chord error in mm, with named faces; single : rounded to float32.

        Raises ValueError : as `body_mesh`; of a moulded body as `part` and `part_mesh`.
        """
        if self.is_moulded:
            from thbcad.cad.exchange import part_mesh  # OCCT

            return part_mesh(self.part(lens), chord, single)
        return body_mesh(lens, chord, self.aperture, self.flange, single, self.polygon)

    def volume(self, lens: Lens) -> float:
        """Return the volume in mm^3 by quadrature over the splines."""
        if self.cavity is not None:
            return self._insert(lens, self.cavity).volume()
        if self.moulded is not None:
            return MouldedBody.of(lens, self.moulded).volume()
        if self.flange:
            return flanged_volume(lens, self.flange, self.aperture)
        if self.polygon is not None:
            return polygon_volume(lens, self.polygon)
        return aperture_volume(lens, self.aperture) if self.aperture else lens.volume()

    def optical(self, lens: Lens) -> list[OpticalFace]:
        """Return the lowest and the highest of the faces across z."""
        if self.cavity is None:
            pairs = zip(optical_forms(lens), lens.faces)
            return [OpticalFace(word, form, surface, vertex) for form, (word, surface, vertex) in pairs]
        insert = self._insert(lens, self.cavity)
        form, plane = insert.forms
        faces = [
            OpticalFace(self.cavity, form, insert.surface, insert.vertex),
            OpticalFace(INSERT_BACK, plane, FreeformSurface(insert.surface.half_width), insert.back),
        ]
        return faces if insert.number else faces[::-1]

    def _insert(self, lens: Lens, word: str) -> Insert:
        shape: Shape | None = None
        if self.polygon is not None:
            shape = require_polygon(lens, self.polygon)
        elif self.aperture is not None:
            shape = require_aperture(lens, self.aperture)
        return Insert.of(lens, word, self.back, shape)


WHOLE = Body()  # the lens with its own walls
