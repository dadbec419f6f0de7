"""B-spline and NURBS surfaces as loose faces in STEP, IGES and BREP files.

All three formats give back points, weights and knots bit for bit.  Exceptions: in STEP and IGES
a surface that is closed to 1e-7 mm comes back closed exactly (OCCT makes it periodic on reading);
equal weights come back as a polynomial surface, in IGES also those that differ by less than 1e-10.
"""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from OCP import Standard
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
from OCP.BRepTools import BRepTools
from OCP.Geom import Geom_BSplineSurface, Geom_RectangularTrimmedSurface
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
from OCP.IFSelect import IFSelect_RetDone
from OCP.IGESControl import IGESControl_Controller, IGESControl_Reader, IGESControl_Writer
from OCP.IGESData import IGESData_IGESWriter
from OCP.IGESSolid import IGESSolid
from OCP.STEPControl import STEPControl_Reader
from OCP.TCollection import TCollection_HAsciiString
from OCP.TColStd import TColStd_Array1OfReal
from OCP.TopAbs import TopAbs_FACE
from OCP.TopExp import TopExp_Explorer
from OCP.TopoDS import TopoDS, TopoDS_Compound, TopoDS_Shape
from OCP.TopTools import TopTools_FormatVersion

from thbcad.bspline import KnotVector
from thbcad.cad.solid import TOLERANCE, geom_surface
from thbcad.cad.writing import REALS, occt_settings, silence, step_text
from thbcad.files import write_bytes
from thbcad.rational import NURBSSurface
from thbcad.surface import BSplineSurface

if TYPE_CHECKING:
    from OCP.Geom import Geom_Surface
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopoDS import TopoDS_Face

IGES_STAMP = "20000101.000000"
IGES_LEAST_WEIGHT = 1e-9  # OCCT reads a surface with a lesser weight as polynomial
IGES_END = re.compile(rb"^.{72}T *0*1\s*$", re.MULTILINE)
BREP_TABLE = re.compile(rb"^CASCADE Topology V\d.*^TShapes (\d+)", re.MULTILINE | re.DOTALL)
BREP_END = re.compile(rb"\*\s+[-+ie]\d+ \d+\s*\Z")
EXACT = (GeomAbs_Plane, GeomAbs_Cylinder, GeomAbs_Cone, GeomAbs_Sphere, GeomAbs_Torus, GeomAbs_BezierSurface, GeomAbs_BSplineSurface)
SWEPT = (GeomAbs_SurfaceOfRevolution, GeomAbs_SurfaceOfExtrusion)
APPROXIMATE = (GeomAbs_OffsetCurve, GeomAbs_OtherCurve)
OCCT_ERRORS = tuple(e for e in vars(Standard).values() if isinstance(e, type) and issubclass(e, Exception))  # they have no common base


def write_faces(surfaces: Sequence[BSplineSurface | NURBSSurface], path: str | Path) -> None:
    """Write surfaces with points (x, y, z) in mm as loose faces; the suffix tells the format.

    STEP is .step or .stp, IGES is .igs or .iges, BREP is .brep.  The same surfaces give the same bytes.

    Raises
    ------
    OSError : the file cannot be written.
    ValueError : another suffix; no surfaces; points without three components; IGES: a weight below 1e-9.
    RuntimeError : OCCT refuses a surface.
    """
    path = Path(path)
    write = _format(path)[0]
    if not surfaces:
        raise ValueError("surfaces must hold at least one surface")
    for k, surface in enumerate(surfaces):
        shape = (surface.coefficients if isinstance(surface, BSplineSurface) else surface.points).shape
        if shape[2:] != (3,):
            raise ValueError(f"surfaces[{k}] must have points (x, y, z), got a net of shape {shape}")
    nurbs = [NURBSSurface.from_bspline(s) if isinstance(s, BSplineSurface) else s for s in surfaces]
    write_bytes(path, write(nurbs))


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
        faces = explore(read(path), TopAbs_FACE)
    except OCCT_ERRORS as error:
        raise ValueError(f"{path} is not readable: {error}") from error
    if not faces:
        raise ValueError(f"{path} holds no faces")
    return [_read_face(path, k, TopoDS.Face_s(face)) for k, face in enumerate(faces)]


