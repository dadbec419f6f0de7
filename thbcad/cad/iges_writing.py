"""IGES text from OCCT shapes, with every digit, and BREP text."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

from OCP.BRepTools import BRepTools
from OCP.IGESControl import IGESControl_Controller, IGESControl_Writer
from OCP.IGESData import IGESData_IGESWriter
from OCP.IGESSolid import IGESSolid
from OCP.TCollection import TCollection_HAsciiString
from OCP.TopTools import TopTools_FormatVersion

from thbcad.cad.writing import REALS, silence

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Shape

STAMP = "20000101.000000"
FACES, SOLID = 0, 1  # modes of OCCT's writer: loose trimmed surfaces, or a solid as entity 186


def iges_text(shape: TopoDS_Shape, mode: int, name: str) -> bytes:
    """Return a shape as an IGES file in mm; the same shape gives the same bytes.

    mode : FACES or SOLID.  name : of the model.

    Raises
    ------
    RuntimeError : OCCT refuses the shape.
    """
    IGESControl_Controller.Init_s()
    silence()
    writer = IGESControl_Writer("MM", mode)
    if not writer.AddShape(shape):
        raise RuntimeError(f"OCCT could not translate the {name} to IGES")
    writer.ComputeModel()
    model = writer.Model()
    head = model.GlobalSection()
    for setter, value in ((head.SetAuthorName, ""), (head.SetFileName, name), (head.SetSendName, "thbcad")):
        setter(TCollection_HAsciiString(value))
    for setter in (head.SetDate, head.SetLastChangeDate):
        setter(TCollection_HAsciiString(STAMP))
    model.SetGlobalSection(head)
    text = IGESData_IGESWriter(model)
    text.FloatWriter().SetFormat(REALS)
    text.SendModel(IGESSolid.Protocol_s())
    buffer = io.BytesIO()
    if not text.Print(buffer):
        raise RuntimeError("OCCT could not print the IGES file")
    return buffer.getvalue()


def brep_text(shape: TopoDS_Shape) -> bytes:
    """Return a shape as a BREP file."""
    buffer = io.BytesIO()
    BRepTools.Write_s(shape, buffer, False, False, TopTools_FormatVersion.TopTools_FormatVersion_VERSION_1)
    return buffer.getvalue()
