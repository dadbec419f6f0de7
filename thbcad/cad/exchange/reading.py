"""OCCT shapes from STEP, IGES and BREP files, and what they consist of."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from OCP.BRep import BRep_Builder
from OCP.BRepTools import BRepTools
from OCP.IFSelect import IFSelect_RetDone
from OCP.IGESControl import IGESControl_Reader
from OCP.STEPCAFControl import STEPCAFControl_Reader
from OCP.STEPControl import STEPControl_Reader
from OCP.TCollection import TCollection_ExtendedString
from OCP.TDocStd import TDocStd_Document
from OCP.TopExp import TopExp_Explorer
from OCP.TopoDS import TopoDS_Shape

from thbcad.cad.exchange.step_writing import occt_settings

if TYPE_CHECKING:
    from OCP.TopAbs import TopAbs_ShapeEnum

IGES_END = re.compile(rb"^.{72}T *0*1\s*$", re.MULTILINE)
BREP_TABLE = re.compile(rb"^CASCADE Topology V\d.*^TShapes (\d+)", re.MULTILINE | re.DOTALL)
BREP_END = re.compile(rb"\*\s+[-+ie]\d+ \d+\s*\Z")


def explore(shape: TopoDS_Shape, kind: TopAbs_ShapeEnum) -> list[TopoDS_Shape]:
    """Return the faces, edges, ... of a shape in their order."""
    explorer = TopExp_Explorer(shape, kind)
    shapes = []
    while explorer.More():
        shapes.append(explorer.Current())
        explorer.Next()
    return shapes


def step_shape(path: Path) -> TopoDS_Shape:
    """Return the shape of a STEP file, in mm.

    Raises
    ------
    ValueError : it is not readable.
    """
    reader = STEPControl_Reader()
    with occt_settings({"xstep.cascade.unit": "MM"}):
        if reader.ReadFile(str(path)) != IFSelect_RetDone or not reader.TransferRoots():
            raise ValueError(f"{path} is not a readable STEP file")
        return reader.OneShape()


def step_document(path: Path) -> tuple[STEPControl_Reader, TDocStd_Document]:
    """Return a STEP file as read, in mm, with the document that holds its names and materials.

    Raises
    ------
    ValueError : it is not readable.
    """
    reader = STEPCAFControl_Reader()
    document = TDocStd_Document(TCollection_ExtendedString("XmlXCAF"))
    with occt_settings({"xstep.cascade.unit": "MM"}):
        if reader.ReadFile(str(path)) != IFSelect_RetDone or not reader.Transfer(document):
            raise ValueError(f"{path} is not a readable STEP file")
    return reader.ChangeReader(), document


def iges_shape(path: Path) -> TopoDS_Shape:
    """Return the shape of an IGES file, in mm.

    Raises
    ------
    ValueError : it is not readable, or not whole.
    """
    reader = IGESControl_Reader()
    whole = IGES_END.search(path.read_bytes())  # OCCT reads what there is of a truncated file
    with occt_settings({"xstep.cascade.unit": "MM", "read.iges.bspline.continuity": "0"}):
        if not whole or reader.ReadFile(str(path)) != IFSelect_RetDone or not reader.TransferRoots():
            raise ValueError(f"{path} is not a readable IGES file")
        return reader.OneShape()


def brep_shape(path: Path) -> TopoDS_Shape:
    """Return the shape of a BREP file, as it is.

    Raises
    ------
    ValueError : it is not readable, or not whole.
    """
    shape = TopoDS_Shape()
    data = path.read_bytes()
    # OCCT does not return from a truncated file: every shape of the table must end with its star, then one of
    # them is named
    table = BREP_TABLE.search(data)
    whole = table and data.count(b"*", table.end()) == int(table[1]) and BREP_END.search(data)
    if not whole or not BRepTools.Read_s(shape, str(path), BRep_Builder()) or shape.IsNull():
        raise ValueError(f"{path} is not a readable BREP file")
    return shape
