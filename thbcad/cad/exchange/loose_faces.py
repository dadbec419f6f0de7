"""B-spline and NURBS surfaces as loose faces in STEP, IGES and BREP files.

All three formats give back points, weights and knots bit for bit.  Exceptions: in STEP and IGES
a surface that is closed to 1e-7 mm comes back closed exactly (OCCT makes it periodic on reading);
equal weights come back as a polynomial surface, in IGES also those that differ by less than 1e-10.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import numpy as np
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
from OCP.BRepTools import BRepTools
from OCP.Geom import Geom_BSplineSurface, Geom_RectangularTrimmedSurface, Geom_Surface
from OCP.GeomAbs import (
    GeomAbs_BezierSurface,
    GeomAbs_BSplineSurface,
    GeomAbs_Cone,
    GeomAbs_Cylinder,
    GeomAbs_OffsetCurve,
    GeomAbs_OtherCurve,
    GeomAbs_Plane,
    GeomAbs_Sphere,
    GeomAbs_SurfaceOfExtrusion,
    GeomAbs_SurfaceOfRevolution,
    GeomAbs_Torus,
)
from OCP.GeomConvert import GeomConvert
from OCP.TopoDS import TopoDS_Compound, TopoDS_Face, TopoDS_Shape

from thbcad.cad.exchange.iges_writing import FACES, brep_text, iges_text
from thbcad.cad.exchange.reading import OCCT_ERRORS, brep_shape, faces_of, iges_shape, step_shape
from thbcad.cad.exchange.step_writing import silence, step_text
from thbcad.cad.shapes import TOLERANCE, rational_geom, spline_surface
from thbcad.io import write_bytes
from thbcad.lens import Product
from thbcad.splines import BSplineSurface, NURBSSurface

IGES_LEAST_WEIGHT = 1e-9  # OCCT reads a surface with a lesser weight as polynomial
EXACT = (
    GeomAbs_Plane,
    GeomAbs_Cylinder,
    GeomAbs_Cone,
    GeomAbs_Sphere,
    GeomAbs_Torus,
    GeomAbs_BezierSurface,
    GeomAbs_BSplineSurface,
)
SWEPT = (GeomAbs_SurfaceOfRevolution, GeomAbs_SurfaceOfExtrusion)
APPROXIMATE = (GeomAbs_OffsetCurve, GeomAbs_OtherCurve)
READ_ERRORS: tuple[type[Exception], ...] = (ValueError, *OCCT_ERRORS)
LEAST_SIZE = 1e-6  # mm; OCCT drops smaller faces


def write_faces(surfaces: Sequence[BSplineSurface | NURBSSurface], path: str | Path) -> None:
    """Write surfaces with points (x, y, z) in mm as loose faces; the suffix names the format.

    STEP is .step or .stp, IGES is .igs or .iges, BREP is .brep.  The same surfaces give the same bytes.

    Raises
    ------
    OSError : the file cannot be written.
    ValueError : another suffix; no surfaces; points without three components; IGES: a weight below 1e-9;
        STEP and IGES: a surface whose points fit into a box with a diagonal below 1e-6 mm.
    RuntimeError : OCCT refuses a surface.
    """
    path = Path(path)
    write = _format(path)[0]
    if not isinstance(surfaces, Sequence):
        raise ValueError(f"surfaces must be a list of surfaces, got {type(surfaces).__name__}")
    if not surfaces:
        raise ValueError("surfaces must hold at least one surface")
    least = 0.0 if path.suffix.lower() == ".brep" else LEAST_SIZE
    checked = [_checked(k, surface, least) for k, surface in enumerate(surfaces)]
    lightest = min(surface.weights.min() for surface in checked)
    if write is IGES[0] and lightest < IGES_LEAST_WEIGHT:
        raise ValueError(f"weights must be at least {IGES_LEAST_WEIGHT} in IGES, got {lightest}")
    write_bytes(path, write(_compound(checked)))


def read_faces(path: str | Path) -> list[BSplineSurface | NURBSSurface]:
    """Read the surfaces under all faces of a STEP, IGES or BREP file, in mm.

    A B-spline surface comes whole, with the numbers of the file; planes, cylinders, cones, spheres,
    tori, extrusions and revolutions come as exact NURBS over the parameter rectangle of the face.
    Trimming curves and orientations are not read.  Polynomial surfaces are BSplineSurface.

    Raises
    ------
    OSError : the file cannot be read.
    ValueError : another suffix; no file of that format; no faces; a surface that is no exact NURBS
        or has a degree above 10.
    """
    path = Path(path)
    read = _format(path)[1]
    with path.open("rb"):
        pass
    silence()
    try:
        faces = faces_of(read(path))
    except OCCT_ERRORS as error:
        raise ValueError(f"{path} is not readable: {error}") from error
    if not faces:
        raise ValueError(f"{path} holds no faces")
    return [_read_face(path, k, face) for k, face in enumerate(faces)]


def _checked(number: int, surface: object, least: float) -> NURBSSurface:
    """Return a surface as NURBS; refuse other things, other dimensions than 3 and boxes of less than the
    `least` diagonal, mm."""
    if not isinstance(surface, BSplineSurface | NURBSSurface):
        raise ValueError(
            f"surfaces[{number}] must be a BSplineSurface or NURBSSurface, got {type(surface).__name__}"
        )
    net = surface.coefficients
    if net.shape[2:] != (3,):
        raise ValueError(f"surfaces[{number}] must have points (x, y, z), got a net of shape {net.shape}")
    size = np.linalg.norm(np.ptp(net, axis=(0, 1)))
    if size < least:
        raise ValueError(
            f"surfaces[{number}] is {size:.2g} mm large, below the {least:g} mm that STEP and IGES keep"
        )
    surface = surface.clamp()
    return NURBSSurface.from_bspline(surface) if isinstance(surface, BSplineSurface) else surface


STEP = partial(step_text, product="surfaces"), step_shape
IGES = partial(iges_text, mode=FACES, product=Product("surfaces")), iges_shape
FORMATS: dict[str, tuple[Callable[[TopoDS_Shape], bytes], Callable[[Path], TopoDS_Shape]]] = {
    **{".step": STEP, ".stp": STEP, ".iges": IGES, ".igs": IGES},
    ".brep": (brep_text, brep_shape),
}


def _format(path: Path) -> tuple[Callable[[TopoDS_Shape], bytes], Callable[[Path], TopoDS_Shape]]:
    if path.suffix.lower() not in FORMATS:
        raise ValueError(f"{path} must end in {', '.join(FORMATS)}")
    return FORMATS[path.suffix.lower()]


def _compound(surfaces: Sequence[NURBSSurface]) -> TopoDS_Compound:
    compound = TopoDS_Compound()
    builder = BRep_Builder()
    builder.MakeCompound(compound)
    for k, surface in enumerate(surfaces):
        try:
            builder.Add(compound, BRepBuilderAPI_MakeFace(rational_geom(surface), TOLERANCE).Face())
        except OCCT_ERRORS as error:
            raise RuntimeError(f"OCCT could not make a face of surfaces[{k}]: {error}") from error
    return compound


def _read_face(path: Path, number: int, face: TopoDS_Face) -> BSplineSurface | NURBSSurface:
    geom = BRep_Tool.Surface_s(face)
    adaptor = BRepAdaptor_Surface(face)
    try:
        if isinstance(geom, Geom_BSplineSurface):
            return spline_surface(geom)
        exact = adaptor.GetType() in EXACT or (
            adaptor.GetType() in SWEPT and adaptor.BasisCurve().GetType() not in APPROXIMATE
        )
        if not exact:
            raise ValueError("it is no surface that NURBS hold exactly")
        trimmed = Geom_RectangularTrimmedSurface(geom, *_rectangle(face, geom))
        return spline_surface(GeomConvert.SurfaceToBSplineSurface_s(trimmed))
    except READ_ERRORS as error:
        raise ValueError(f"face {number} of {path} cannot be read: {error}") from error


def _rectangle(face: TopoDS_Face, geom: Geom_Surface) -> tuple[float, float, float, float]:
    """Return the parameter rectangle of a face; all round a closed surface it is that of the surface, which
    has no rounding."""
    (u0, u1, v0, v1), (a0, a1, b0, b1) = BRepTools.UVBounds_s(face), geom.Bounds()
    if geom.IsUPeriodic() and u1 - u0 > (1 - 1e-12) * geom.UPeriod():
        u0, u1 = a0, a1
    if geom.IsVPeriodic() and v1 - v0 > (1 - 1e-12) * geom.VPeriod():
        v0, v1 = b0, b1
    return u0, u1, v0, v1
