"""Splines that belong to no solid, in STEP, IGES and BREP files: surfaces as faces, curves as edges.

All three formats give back points, weights and knots bit for bit.  Exceptions: in STEP and IGES
a surface that is closed to 1e-7 mm comes back closed exactly (OCCT makes it periodic on reading), in
STEP a curve that is closed to 1e-8 mm; equal weights come back as a polynomial spline, in IGES also those
that differ by less than 1e-10.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve, BRepAdaptor_Surface
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeEdge, BRepBuilderAPI_MakeFace
from OCP.BRepTools import BRepTools
from OCP.Geom import (
    Geom_BSplineCurve,
    Geom_BSplineSurface,
    Geom_RectangularTrimmedSurface,
    Geom_Surface,
    Geom_TrimmedCurve,
)
from OCP.GeomAbs import (
    GeomAbs_OffsetCurve,
    GeomAbs_OffsetSurface,
    GeomAbs_OtherCurve,
    GeomAbs_OtherSurface,
    GeomAbs_SurfaceOfExtrusion,
    GeomAbs_SurfaceOfRevolution,
)
from OCP.GeomConvert import GeomConvert
from OCP.TopAbs import TopAbs_FACE
from OCP.TopoDS import TopoDS_Compound, TopoDS_Edge, TopoDS_Face, TopoDS_Shape

from thbcad.cad.exchange.occt_texts import FACES, brep_text, iges_text, silence, step_text
from thbcad.cad.exchange.reading import OCCT_ERRORS, brep_shape, edges_of, faces_of, iges_shape, step_shape
from thbcad.cad.shapes import (
    BUILDER,
    TOLERANCE,
    rational_geom,
    rational_geom_curve,
    spline_curve,
    spline_surface,
)
from thbcad.checks import Floats, require_suffix, require_type
from thbcad.io import write_bytes
from thbcad.lens import Product
from thbcad.sags import graph_poles
from thbcad.splines import BSplineCurve, BSplineSurface, NURBSCurve, NURBSSurface

if TYPE_CHECKING:
    from thbcad.surfaces import THBSurface

    Surface = THBSurface | BSplineSurface | NURBSSurface

T = TypeVar("T")
Curve = BSplineCurve | NURBSCurve
CURVES = (BSplineCurve, NURBSCurve)
SWEPT = (GeomAbs_SurfaceOfRevolution, GeomAbs_SurfaceOfExtrusion)
APPROXIMATE = (GeomAbs_OffsetCurve, GeomAbs_OtherCurve)
APPROXIMATE_SURFACES = (GeomAbs_OffsetSurface, GeomAbs_OtherSurface)
READ_ERRORS: tuple[type[Exception], ...] = (ValueError, *OCCT_ERRORS)


class Format(NamedTuple):
    """A format of files: its writer, which takes a shape and a name, and its reader.

    least_size : mm, of a face; OCCT drops smaller ones
    least_weight : OCCT reads a surface with a lesser weight as polynomial, and no curve
    least_span : between the knots of a curve; OCCT merges nearer ones
    """

    write: Callable[[TopoDS_Shape, str], bytes]
    read: Callable[[Path], TopoDS_Shape]
    least_size: float = 0.0
    least_weight: float = 0.0
    least_span: float = 0.0


STEP = Format(step_text, step_shape, 1e-6)
IGES = Format(lambda shape, name: iges_text(shape, FACES, Product(name)), iges_shape, 1e-6, 1e-9, 1e-9)
BREP = Format(lambda shape, _: brep_text(shape), brep_shape)
FORMATS = {".step": STEP, ".stp": STEP, ".iges": IGES, ".igs": IGES, ".brep": BREP}


def write_faces(surfaces: Surface | Sequence[Surface], path: str | Path) -> None:
    """Write surfaces with points (x, y, z) in mm as loose faces, one each; the suffix names the format.

    A scalar surface is its graph z(u, v): its parameters count as x and y in mm.

    STEP is .step or .stp, IGES is .igs or .iges, BREP is .brep.  The same surfaces give the same bytes.

    surfaces : one, or a list of them.  A THBSurface becomes one face, as by `to_faces(price=inf)`.

    Raises OSError : the file cannot be written.
    Raises ValueError : another suffix; no surfaces; points without three components; IGES: a weight below
        1e-9; STEP and IGES: a surface whose points fit into a box with a diagonal below 1e-6 mm.
    Raises RuntimeError : OCCT refuses a surface.
    """
    _write("surfaces", surfaces, face_of, path)


def write_curves(curves: Curve | Sequence[Curve], path: str | Path) -> None:
    """Write curves with points (x, y, z) in mm as edges of no face; the suffix names the format.

    curves : one, or a list of them.

    Raises OSError, RuntimeError : as `write_faces`.
    Raises ValueError : another suffix; no curves; points without three components; IGES: a weight or a span
        between knots below 1e-9.
    """
    _write("curves", curves, edge_of, path)


def read_faces(path: str | Path) -> list[BSplineSurface | NURBSSurface]:
    """Read the surfaces under all faces of a STEP, IGES or BREP file, in mm.

    A B-spline surface comes whole, with the numbers of the file; planes, cylinders, cones, spheres,
    tori, extrusions and revolutions come as exact NURBS over the parameter rectangle of the face.
    Trimming curves and orientations are not read.  Polynomial surfaces are BSplineSurface.

    Raises OSError : the file cannot be read.
    Raises ValueError : another suffix; no file of that format; no faces; a surface that is no exact NURBS
        or has a degree above 10.
    """
    return _read("face", faces_of, _surface_under, path)


def read_curves(path: str | Path) -> list[BSplineCurve | NURBSCurve]:
    """Read the curves under all edges of a STEP, IGES or BREP file that border no face, in mm.

    A B-spline curve that is not trimmed comes with the numbers of the file; lines, conics and pieces of
    curves come as exact NURBS over the parameters of the edge.  Orientations are not read.

    Raises OSError, ValueError : as `read_faces`.
    """
    return _read("free edge", lambda shape: edges_of(shape, TopAbs_FACE), _curve_under, path)


def face_of(surface: Surface, name: str = "surface", file: Format = BREP) -> TopoDS_Face:
    """Return a surface as a face; raise as `write_faces` in a format, where its name tells which it is."""
    spline = _tensor_product(surface, name)
    if isinstance(spline, BSplineSurface) and spline.coefficients.ndim == 2:
        spline = graph_poles(spline, 0.0, spline)
    _require_points(name, spline.coefficients, 2)
    size = np.linalg.norm(np.ptp(spline.coefficients, axis=(0, 1)))
    if size < file.least_size:
        raise ValueError(
            f"{name} is {size:.2g} mm large, below the {file.least_size:g} mm that STEP and IGES keep"
        )
    nurbs = NURBSSurface.from_bspline(spline) if isinstance(spline, BSplineSurface) else spline
    _require_weights(name, nurbs.weights, file)
    try:
        return BRepBuilderAPI_MakeFace(rational_geom(nurbs), TOLERANCE).Face()
    except OCCT_ERRORS as error:
        raise RuntimeError(f"OCCT could not make a face of {name}: {error}") from error


def edge_of(curve: Curve, name: str = "curve", file: Format = BREP) -> TopoDS_Edge:
    """Return a curve as an edge; raise as `write_curves` in a format, where its name tells which it is."""
    require_type(name, curve, *CURVES)
    _require_points(name, curve.coefficients, 1)
    whole = curve.clamp()
    nurbs = NURBSCurve.from_bspline(whole) if isinstance(whole, BSplineCurve) else whole
    _require_weights(name, nurbs.weights, file)
    span = np.diff(nurbs.kv.breaks).min()
    if span < file.least_span:
        raise ValueError(
            f"{name} must have knots at least {file.least_span:g} apart in IGES, got a span of {span:.2g}"
        )
    try:
        return BRepBuilderAPI_MakeEdge(rational_geom_curve(nurbs)).Edge()
    except OCCT_ERRORS as error:
        raise RuntimeError(f"OCCT could not make an edge of {name}: {error}") from error


def _tensor_product(surface: Surface, name: str) -> BSplineSurface | NURBSSurface:
    if isinstance(surface, BSplineSurface | NURBSSurface):
        return surface.clamp()
    from thbcad.surfaces import THBSurface  # loads the hierarchy, which tensor products do without

    require_type(name, surface, THBSurface, BSplineSurface, NURBSSurface)
    return surface.to_bspline().clamp()


def _require_points(name: str, net: Floats, directions: int) -> None:
    if net.shape[directions:] != (3,):
        raise ValueError(f"{name} must have points (x, y, z), got a net of shape {net.shape}")


def _require_weights(name: str, weights: Floats, file: Format) -> None:
    if weights.min() < file.least_weight:
        raise ValueError(
            f"{name} must have weights of at least {file.least_weight:g} in IGES, got {weights.min():g}"
        )


def _write(
    what: str, given: object, shape_of: Callable[[Any, str, Format], TopoDS_Shape], path: str | Path
) -> None:
    """Write splines as shapes of their own; `what` they are, in the plural."""
    file = FORMATS[require_suffix(path, *FORMATS)]
    splines = given if isinstance(given, list | tuple) else [given]
    if not splines:
        raise ValueError(f"{what} must hold at least one {what[:-1]}")
    compound = TopoDS_Compound()
    BUILDER.MakeCompound(compound)
    for k, spline in enumerate(splines):
        BUILDER.Add(compound, shape_of(spline, f"{what}[{k}]", file))
    write_bytes(path, file.write(compound, what))


def _read(
    what: str, parts_of: Callable[[TopoDS_Shape], list[Any]], spline_of: Callable[[Any], T], path: str | Path
) -> list[T]:
    """Return the splines under the parts of a shape; `what` they are, in the singular."""
    path = Path(path)
    file = FORMATS[require_suffix(path, *FORMATS)]
    silence()
    try:
        parts = parts_of(file.read(path))
    except OCCT_ERRORS as error:
        raise ValueError(f"{path} is not readable: {error}") from error
    if not parts:
        raise ValueError(f"{path} holds no {what}s")
    splines = []
    for k, part in enumerate(parts):
        try:
            splines.append(spline_of(part))
        except READ_ERRORS as error:
            raise ValueError(f"{what} {k} of {path} cannot be read: {error}") from error
    return splines


def _surface_under(face: TopoDS_Face) -> BSplineSurface | NURBSSurface:
    geom = BRep_Tool.Surface_s(face)
    adaptor = BRepAdaptor_Surface(face)
    if isinstance(geom, Geom_BSplineSurface):
        return spline_surface(geom)
    kind = adaptor.GetType()
    if kind in APPROXIMATE_SURFACES or (kind in SWEPT and adaptor.BasisCurve().GetType() in APPROXIMATE):
        raise ValueError("it is no surface that NURBS hold exactly")
    trimmed = Geom_RectangularTrimmedSurface(geom, *_rectangle(face, geom))
    return spline_surface(GeomConvert.SurfaceToBSplineSurface_s(trimmed))


def _curve_under(edge: TopoDS_Edge) -> Curve:
    adaptor = BRepAdaptor_Curve(edge)
    ends = adaptor.FirstParameter(), adaptor.LastParameter()
    if adaptor.GetType() in APPROXIMATE:
        raise ValueError("it is no curve that NURBS hold exactly")
    geom = BRep_Tool.Curve_s(edge, *ends)
    if isinstance(geom, Geom_BSplineCurve):
        return spline_curve(geom, *ends)
    geom = GeomConvert.CurveToBSplineCurve_s(Geom_TrimmedCurve(geom, *ends))
    return spline_curve(geom, geom.FirstParameter(), geom.LastParameter())


def _rectangle(face: TopoDS_Face, geom: Geom_Surface) -> tuple[float, float, float, float]:
    """Return the parameter rectangle of a face; all round a closed surface it is that of the surface, which
    has no rounding."""
    (u0, u1, v0, v1), (a0, a1, b0, b1) = BRepTools.UVBounds_s(face), geom.Bounds()
    if geom.IsUPeriodic() and u1 - u0 > (1 - 1e-12) * geom.UPeriod():
        u0, u1 = a0, a1
    if geom.IsVPeriodic() and v1 - v0 > (1 - 1e-12) * geom.VPeriod():
        v0, v1 = b0, b1
    return u0, u1, v0, v1
