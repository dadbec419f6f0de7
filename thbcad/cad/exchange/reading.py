"""OCCT shapes from STEP, IGES and BREP files, and what they consist of.

ISO 10303-21 lets a spline stand as a complex entity `(BOUNDED_SURFACE() B_SPLINE_SURFACE(...) ...)`, with
weights or without; OCCT reads one only with weights.  They are given to it in the one form of each that it
knows.
"""

import re
from collections.abc import Callable
from io import BytesIO
from pathlib import Path

from OCP import Standard, StepBasic, StepGeom, StepRepr, StepShape, StepVisual, TopoDS as Topology
from OCP.BRep import BRep_Builder
from OCP.BRepTools import BRepTools
from OCP.IFSelect import IFSelect_RetDone
from OCP.IGESControl import IGESControl_Reader
from OCP.STEPCAFControl import STEPCAFControl_Reader
from OCP.STEPControl import STEPControl_Reader
from OCP.TCollection import TCollection_ExtendedString
from OCP.TDocStd import TDocStd_Document
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_SHAPE, TopAbs_ShapeEnum
from OCP.TopExp import TopExp_Explorer
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Shape

from thbcad.cad.exchange.occt_texts import occt_settings
from thbcad.cad.occt_names import as_edge, as_face
from thbcad.files import regular_bytes
from thbcad.io import rewritten

MOST_BYTES = 1 << 31  # of a file: OCCT needs ten times as much memory
COMPLEX_SPLINE = re.compile(rb"=\s*+\([^;]*?\bB_SPLINE_(?:SURFACE|CURVE)\b")
TOKEN = re.compile(r"'(?>(?:[^']|'')*)'|\(|\)|[A-Z_][A-Z0-9_]*+", re.ASCII)
OCCT_ERRORS: tuple[type[Exception], ...] = tuple(  # they have no common base
    e
    for module in (Standard, Topology)
    for e in vars(module).values()
    if isinstance(e, type) and issubclass(e, Exception)
)
GEOMETRY = (
    StepBasic.StepBasic_ConversionBasedUnit,
    StepBasic.StepBasic_LengthMeasureWithUnit,
    StepGeom.StepGeom_GeometricRepresentationItem,
    StepRepr.StepRepr_DefinitionalRepresentation,
    StepShape.StepShape_TopologicalRepresentationItem,
)
STYLES = (
    StepVisual.StepVisual_FillAreaStyle,
    StepVisual.StepVisual_FillAreaStyleColour,
    StepVisual.StepVisual_PresentationStyleAssignment,
    StepVisual.StepVisual_StyledItem,
    StepVisual.StepVisual_SurfaceSideStyle,
    StepVisual.StepVisual_SurfaceStyleFillArea,
    StepVisual.StepVisual_SurfaceStyleUsage,
)
EMPTY = re.compile(rb"\(\s*+\)")
NEVER_EMPTY = re.compile(  # OCCT takes the first item of such a list
    rb"(?:\b(?:DIRECTION|SURFACE_CURVE|SEAM_CURVE)\s*\(|B_SPLINE_).*[,(]\s*\Z", re.DOTALL
)
HUGE = re.compile(rb"E(?<=[\d.]E)\+?\d{3}")  # from 1e100 on: squares leave the range of float64
IN_ENTITY = re.compile(rb"\s*#")
IGES_END = re.compile(rb"^.{72}T *0*1\s*$", re.MULTILINE)
BREP_TABLE = re.compile(rb"^CASCADE Topology V\d.*^TShapes (\d+)", re.MULTILINE | re.DOTALL)
BREP_END = re.compile(rb"\*\s+[-+ie]\d+ \d+\s*\Z")


def common_splines(data: bytes) -> bytes:
    """Return a STEP file with its splines as OCCT reads them, the same bytes where they are so already.

    Complex entities without weights become simple ones, `B_SPLINE_SURFACE_WITH_KNOTS(name, ...)`; those with
    weights stay.  No digit changes, and a damaged file stays damaged.
    """
    if COMPLEX_SPLINE.search(data) is None:
        return data
    return rewritten(data.decode("latin-1"), _common).encode("latin-1")


def _common(body: str) -> str:
    """Return a complex spline without weights as a simple entity; another entity stays."""
    if not body.startswith("(") or "B_SPLINE_" not in body:
        return body
    parts = _parts(body)
    for base in ("B_SPLINE_SURFACE", "B_SPLINE_CURVE"):
        with_knots = f"{base}_WITH_KNOTS"
        if base in parts and with_knots in parts and f"RATIONAL_{base}" not in parts:
            name = parts.get("REPRESENTATION_ITEM") or "''"
            return f"{with_knots}({name},{parts[base]},{parts[with_knots]})"
    return body


def _parts(body: str) -> dict[str, str]:
    """Return the text of the parameters of every type of a complex entity; none of a damaged one."""
    parts: dict[str, str] = {}
    depth = opened = 0
    keyword = ""
    for token in TOKEN.finditer(body):
        if token[0] == "(":
            depth += 1
            opened = token.end() if depth == 2 else opened
        elif token[0] == ")":
            if depth == 2:
                parts[keyword] = body[opened : token.start()].rstrip()
            depth -= 1
        elif depth == 1:
            keyword = token[0]
    return parts if depth == 0 else {}


def explore(
    shape: TopoDS_Shape, kind: TopAbs_ShapeEnum, avoided: TopAbs_ShapeEnum = TopAbs_SHAPE
) -> list[TopoDS_Shape]:
    """Return the faces, edges, ... of a shape in their order; none that belongs to an avoided kind."""
    explorer = TopExp_Explorer(shape, kind, avoided)
    shapes = []
    while explorer.More():
        shapes.append(explorer.Current())
        explorer.Next()
    return shapes


