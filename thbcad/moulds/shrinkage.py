"""The lens as the mould must make it, so that what has shrunk is the design."""

from __future__ import annotations

from collections.abc import Sequence

from thbcad.checks import require_number
from thbcad.hierarchy import THBSpace
from thbcad.lens import FreeformSurface, Lens, optical_forms
from thbcad.sags import Conic, PlacedConic
from thbcad.splines import BSplineSurface
from thbcad.surfaces import THBSurface

Factors = tuple[float, float, float]  # of x, y and z
UNCHANGED = (1.0, 1.0, 1.0)
MOST = 50.0  # per cent; sintered parts shrink by 20


def shrinkage_factors(percent: Sequence[float]) -> Factors:
    """Return the factors 1 + s / 100 of x, y and z for a shrinkage s in per cent, one or three numbers.

    Raises
    ------
    ValueError : another count, a number that is not finite or beyond 50 per cent in size.
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
