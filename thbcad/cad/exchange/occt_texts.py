"""STEP, IGES and BREP text from OCCT models: process-wide settings, silence, every number as the shortest
text, or with every digit, that reads back to the same bits.

Text beyond ASCII is encoded in STEP as ISO 10303-21 wants it.
"""

import io
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from OCP.APIHeaderSection import APIHeaderSection_MakeHeader
from OCP.BRepTools import BRepTools
from OCP.IFSelect import IFSelect_RetDone
from OCP.IGESBasic import IGESBasic_Name
from OCP.IGESControl import IGESControl_Controller, IGESControl_Writer
from OCP.IGESData import IGESData_IGESEntity, IGESData_IGESWriter
from OCP.IGESSolid import IGESSolid, IGESSolid_Face, IGESSolid_ManifoldSolid
from OCP.Interface import Interface_InterfaceModel, Interface_Protocol, Interface_Static
from OCP.Message import Message
from OCP.StepAP214 import StepAP214
from OCP.StepBasic import StepBasic_Product
from OCP.STEPControl import STEPControl_AsIs, STEPControl_Writer
from OCP.StepData import StepData_StepWriter
from OCP.TCollection import TCollection_ExtendedString, TCollection_HAsciiString
from OCP.TopoDS import TopoDS_Shape
from OCP.TopTools import TopTools_FormatVersion

from thbcad.lens import Product

STAMP = "2000-01-01T00:00:00"
REALS = "%#.17G"  # every float64 reads back bit for bit
SETTINGS = {
    "write.step.schema": "AP214IS",
    "write.step.unit": "MM",
    "write.step.assembly": "0",
    "write.surfacecurve.mode": "1",
    "xstep.cascade.unit": "MM",
}
REAL = r"-?\d+\.\d*(?:E[+-]\d+)?"
POINT = rf"CARTESIAN_POINT\(''\s*,\s*\(\s*({REAL})\s*,\s*({REAL})\s*,\s*({REAL})\s*\)\s*\)"
STRING = r"'(?:[^']|'')*'"
# a point, a text, a number, the blanks that begin a line, the blanks around "="
TOKEN = re.compile(rf" = (?:{POINT})?|{STRING}|{REAL}|\n +")
BEYOND_ASCII = re.compile(r"[^\x20-\x7e]+")
BACKSLASH = "\ufdd0"  # a noncharacter, as placeholder: OCCT 7.9 takes backslashes for control directives


@contextmanager
def occt_settings(values: dict[str, str]) -> Iterator[None]:
    """Set OCCT's process-wide parameters for a while."""
    before = {name: Interface_Static.CVal_s(name) for name in values}
    for name, value in values.items():
        Interface_Static.SetCVal_s(name, value)
    try:
        yield
    finally:
        for name, value in before.items():
            Interface_Static.SetCVal_s(name, value)


def silence() -> None:
    """Keep OCCT's transfer statistics off stdout."""
    Message.DefaultMessenger_s().ChangePrinters().Clear()


def step_text(shape: TopoDS_Shape, product: str) -> bytes:
    """Return the STEP file of a shape in mm, under the name `product`; the same shape gives the same
    bytes."""
    silence()
    STEPControl_Writer()  # the settings exist only once a writer has been made
    with occt_settings(SETTINGS):
        writer = STEPControl_Writer()  # takes the schema when it is made
        if writer.Transfer(shape, STEPControl_AsIs) != IFSelect_RetDone:
            raise RuntimeError(f"OCCT could not translate the {product} to STEP")
    model = writer.Model()
    for entity in [model.Value(number) for number in range(1, model.NbEntities() + 1)]:
        if isinstance(entity, StepBasic_Product):  # without the counter that OCCT appends
            entity.SetId(ascii_string(product))
            entity.SetName(ascii_string(product))
    return model_text(model, Product(product))


def extended_string(text: str) -> TCollection_ExtendedString:
    """Return a text as an OCCT string, with placeholders for backslashes until `compact` writes them."""
    return TCollection_ExtendedString(text.replace("\\", BACKSLASH), True)  # of UTF-8