def rational_geom(surface: NURBSSurface) -> Geom_BSplineSurface:
    """Return a NURBSSurface as Geom_BSplineSurface; equal weights make a polynomial one."""
    geom = geom_surface(BSplineSurface(surface.kv_u, surface.kv_v, surface.points))
    if np.ptp(surface.weights) == 0:
        return geom
    row = TColStd_Array1OfReal(1, surface.kv_v.dim)
    for i, weights in enumerate(surface.weights.tolist(), 1):
        for j, weight in enumerate(weights, 1):
            row.SetValue(j, weight)
        geom.SetWeightRow(i, row)
    return geom


def spline_surface(geom: Geom_BSplineSurface) -> BSplineSurface | NURBSSurface:
    """Return a Geom_BSplineSurface with the very numbers of the file; a periodic one is cut at its ends."""
    geom = geom.Copy()
    if geom.IsUPeriodic():
        geom.SetUNotPeriodic()
    if geom.IsVPeriodic():
        geom.SetVNotPeriodic()
    geom.Segment(*geom.Bounds())  # clamps the knots
    kv_u = _knot_vector(geom.UDegree(), geom.UKnot, geom.UMultiplicity, geom.NbUKnots())
    kv_v = _knot_vector(geom.VDegree(), geom.VKnot, geom.VMultiplicity, geom.NbVKnots())
    rows, columns = range(1, geom.NbUPoles() + 1), range(1, geom.NbVPoles() + 1)
    points = np.array([[geom.Pole(i, j).Coord() for j in columns] for i in rows])
    if not (geom.IsURational() or geom.IsVRational()):
        return BSplineSurface(kv_u, kv_v, points)
    return NURBSSurface(kv_u, kv_v, points, np.array([[geom.Weight(i, j) for j in columns] for i in rows]))


def explore(shape: TopoDS_Shape, kind: TopAbs_ShapeEnum) -> list[TopoDS_Shape]:
    """Return the faces, edges, ... of a shape in their order."""
    explorer, found = TopExp_Explorer(shape, kind), []
    while explorer.More():
        found.append(explorer.Current())
        explorer.Next()
    return found


def step_shape(path: Path) -> TopoDS_Shape:
    """Return the shape of a STEP file, in mm."""
    reader = STEPControl_Reader()
    with occt_settings({"xstep.cascade.unit": "MM"}):
        if reader.ReadFile(str(path)) != IFSelect_RetDone or not reader.TransferRoots():
            raise ValueError(f"{path} is not a readable STEP file")
        return reader.OneShape()


def _iges_shape(path: Path) -> TopoDS_Shape:
    reader = IGESControl_Reader()
    whole = IGES_END.search(path.read_bytes())  # OCCT reads what there is of a truncated file
    with occt_settings({"xstep.cascade.unit": "MM", "read.iges.bspline.continuity": "0"}):
        if not whole or reader.ReadFile(str(path)) != IFSelect_RetDone or not reader.TransferRoots():
            raise ValueError(f"{path} is not a readable IGES file")
        return reader.OneShape()


def _brep_shape(path: Path) -> TopoDS_Shape:
    shape, data = TopoDS_Shape(), path.read_bytes()
    # OCCT does not return from a truncated file: every shape of the table must end with its star, then one of them is named
    table = BREP_TABLE.search(data)
    whole = table and data.count(b"*", table.end()) == int(table[1]) and BREP_END.search(data)
    if not whole or not BRepTools.Read_s(shape, str(path), BRep_Builder()) or shape.IsNull():
        raise ValueError(f"{path} is not a readable BREP file")
    return shape


def _step_bytes(surfaces: Sequence[NURBSSurface]) -> bytes:
    return step_text(_compound(surfaces), "surfaces")


def _brep_bytes(surfaces: Sequence[NURBSSurface]) -> bytes:
    buffer = io.BytesIO()
    BRepTools.Write_s(_compound(surfaces), buffer, False, False, TopTools_FormatVersion.TopTools_FormatVersion_VERSION_1)
    return buffer.getvalue()


