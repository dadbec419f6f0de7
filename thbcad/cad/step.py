"""STEP files of lenses: written with every digit, read back as splines.

Reals are written with 17 significant digits, so that poles and knots read back bit for bit.
The time stamp is fixed: the same lens gives the same bytes.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from OCP.APIHeaderSection import APIHeaderSection_MakeHeader
from OCP.BRep import BRep_Tool
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.BRepGProp import BRepGProp
from OCP.Geom import Geom_BSplineSurface
from OCP.GProp import GProp_GProps
from OCP.IFSelect import IFSelect_RetDone
from OCP.Interface import Interface_InterfaceModel, Interface_Static
from OCP.Message import Message
from OCP.ShapeAnalysis import ShapeAnalysis_ShapeTolerance
from OCP.StepAP214 import StepAP214
from OCP.StepBasic import StepBasic_Product
from OCP.STEPControl import STEPControl_AsIs, STEPControl_Reader, STEPControl_Writer
from OCP.StepData import StepData_StepWriter
from OCP.TCollection import TCollection_HAsciiString
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_SHELL, TopAbs_SOLID
from OCP.TopExp import TopExp, TopExp_Explorer
from OCP.TopoDS import TopoDS
from OCP.TopTools import TopTools_IndexedDataMapOfShapeListOfShape

from thbcad.bspline import KnotVector
from thbcad.cad.solid import lens_solid
from thbcad.files import write_bytes
from thbcad.surface import BSplineSurface

if TYPE_CHECKING:
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopoDS import TopoDS_Shape

    from thbcad.lens import Lens

STAMP = "2000-01-01T00:00:00"
PRODUCT = "lens"
VOLUME_TOLERANCE = 1e-6  # relative, asked of OCCT's volume integral


@dataclass(frozen=True, eq=False)
class StepLens:
    """What a STEP file holds: the two optical faces as splines and the state of the solid.

    front, rear : BSplineSurface with poles (x, y, z) in mm, as in the file
    solids, faces, free_edges : int; an edge is free when it does not border two faces
    tolerance : float, mm, the greatest that faces, edges and vertices need to meet
    closed, valid : bool, OCCT's closedness of the shell and its validity check
    volume : float, mm^3, by OCCT
    """

    front: BSplineSurface
    rear: BSplineSurface
    solids: int
    faces: int
    free_edges: int
    tolerance: float
    closed: bool
    valid: bool
    volume: float


def write_step(lens: Lens, path: str | Path) -> None:
    """Write the lens as one closed solid of six faces, in mm.

    Raises
    ------
    OSError : the file cannot be written.
    RuntimeError : OCCT refuses the solid.
    """
    write_bytes(path, step_bytes(lens))


def step_bytes(lens: Lens) -> bytes:
    """Return the STEP file of a lens; the same lens gives the same bytes."""
    _silence()
    STEPControl_Writer()  # the settings exist only once a writer has been made
    with _settings({"write.step.schema": "AP214IS", "write.step.unit": "MM", "write.surfacecurve.mode": "0"}):
        writer = STEPControl_Writer()  # takes the schema when it is made
        if writer.Transfer(lens_solid(lens), STEPControl_AsIs) != IFSelect_RetDone:
            raise RuntimeError("OCCT could not translate the lens solid to STEP")
    model = writer.Model()
    _name_product(model)
    header = APIHeaderSection_MakeHeader(model)
    header.SetName(TCollection_HAsciiString(PRODUCT))
    header.SetTimeStamp(TCollection_HAsciiString(STAMP))
    header.SetAuthorValue(1, TCollection_HAsciiString(""))
    header.SetOrganizationValue(1, TCollection_HAsciiString(""))
    header.SetOriginatingSystem(TCollection_HAsciiString("thbcad"))
    text = StepData_StepWriter(model)
    text.FloatWriter().SetFormat("%#.17G")
    text.SendModel(StepAP214.Protocol_s())
    buffer = io.BytesIO()
    if not text.Print(buffer):
        raise RuntimeError("OCCT could not print the STEP file")
    return buffer.getvalue()


def read_step(path: str | Path) -> StepLens:
    """Read a STEP file with a lens solid; lengths are converted to mm.

    Raises
    ------
    OSError : the file cannot be read.
    ValueError : it is no STEP file, or does not hold two optical faces.
    """
    path = Path(path)
    with path.open("rb"):
        pass
    _silence()
    reader = STEPControl_Reader()
    with _settings({"xstep.cascade.unit": "MM"}):
        if reader.ReadFile(str(path)) != IFSelect_RetDone or not reader.TransferRoots():
            raise ValueError(f"{path} is not a readable STEP file")
        shape = reader.OneShape()
    splines = []
    for face in _explore(shape, TopAbs_FACE):
        surface = BRep_Tool.Surface_s(TopoDS.Face_s(face))
        # the ruled edges are straight one way, front and rear are not
        if isinstance(surface, Geom_BSplineSurface) and min(surface.UDegree(), surface.VDegree()) > 1:
            splines.append(_spline(surface))
    if len(splines) != 2:
        raise ValueError(f"{path} holds {len(splines)} curved spline faces where a lens has 2, front and rear")
    front, rear = sorted(splines, key=_centre_height)
    shells = [TopoDS.Shell_s(s) for s in _explore(shape, TopAbs_SHELL)]
    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, properties, VOLUME_TOLERANCE)
    return StepLens(
        front=front,
        rear=rear,
        solids=len(_explore(shape, TopAbs_SOLID)),
        faces=len(_explore(shape, TopAbs_FACE)),
        free_edges=_free_edges(shape),
        tolerance=ShapeAnalysis_ShapeTolerance().Tolerance(shape, 1),
        closed=bool(shells) and all(BRep_Tool.IsClosed_s(s) for s in shells),
        valid=BRepCheck_Analyzer(shape).IsValid(),
        volume=properties.Mass(),
    )


@contextmanager
def _settings(values: dict[str, str]) -> Iterator[None]:
    """Set OCCT's process-wide parameters for a while."""
    before = {name: Interface_Static.CVal_s(name) for name in values}
    for name, value in values.items():
        Interface_Static.SetCVal_s(name, value)
    try:
        yield
    finally:
        for name, value in before.items():
            Interface_Static.SetCVal_s(name, value)