def faces_of(shape: TopoDS_Shape) -> list[TopoDS_Face]:
    """Return the faces of a shape in their order."""
    return [as_face(face) for face in explore(shape, TopAbs_FACE)]


def edges_of(shape: TopoDS_Shape, avoided: TopAbs_ShapeEnum = TopAbs_SHAPE) -> list[TopoDS_Edge]:
    """Return the edges of a shape in their order, as `explore`; the seam of a face comes twice."""
    return [as_edge(edge) for edge in explore(shape, TopAbs_EDGE, avoided)]


def step_shape(path: Path, unit: str = "MM") -> TopoDS_Shape:
    """Return the shape of a STEP file, in mm or another unit of OCCT's, such as "INCH" and "M".

    Raises OSError : the file cannot be read.  ValueError : it is not readable, or damaged.
    """
    reader = STEPControl_Reader()
    _transfer(path, reader, GEOMETRY, reader.TransferRoots, unit)
    return reader.OneShape()


def step_document(path: Path) -> tuple[STEPControl_Reader, TDocStd_Document]:
    """Return a STEP file as read, in mm, with the document that holds its names and materials."""
    reader = STEPCAFControl_Reader()
    document = TDocStd_Document(TCollection_ExtendedString("XmlXCAF"))
    _transfer(path, reader.ChangeReader(), (*GEOMETRY, *STYLES), lambda: reader.Transfer(document))
    return reader.ChangeReader(), document


def _transfer(
    path: Path,
    reader: STEPControl_Reader,
    kinds: tuple[type, ...],
    transfer: Callable[[], int],
    unit: str = "MM",
) -> None:
    """Read a STEP file and let OCCT transfer it into a unit of length; raise as `step_shape`.

    kinds : of entities that must be whole.
    """
    data = regular_bytes(path, MOST_BYTES)
    _require_harmless(path, data)
    common = common_splines(data)
    try:
        with occt_settings({"xstep.cascade.unit": unit}):
            status = (
                reader.ReadFile(str(path))
                if common == data
                else reader.ReadStream(str(path), BytesIO(common))
            )
            if status == IFSelect_RetDone:
                _require_filled(path, reader, kinds)
                if transfer():
                    return
    except OCCT_ERRORS as error:
        raise ValueError(f"{path} is not a readable STEP file: {error}") from error
    raise ValueError(f"{path} is not a readable STEP file")


def _require_harmless(path: Path, data: bytes) -> None:
    """Raise ValueError for an empty list of a direction or a curve and for a number from 1e100 on: OCCT ends
    the process over them."""
    for pattern, context, what in (
        (EMPTY, NEVER_EMPTY, "an empty list"),
        (HUGE, IN_ENTITY, "a number from 1e100 on"),
    ):
        for found in pattern.finditer(data):
            before = data[data.rfind(b";", 0, found.start()) + 1 : found.start()]
            if context.search(before) and before.count(b"'") % 2 == 0:
                entity = before.decode("latin-1").strip()
                raise ValueError(f"{path} is not a readable STEP file: {what} after {entity[:60]!r}")


def _require_filled(path: Path, reader: STEPControl_Reader, kinds: tuple[type, ...]) -> None:
    """Raise ValueError where OCCT found no value for a parameter of an entity of some kinds: it ends the
    process where it needs one.  Names and the dimensions of units it does not need."""
    model = reader.Model()
    if not model.Reports().NbEntities():  # as a rule, and to ask every point takes long
        return
    for number in range(1, model.NbEntities() + 1):
        if not model.IsErrorEntity(number) or not isinstance(entity := model.Value(number), kinds):
            continue
        report = model.Check(number, True)
        fails = [report.Fail(k).ToCString() for k in range(1, report.NbFails() + 1)]
        wrong = [fail for fail in fails if "String" not in fail and "(dimensions)" not in fail]
        if wrong:
            kind = type(entity).__name__
            raise ValueError(f"{path} is not a readable STEP file: its entity {number}, {kind}: {wrong[0]}")


def iges_shape(path: Path) -> TopoDS_Shape:
    """Return the shape of an IGES file, in mm.

    Raises ValueError : it is not readable, or not whole.
    """
    reader = IGESControl_Reader()
    whole = IGES_END.search(regular_bytes(path, MOST_BYTES))  # OCCT reads what there is of a truncated file
    with occt_settings({"xstep.cascade.unit": "MM", "read.iges.bspline.continuity": "0"}):
        if not whole or reader.ReadFile(str(path)) != IFSelect_RetDone or not reader.TransferRoots():
            raise ValueError(f"{path} is not a readable IGES file")
        return reader.OneShape()


def brep_shape(path: Path) -> TopoDS_Shape:
    """Return the shape of a BREP file, as it is.

    Raises ValueError : it is not readable, or not whole.
    """
    shape = TopoDS_Shape()
    data = regular_bytes(path, MOST_BYTES)
    # OCCT does not return from a truncated file: every shape of the table must end with its star, then one of
    # them is named
    table = BREP_TABLE.search(data)
    whole = table and data.count(b"*", table.end()) == int(table[1]) and BREP_END.search(data)
    if not whole or not BRepTools.Read_s(shape, str(path), BRep_Builder()) or shape.IsNull():
        raise ValueError(f"{path} is not a readable BREP file")
    return shape