def _iges_bytes(surfaces: Sequence[NURBSSurface]) -> bytes:
    least = min(surface.weights.min() for surface in surfaces)
    if least < IGES_LEAST_WEIGHT:
        raise ValueError(f"weights must be at least {IGES_LEAST_WEIGHT} in IGES, got {least}")
    IGESControl_Controller.Init_s()
    silence()
    writer = IGESControl_Writer("MM", 0)
    if not writer.AddShape(_compound(surfaces)):
        raise RuntimeError("OCCT could not translate the surfaces to IGES")
    writer.ComputeModel()
    model = writer.Model()
    head = model.GlobalSection()
    for setter, value in ((head.SetAuthorName, ""), (head.SetFileName, "surfaces"), (head.SetSendName, "thbcad")):
        setter(TCollection_HAsciiString(value))
    for setter in (head.SetDate, head.SetLastChangeDate):
        setter(TCollection_HAsciiString(IGES_STAMP))
    model.SetGlobalSection(head)
    text = IGESData_IGESWriter(model)
    text.FloatWriter().SetFormat(REALS)
    text.SendModel(IGESSolid.Protocol_s())
    buffer = io.BytesIO()
    if not text.Print(buffer):
        raise RuntimeError("OCCT could not print the IGES file")
    return buffer.getvalue()


FORMATS: dict[str, tuple[Callable[[Sequence[NURBSSurface]], bytes], Callable[[Path], TopoDS_Shape]]] = {
    **dict.fromkeys((".step", ".stp"), (_step_bytes, step_shape)),
    **dict.fromkeys((".iges", ".igs"), (_iges_bytes, _iges_shape)),
    ".brep": (_brep_bytes, _brep_shape),
}


def _format(path: Path) -> tuple[Callable[[Sequence[NURBSSurface]], bytes], Callable[[Path], TopoDS_Shape]]:
    if path.suffix.lower() not in FORMATS:
        raise ValueError(f"{path} must end in {', '.join(FORMATS)}")
    return FORMATS[path.suffix.lower()]


def _compound(surfaces: Sequence[NURBSSurface]) -> TopoDS_Compound:
    compound, builder = TopoDS_Compound(), BRep_Builder()
    builder.MakeCompound(compound)
    for k, surface in enumerate(surfaces):
        try:
            builder.Add(compound, BRepBuilderAPI_MakeFace(rational_geom(surface), TOLERANCE).Face())
        except OCCT_ERRORS as error:
            raise RuntimeError(f"OCCT could not make a face of surfaces[{k}]: {error}") from error
    return compound


def _read_face(path: Path, number: int, face: TopoDS_Face) -> BSplineSurface | NURBSSurface:
    geom, kind = BRep_Tool.Surface_s(face), BRepAdaptor_Surface(face)
    try:
        if isinstance(geom, Geom_BSplineSurface):
            return spline_surface(geom)
        exact = kind.GetType() in EXACT or (kind.GetType() in SWEPT and kind.BasisCurve().GetType() not in APPROXIMATE)
        if not exact:
            raise ValueError("it is no surface that NURBS hold exactly")
        trimmed = Geom_RectangularTrimmedSurface(geom, *_rectangle(face, geom))
        return spline_surface(GeomConvert.SurfaceToBSplineSurface_s(trimmed))
    except (ValueError, *OCCT_ERRORS) as error:
        raise ValueError(f"face {number} of {path} cannot be read: {error}") from error


def _rectangle(face: TopoDS_Face, geom: Geom_Surface) -> tuple[float, float, float, float]:
    """Return the parameter rectangle of a face; all round a closed surface it is that of the surface, which has no rounding."""
    (u0, u1, v0, v1), (a0, a1, b0, b1) = BRepTools.UVBounds_s(face), geom.Bounds()
    if geom.IsUPeriodic() and u1 - u0 > (1 - 1e-12) * geom.UPeriod():
        u0, u1 = a0, a1
    if geom.IsVPeriodic() and v1 - v0 > (1 - 1e-12) * geom.VPeriod():
        v0, v1 = b0, b1
    return u0, u1, v0, v1


def _knot_vector(degree: int, knot: Callable[[int], float], multiplicity: Callable[[int], int], count: int) -> KnotVector:
    numbers = range(1, count + 1)
    return KnotVector(degree, np.repeat([knot(k) for k in numbers], [multiplicity(k) for k in numbers]))
