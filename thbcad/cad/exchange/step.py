"""STEP files of lenses: written with every digit, read back as splines.

Poles and knots read back bit for bit.  The time stamp is fixed: the same lens gives the same bytes.
Faces have names and colours, the solid has a material.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from OCP.APIHeaderSection import APIHeaderSection_MakeHeader
from OCP.Quantity import Quantity_Color, Quantity_TOC_sRGB
from OCP.StepBasic import StepBasic_DerivedUnitElement, StepBasic_SiUnitAndMassUnit
from OCP.STEPCAFControl import STEPCAFControl_Controller, STEPCAFControl_Writer
from OCP.STEPControl import STEPControl_AsIs, STEPControl_Reader
from OCP.StepRepr import StepRepr_NextAssemblyUsageOccurrence
from OCP.StepShape import StepShape_AdvancedFace
from OCP.TDataStd import TDataStd_Name
from OCP.TDF import TDF_Label
from OCP.TDocStd import TDocStd_Document
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Shape
from OCP.XCAFDoc import XCAFDoc_ColorSurf, XCAFDoc_DocumentTool, XCAFDoc_Material, XCAFDoc_ShapeTool

from thbcad.cad.exchange.occt_texts import (
    SETTINGS,
    ascii_string,
    extended_string,
    model_text,
    occt_settings,
    silence,
)
from thbcad.cad.exchange.reading import faces_of, step_document
from thbcad.cad.exchange.solid_file import SolidFile, solid_file
from thbcad.cad.occt_names import Labels
from thbcad.cad.shapes import Part, lens_part
from thbcad.checks import require_type, shown
from thbcad.lens import Lens, Product, face_colour, require_line

if TYPE_CHECKING:
    from thbcad.moulds import Made

SCHEMAS = {"AP242": "AP242DIS", "AP214": "AP214IS"}  # that are written
SCHEMA_STARTS = {
    "AP242": "AP242_MANAGED_MODEL_BASED_3D_ENGINEERING",
    "AP214": "AUTOMOTIVE_DESIGN",
    "AP203": "CONFIG_CONTROL_DESIGN",
}


def step_bytes(solid: Made, product: Product | None = None, schema: str = "AP242") -> bytes:
    """Return the STEP file of a lens or of its body, one closed solid with names and colours, in mm.

    product, schema : as `thbcad.write_step`, which also raises.  The same lens gives the same bytes.
    """
    return part_step(part_of(solid), product_of(solid, product), schema)


def part_of(solid: Made) -> Part:
    """Return a lens, its body or a plate as a Part."""
    if isinstance(solid, Lens):
        return lens_part(solid)
    from thbcad.cad.shapes import moulded_part, plate_part  # plain lenses need none of their walls
    from thbcad.moulds import Plate  # nor of its proofs

    return plate_part(solid) if isinstance(solid, Plate) else moulded_part(solid)


def product_of(solid: Made, product: Product | None) -> Product:
    """Return the Product of a file of a lens; None is Product().  A material without an index gets that of
    the lens; the blank of a mirror, of index 1, has none."""
    product = Product() if product is None else product
    require_type("product", product, Product)
    unsaid = product.material and product.index is None and solid.index != 1
    return replace(product, index=solid.index) if unsaid else product


def part_step(
    part: Part, product: Product, schema: str = "AP242", placement: TopLoc_Location | None = None
) -> bytes:
    """Return the STEP file of a Part in mm; the same part gives the same bytes.

    placement : from the frame of the part to that of the file, where they differ; the file is then an
        assembly of the one part, whose numbers stay those of its own frame.

    Faces are named, where they have a name, and coloured; a material stands with its density in g/cm^3 and,
    as its description, "refractive index 1.5".

    Raises ValueError : another schema than AP242 and AP214; a name of a face that is not one line.
    Raises RuntimeError : OCCT refuses the solid.
    """
    if schema not in SCHEMAS:
        raise ValueError(f"schema must be {', '.join(SCHEMAS)}, got {shown(schema)}")
    for name in part.names:
        require_line("the name of a face", name)
    silence()
    STEPCAFControl_Controller.Init_s()  # makes the settings
    document = _document(part, product, placement)
    settings = {**SETTINGS, "write.stepcaf.subshapes.name": "1", "write.step.schema": SCHEMAS[schema]}
    if placement is not None:
        settings["write.step.assembly"] = "1"  # else OCCT moves every number instead of the part
    with occt_settings(settings):
        writer = STEPCAFControl_Writer()  # takes the schema when it is made
        if not writer.Transfer(document, STEPControl_AsIs):
            raise RuntimeError(f"OCCT could not translate {product.name} to STEP")
    model = writer.ChangeWriter().Model()
    special = product.density > 0 or placement is not None  # else there is neither among the many points
    for entity in [model.Value(number) for number in range(1, model.NbEntities() + 1) if special]:
        if isinstance(entity, StepBasic_DerivedUnitElement):  # of the density, which OCCT gives in g^3 cm^2
            entity.SetExponent(1.0 if isinstance(entity.Unit(), StepBasic_SiUnitAndMassUnit) else -3.0)
        if isinstance(entity, StepRepr_NextAssemblyUsageOccurrence):  # which OCCT counts in the process
            entity.SetId(ascii_string("1"))
    return model_text(model, product)


def read_step(path: str | Path) -> SolidFile:
    """Read a STEP file with a lens solid; lengths are converted to mm.

    Raises OSError : the file cannot be read.
    Raises ValueError : it is no STEP file or damaged, or does not hold two optical faces.
    """
    path = Path(path)
    silence()
    reader, document = step_document(path)
    shape = reader.OneShape()
    solid = solid_file(shape, path, _face_names(reader, shape))
    labels, materials = Labels(), Labels()
    name, material = TDataStd_Name(), XCAFDoc_Material()
    XCAFDoc_DocumentTool.ShapeTool_s(document.Main()).GetFreeShapes(labels)
    labels = _lone_part(labels)
    XCAFDoc_DocumentTool.MaterialTool_s(document.Main()).GetMaterialLabels(materials)
    header = APIHeaderSection_MakeHeader(reader.WS().Model())
    schema = header.SchemaIdentifiersValue(1).ToCString() if header.NbSchemaIdentifiers() else ""
    return replace(
        solid,
        product=name.Get().ToExtString() if _found(labels, name) else "",
        author=header.AuthorValue(1).ToCString() if header.NbAuthor() else "",
        organization=header.OrganizationValue(1).ToCString() if header.NbOrganization() else "",
        schema=next((name for name, start in SCHEMA_STARTS.items() if schema.startswith(start)), schema),
        material=material.GetName().ToCString() if _found(materials, material) else "",
    )


def _document(part: Part, product: Product, placement: TopLoc_Location | None) -> TDocStd_Document:
    """Return a document that holds the solid with its name and material, its placement, and the faces with
    their names and colours."""
    document = TDocStd_Document(extended_string("XmlXCAF"))
    main = document.Main()
    shapes = XCAFDoc_DocumentTool.ShapeTool_s(main)
    colours = XCAFDoc_DocumentTool.ColorTool_s(main)
    label = shapes.AddShape(part.solid, False)
    TDataStd_Name.Set_s(label, extended_string(product.name))
    for name, face in zip(product.named(part.names), part.faces, strict=True):
        sub = shapes.AddSubShape(label, face)
        if name:
            TDataStd_Name.Set_s(sub, extended_string(name))
        colours.SetColor(sub, Quantity_Color(*face_colour(name), Quantity_TOC_sRGB), XCAFDoc_ColorSurf)
    if product.material:
        note = "" if product.index is None else f"refractive index {product.index}"
        words = product.material, note, "density", "POSITIVE_RATIO_MEASURE"
        texts = [*map(ascii_string, words)]
        XCAFDoc_DocumentTool.MaterialTool_s(main).SetMaterial(label, *texts[:2], product.density, *texts[2:])
    if placement is not None:
        assembly = shapes.NewShape()
        TDataStd_Name.Set_s(assembly, extended_string(f"{product.name} in its place"))
        TDataStd_Name.Set_s(shapes.AddComponent(assembly, label, placement), extended_string(product.name))
        shapes.UpdateAssemblies()
    return document


def _face_names(reader: STEPControl_Reader, shape: TopoDS_Shape) -> tuple[str, ...]:
    """Return the names of the entities from which the faces of a shape come, wherever it lies."""
    origin, here = reader.WS().TransferReader(), TopLoc_Location()
    entities = [origin.EntityFromShapeResult(face.Located(here), 1) for face in faces_of(shape)]
    names = (e.Name() if isinstance(e, StepShape_AdvancedFace) else None for e in entities)
    return tuple("" if name is None else name.ToCString() for name in names)


def _lone_part(labels: Labels) -> Labels:
    """Return the label of the one part of an assembly, which stands for its place, and other labels as they
    are."""
    placed, part, lone = Labels(), TDF_Label(), Labels()
    if labels.Length() == 1:
        XCAFDoc_ShapeTool.GetComponents_s(labels.Value(1), placed, False)
    if placed.Length() != 1 or not XCAFDoc_ShapeTool.GetReferredShape_s(placed.Value(1), part):
        return labels
    lone.Append(part)
    return lone


def _found(labels: Labels, attribute: TDataStd_Name | XCAFDoc_Material) -> bool:
    """Set the attribute to that of the first label; return whether there is one."""
    # to look for an attribute that is not there ends the process
    return (
        labels.Length() > 0
        and labels.Value(1).IsAttribute(attribute.ID())
        and labels.Value(1).FindAttribute(attribute.ID(), attribute)
    )
