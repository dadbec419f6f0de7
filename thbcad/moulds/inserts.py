"""Inserts of a mould, the negative of front or rear with a plane back, and the lens as the mould must make
it, so that what has shrunk is the design.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from thbcad.certified import value_range
from thbcad.checks import require_number, shown
from thbcad.hierarchy import THBSpace
from thbcad.lens import FreeformSurface, Lens, OpticalForm, optical_forms, require_sound
from thbcad.outlines import LEAST_SIZE, Outline, Shape, integral_within
from thbcad.sags import Conic, PlacedConic
from thbcad.splines import BSplineSurface
from thbcad.surfaces import THBSurface

FACES = ("front", "rear")
INSERT_BACK = "insert back"  # of a mirror "back" is an optical face
Factors = tuple[float, float, float]  # of x, y and z
UNCHANGED = (1.0, 1.0, 1.0)
MOST = 50.0  # per cent; sintered parts shrink by 20


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
        back : z of the plane, mm; None is as far from the farthest point of the surface, within an outline
            that is no polygon, as the lens is thick
        shape : the outline; None is that of the surface

        Raises ValueError : as `require_sound`; another word; a back that is not proven to lie at least 1e-6
            mm outside of the surface.
        """
        if word not in FACES:
            raise ValueError(f"an insert must be that of front or rear, got {shown(word)}")
        number = FACES.index(word)
        own, graph = (lens.front, lens.rear)[number].outline, require_sound(lens).graphs()[number]
        over = shape if isinstance(shape, Outline) else own
        x, y = over.half_width
        least, greatest = value_range(graph.segment((-x, x), (-y, y)), outline=over)
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
        return cls(lens, number, float(back), shape or own)

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


def shrinkage_factors(percent: Sequence[float]) -> Factors:
    """Return the factors 1 + s / 100 of x, y and z for a shrinkage s in per cent, one or three numbers.

    Raises ValueError : another count, a number that is not finite or beyond 50 per cent in size.
    """
    if len(percent) not in (1, 3):
        raise ValueError(
            f"shrinkage must be one number, or three for x, y and z, in per cent, got {len(percent)} numbers"
        )
    for number in percent:
        require_number("shrinkage", number, finite=True)
        if abs(number) > MOST:
            raise ValueError(f"shrinkage must be at most {MOST:g} per cent in size, got {number:g}")
    x, y, z = (1 + number / 100 for number in (*percent,) * (3 // len(percent)))
    return x, y, z


def enlarged(lens: Lens, factors: Factors) -> Lens:
    """Return the lens with x, y and z multiplied by factors, pole by pole.

    A conic under three like factors has the radius multiplied and the same constant.  Under unlike ones it is
    none, but for planes: conic and sag become one spline, as they do where the conic beneath a sag is no
    polynomial, whose spline would be another one.
    """
    pairs = zip((lens.front, lens.rear), lens.own_graphs(), optical_forms(lens))
    front, rear = (_enlarged(surface, graph, form, factors) for surface, graph, form in pairs)
    return Lens(front, rear, factors[2] * lens.thickness, lens.index)


def _enlarged(
    surface: FreeformSurface, graph: BSplineSurface, form: BSplineSurface | PlacedConic, factors: Factors
) -> FreeformSurface:
    x, y, z = factors
    conic, sag = surface.conic, surface.sag
    alike = x == y == z
    if conic.is_plane or (alike and (conic.is_paraboloid or isinstance(form, PlacedConic))):
        conic = Conic(z * conic.radius, conic.constant)
        sag = None if sag is None else THBSurface(sag.space, z * sag.coefficients)
    else:
        conic = Conic()
        sag = THBSurface(THBSpace(graph.kv_u, graph.kv_v), z * graph.coefficients.ravel())
    (a, b), (c, d) = surface.half_width, surface.corners
    return FreeformSurface((x * a, y * b), conic, sag, (x * c, y * d))
