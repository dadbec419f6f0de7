"""Inserts of a mould: the negative of front or rear, with a plane back."""

from __future__ import annotations

from dataclasses import dataclass

from thbcad.certified import value_range
from thbcad.checks import require_number
from thbcad.lens import FreeformSurface, Lens, OpticalForm, optical_forms, require_sound
from thbcad.outlines import LEAST_SIZE, Shape, integral_within
from thbcad.sags import Conic, PlacedConic

FACES = ("front", "rear")


@dataclass(frozen=True, eq=False)
class Insert:
    """The body between front or rear of a lens and a plane outside of it, with upright walls over an outline.

    It lies where the lens lies; its optical face is that of the lens, turned round.

    lens : Lens
    number : 0 of the front, 1 of the rear
    back : float, z of the plane, mm
    shape : the outline
    """

    lens: Lens
    number: int
    back: float
    shape: Shape

    @classmethod
    def of(cls, lens: Lens, word: str, back: float | None = None, shape: Shape | None = None) -> Insert:
        """Return the insert of the front or the rear, proven sound.

        word : "front" or "rear"
        back : z of the plane, mm; None is as far from the surface's farthest point as the lens is thick
        shape : the outline; None is that of the surface

        Raises
        ------
        ValueError : as `require_sound`; another word; a back that is not proven to lie at least 1e-6 mm
            outside of the surface.
        """
        if word not in FACES:
            raise ValueError(f"an insert must be that of front or rear, got {word!r}")
        number = FACES.index(word)
        least, greatest = value_range(require_sound(lens).graphs()[number])
        farthest, outward = (lens.thickness + greatest.upper, 1) if number else (least.lower, -1)
        if back is None:
            back = farthest + outward * lens.thickness
        require_number("back", back, finite=True)
        if outward * (back - farthest) < LEAST_SIZE:
            side = "above" if number else "below"
            raise ValueError(
                f"the back of the {word}'s insert must lie {side} z = {farthest:.9g} mm, which the {word} "
                f"reaches, got {back:.9g} mm"
            )
        return cls(lens, number, float(back), shape or (lens.front, lens.rear)[number].outline)

    @property
    def surface(self) -> FreeformSurface:
        """The optical surface."""
        return (self.lens.front, self.lens.rear)[self.number]

    @property
    def vertex(self) -> float:
        """The z of its z = 0, mm."""
        return self.number * self.lens.thickness

    @property
    def forms(self) -> tuple[OpticalForm, PlacedConic]:
        """The optical surface and the plane back, as files hold them."""
        plane = PlacedConic(Conic(), self.back, self.surface.half_width)
        return optical_forms(self.lens)[self.number], plane

    def volume(self) -> float:
        """Return the volume, mm^3, exact for the spline but for rounding."""
        held = integral_within(self.lens.graphs()[self.number], self.shape.pieces)
        return abs(self.shape.area * (self.vertex - self.back) + held)
