"""IGES text from OCCT shapes, with every digit, and BREP text."""

from __future__ import annotations

import io
from collections.abc import Sequence

from OCP.BRepTools import BRepTools
from OCP.IGESBasic import IGESBasic_Name
from OCP.IGESControl import IGESControl_Controller, IGESControl_Writer
from OCP.IGESData import IGESData_IGESEntity, IGESData_IGESWriter
from OCP.IGESSolid import IGESSolid, IGESSolid_Face, IGESSolid_ManifoldSolid
from OCP.TCollection import TCollection_HAsciiString
from OCP.TopoDS import TopoDS_Shape
from OCP.TopTools import TopTools_FormatVersion

from thbcad.cad.exchange.step_writing import printed, silence
from thbcad.lens import Product

STAMP = "20000101.000000"
FACES, SOLID = 0, 1  # modes of OCCT's writer: loose trimmed surfaces, or a solid as entity 186


def iges_text(shape: TopoDS_Shape, mode: int, product: Product, face_names: Sequence[str] = ()) -> bytes:
    """Return a shape as an IGES file in mm; the same shape gives the same bytes.

    mode : FACES or SOLID.  product : its name, author and organization stand in the file, in ASCII, "?" for
        other characters.
    face_names : of the faces of a SOLID in their order.

    Raises
    ------
    RuntimeError : OCCT refuses the shape.
    """
    IGESControl_Controller.Init_s()
    silence()
    writer = IGESControl_Writer("MM", mode)
    if not writer.AddShape(shape):
        raise RuntimeError(f"OCCT could not translate {product.name} to IGES")
    writer.ComputeModel()
    model = writer.Model()
    if face_names:
        entities = [model.Value(k) for k in range(1, model.NbEntities() + 1)]
        for solid in (e for e in entities if isinstance(e, IGESSolid_ManifoldSolid)):
            _name(writer, solid, product.name)
        faces = [e for e in entities if isinstance(e, IGESSolid_Face)]
        for face, name in zip(faces, face_names, strict=True):
            _name(writer, face, name)
    head = model.GlobalSection()
    for setter, value in (
        (head.SetAuthorName, product.author),
        (head.SetCompanyName, product.organization),
        (head.SetFileName, product.name),
        (head.SetSendName, "thbcad"),
    ):
        setter(_ascii(value))
    for setter in (head.SetDate, head.SetLastChangeDate):
        setter(TCollection_HAsciiString(STAMP))
    model.SetGlobalSection(head)
    return printed(IGESData_IGESWriter(model), IGESSolid.Protocol_s())


def brep_text(shape: TopoDS_Shape) -> bytes:
    """Return a shape as a BREP file."""
    buffer = io.BytesIO()
    BRepTools.Write_s(shape, buffer, False, False, TopTools_FormatVersion.TopTools_FormatVersion_VERSION_1)
    return buffer.getvalue()


def _name(writer: IGESControl_Writer, entity: IGESData_IGESEntity, name: str) -> None:
    """Name an entity: a name property (entity 406, form 15) and, of 8 characters, the label."""
    property_ = IGESBasic_Name()
    property_.Init(1, _ascii(name))
    entity.AddProperty(property_)
    writer.AddEntity(property_)
    entity.SetLabel(_ascii(name[:8]))


def _ascii(text: str) -> TCollection_HAsciiString:
    return TCollection_HAsciiString(text.encode("ascii", "replace").decode("ascii"))
