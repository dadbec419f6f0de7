"""Files from OCCT shapes: process-wide settings, silence, STEP text with every digit."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from OCP.APIHeaderSection import APIHeaderSection_MakeHeader
from OCP.IFSelect import IFSelect_RetDone
from OCP.Interface import Interface_InterfaceModel, Interface_Static
from OCP.Message import Message
from OCP.StepAP214 import StepAP214
from OCP.StepBasic import StepBasic_Product
from OCP.STEPControl import STEPControl_AsIs, STEPControl_Writer
from OCP.StepData import StepData_StepWriter
from OCP.TCollection import TCollection_HAsciiString

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Shape

STAMP = "2000-01-01T00:00:00"
REALS = "%#.17G"  # every float64 reads back bit for bit
SETTINGS = {
    "write.step.schema": "AP214IS",
    "write.step.unit": "MM",
    "write.step.assembly": "0",
    "write.surfacecurve.mode": "0",
    "xstep.cascade.unit": "MM",
}


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
    """Return the STEP file of a shape in mm, under the name `product`; the same shape gives the same bytes.

    Raises
    ------
    RuntimeError : OCCT refuses the shape.
    """
    silence()
    STEPControl_Writer()  # the settings exist only once a writer has been made
    with occt_settings(SETTINGS):
        writer = STEPControl_Writer()  # takes the schema when it is made
        if writer.Transfer(shape, STEPControl_AsIs) != IFSelect_RetDone:
            raise RuntimeError(f"OCCT could not translate the {product} to STEP")
    model = writer.Model()
    _name_product(model, product)
    header = APIHeaderSection_MakeHeader(model)
    header.SetName(TCollection_HAsciiString(product))
    header.SetTimeStamp(TCollection_HAsciiString(STAMP))
    header.SetAuthorValue(1, TCollection_HAsciiString(""))
    header.SetOrganizationValue(1, TCollection_HAsciiString(""))
    header.SetOriginatingSystem(TCollection_HAsciiString("thbcad"))
    text = StepData_StepWriter(model)
    text.FloatWriter().SetFormat(REALS)
    text.SendModel(StepAP214.Protocol_s())
    buffer = io.BytesIO()
    if not text.Print(buffer):
        raise RuntimeError("OCCT could not print the STEP file")
    return buffer.getvalue()


def _name_product(model: Interface_InterfaceModel, product: str) -> None:
    """Give the product a name without the counter that OCCT appends."""
    for number in range(1, model.NbEntities() + 1):
        entity = model.Value(number)
        if isinstance(entity, StepBasic_Product):
            entity.SetId(TCollection_HAsciiString(product))
            entity.SetName(TCollection_HAsciiString(product))