def _name_product(model: Interface_InterfaceModel) -> None:
    """Give the product a name without the counter that OCCT appends."""
    for number in range(1, model.NbEntities() + 1):
        entity = model.Value(number)
        if isinstance(entity, StepBasic_Product):
            entity.SetId(TCollection_HAsciiString(PRODUCT))
            entity.SetName(TCollection_HAsciiString(PRODUCT))


def _centre_height(spline: BSplineSurface) -> float:
    """Return z at the middle of the parameters."""
    u, v = ((kv.start + kv.stop) / 2 for kv in (spline.kv_u, spline.kv_v))
    return float(spline([u], [v])[0, 2])


def _silence() -> None:
    """Keep OCCT's transfer statistics off stdout."""
    Message.DefaultMessenger_s().ChangePrinters().Clear()


def _explore(shape: TopoDS_Shape, kind: TopAbs_ShapeEnum) -> list[TopoDS_Shape]:
    explorer, found = TopExp_Explorer(shape, kind), []
    while explorer.More():
        found.append(explorer.Current())
        explorer.Next()
    return found


def _free_edges(shape: TopoDS_Shape) -> int:
    owners = TopTools_IndexedDataMapOfShapeListOfShape()
    TopExp.MapShapesAndAncestors_s(shape, TopAbs_EDGE, TopAbs_FACE, owners)
    return sum(owners.FindFromIndex(k).Extent() != 2 for k in range(1, owners.Extent() + 1))


def _spline(surface: Geom_BSplineSurface) -> BSplineSurface:
    """Return a Geom_BSplineSurface as BSplineSurface, with the very numbers of the file."""
    kv_u = _knot_vector(surface.UDegree(), surface.UKnot, surface.UMultiplicity, surface.NbUKnots())
    kv_v = _knot_vector(surface.VDegree(), surface.VKnot, surface.VMultiplicity, surface.NbVKnots())
    rows, columns = range(1, surface.NbUPoles() + 1), range(1, surface.NbVPoles() + 1)
    xyz = [[surface.Pole(i, j).Coord() for j in columns] for i in rows]
    return BSplineSurface(kv_u, kv_v, np.array(xyz))


def _knot_vector(degree: int, knot: Callable[[int], float], multiplicity: Callable[[int], int], count: int) -> KnotVector:
    numbers = range(1, count + 1)
    return KnotVector(degree, np.repeat([knot(k) for k in numbers], [multiplicity(k) for k in numbers]))
