"""Boundary representations as STEP files hold them: one solid, its faces and its edges."""

from __future__ import annotations

from dataclasses import dataclass

from thbcad.checks import Floats
from thbcad.splines import BSplineSurface, KnotVector, NURBSSurface

MILLIMETRE = "MILLI METRE"


@dataclass(frozen=True, eq=False)
class BrepFace:
    """An ADVANCED_FACE: its number in the file and the type of its surface.

    surface : where it is a spline, else None.  plane : where it is one, a point and the normal, (2, 3) float,
        else None.
    outward : whether the normal of the surface points out of the solid.
    loops : around the face, seen from outside to the left: edges by number, each with whether it is passed
        along its curve.
    """

    number: int
    surface_type: str
    surface: BSplineSurface | NURBSSurface | None
    plane: Floats | None
    outward: bool
    loops: tuple[tuple[tuple[int, bool], ...], ...]


@dataclass(frozen=True, eq=False)
class BrepEdge:
    """An EDGE_CURVE: ends (2, 3) float, in the direction of its curve.

    kv, poles : knots and poles (n, 3) float of a spline.  A line has no knots; its poles are its point and
        one a vector on.
    Both are None for other curves.
    """

    number: int
    ends: Floats
    kv: KnotVector | None
    poles: Floats | None


@dataclass(frozen=True, eq=False)
class Brep:
    """The one solid of a STEP file, in its unit of length.

    name : of the product.  unit : of length, "MILLI METRE" in files of this package.  faces : in the order of
        the shell.
    unpaired : how many edges do not border two faces, once in each direction.
    gaps : how many edges do not begin where the edge before them around a face ends.
    """

    name: str
    unit: str
    faces: tuple[BrepFace, ...]
    edges: tuple[BrepEdge, ...]
    unpaired: int
    gaps: int