def ascii_string(text: str) -> TCollection_HAsciiString:
    """Return a text as a UTF-8 string of OCCT, with the same placeholders as `extended_string`."""
    return TCollection_HAsciiString(text.replace("\\", BACKSLASH))


def model_text(model: Interface_InterfaceModel, product: Product) -> bytes:
    """Return the file of an OCCT STEP model under the names of a Product, with a fixed time stamp."""
    header = APIHeaderSection_MakeHeader(model)
    header.SetName(ascii_string(product.name))
    header.SetTimeStamp(TCollection_HAsciiString(STAMP))
    header.SetAuthorValue(1, ascii_string(product.author))
    header.SetOrganizationValue(1, ascii_string(product.organization))
    header.SetOriginatingSystem(TCollection_HAsciiString("thbcad"))
    schema = header.SchemaIdentifiersValue(1).ToCString()
    # OCCT sets a dot behind the name of AP242, which is no part of it
    header.SetSchemaIdentifiersValue(1, TCollection_HAsciiString(schema.replace(". {", " {")))
    return compact(printed(StepData_StepWriter(model), StepAP214.Protocol_s()).decode("utf-8")).encode(
        "ascii"
    )


def printed(writer: StepData_StepWriter | IGESData_IGESWriter, protocol: Interface_Protocol) -> bytes:
    """Return what OCCT prints of a model, with every digit."""
    writer.FloatWriter().SetFormat(REALS)
    writer.SendModel(protocol)
    buffer = io.BytesIO()
    if not writer.Print(buffer):
        raise RuntimeError("OCCT could not print the file")
    return buffer.getvalue()


def compact(text: str) -> str:
    """Return OCCT's STEP text in its shortest form: the numbers keep their bits, the texts are as ISO
    10303-21 edition 3 wants them."""
    known = _ShortestTexts()

    def shorter(token: re.Match[str]) -> str:
        whole = token[0]
        if whole[0] == " ":
            point = ",".join(known[float(x)] for x in token.groups() if x)
            return f"=CARTESIAN_POINT('',({point}))" if point else "="
        if whole[0] == "'":
            # OCCT breaks long texts into lines, which are no part of them
            return BEYOND_ASCII.sub(_encoded, whole.replace("\n", "").replace(BACKSLASH, r"\\"))
        return "\n" if whole[0] == "\n" else known[float(whole)]

    return TOKEN.sub(shorter, text)


class _ShortestTexts(dict[float, str]):
    """The shortest text of a real that reads back to the same bits, but for -0.0, which is 0."""

    def __missing__(self, value: float) -> str:
        mantissa, _, exponent = repr(value).partition("e")
        shortest = mantissa.removesuffix("0") if mantissa.endswith(".0") else mantissa
        shortest = "0." if shortest == "-0." else shortest
        if exponent:
            shortest += f"{'' if '.' in shortest else '.'}E{int(exponent)}"
        self[value] = shortest
        return shortest


def _encoded(beyond: re.Match[str]) -> str:
    """Return characters beyond ASCII as the hexadecimal numbers between control directives: 4 digits each, or
    8 where that is too few."""
    wide = max(beyond[0]) > "\uffff"
    digits = "".join(f"{ord(c):0{8 if wide else 4}X}" for c in beyond[0])
    return f"\\X{4 if wide else 2}\\{digits}\\X0\\"


IGES_STAMP = "20000101.000000"
FACES, SOLID = 0, 1  # modes of OCCT's writer: loose trimmed surfaces, or a solid as entity 186


def iges_text(shape: TopoDS_Shape, mode: int, product: Product, face_names: Sequence[str] = ()) -> bytes:
    """Return a shape as an IGES file in mm; the same shape gives the same bytes.

    mode : FACES or SOLID.  product : its name, author and organization stand in the file, in ASCII, "?" for
        other characters.
    face_names : of the faces of a SOLID in their order.
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
    head.SetAuthorName(_ascii(product.author))
    head.SetCompanyName(_ascii(product.organization))
    head.SetFileName(_ascii(product.name))
    head.SetSendName(_ascii("thbcad"))
    head.SetDate(_ascii(IGES_STAMP))
    head.SetLastChangeDate(_ascii(IGES_STAMP))
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
