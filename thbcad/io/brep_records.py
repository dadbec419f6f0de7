"""Boundary representations as STEP files hold them: one solid, its faces and its edges."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from thbcad.checks import Floats
from thbcad.splines import BSplineSurface, KnotVector, NURBSSurface

MILLIMETRE = "MILLI METRE"
MATCH = 1e-7  # the distance within which edges and the sides of faces agree, as CAD programs have it in mm


@dataclass(frozen=True, eq=False)
class BrepFace:
    """An ADVANCED_FACE: its number and its name in the file and the type of its surface.

    carrier : the number of its surface.
    surface : where it is a spline, else None.
    plane : where it is one, a point, the normal and the direction of the first parameter, (3, 3) float, else
        None.
    outward : whether the normal of the surface points out of the solid.
    loops : around the face, seen from outside to the left: edges by number, each with whether it is passed
        along its curve.
    """

    number: int
    name: str
    carrier: int
    surface_type: str
    surface: BSplineSurface | NURBSSurface | None
    plane: Floats | None
    outward: bool
    loops: tuple[tuple[tuple[int, bool], ...], ...]


@dataclass(frozen=True, eq=False)
class ParameterCurve:
    """A PCURVE: the image of an edge in the parameters of a surface.

    carrier : the number of the surface.
    kv, poles : as those of a BrepEdge, poles (n, 2) float.
    """

    carrier: int
    kv: KnotVector | None
    poles: Floats | None


@dataclass(frozen=True, eq=False)
class BrepEdge:
    """An EDGE_CURVE: ends (2, 3) float, in the direction of its curve.

    kv, poles : knots and poles (n, 3) float of a spline that is not rational.  A line has no knots; its poles
        are its point and one a vector on.  Both are None for other curves.
    images : of the edge in the parameters of surfaces.
    """

    number: int
    ends: Floats
    kv: KnotVector | None
    poles: Floats | None
    images: tuple[ParameterCurve, ...] = ()


@dataclass(frozen=True, eq=False)
class Brep:
    """The one solid of a STEP file, in its unit of length.

    name : of the product.  unit : of length, "MILLI METRE" in files of this package.  faces : in the order of
        the shell.
    unpaired : how many edges do not border two faces, once in each direction.
    gaps : how many edges do not begin where the edge before them around a face ends.
    contradictions : how many splines say that they are closed, and are open, or that they cross themselves.
    labels : the words and numbers beside the shape, by what they say: name, author, organization and schema
        of the header, product, material, density, unit of density, uncertainty, person, company; empty where
        the file has none.
    """

    name: str
    unit: str
    faces: tuple[BrepFace, ...]
    edges: tuple[BrepEdge, ...]
    unpaired: int
    gaps: int
    contradictions: int
    labels: Mapping[str, tuple[str, ...]]
