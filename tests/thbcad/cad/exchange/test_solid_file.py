"""Names, colours and materials in CAD files: written for every schema, read back by OCCT and, in ISO
10303-21, from the text."""

import getpass
import re
import socket
from math import pi

import build123d
import numpy as np
import pytest
from OCP.BRepBuilderAPI import BRepBuilderAPI_Sewing
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeSphere
from OCP.gp import gp_Pnt
from OCP.IGESCAFControl import IGESCAFControl_Reader
from OCP.Quantity import Quantity_Color, Quantity_TOC_sRGB
from OCP.STEPCAFControl import STEPCAFControl_Controller, STEPCAFControl_Reader
from OCP.TCollection import TCollection_ExtendedString
from OCP.TDataStd import TDataStd_Name
from OCP.TDocStd import TDocStd_Document
from OCP.TopAbs import TopAbs_FACE
from OCP.XCAFDoc import (
    XCAFDoc_ColorSurf,
    XCAFDoc_ColorTool,
    XCAFDoc_DocumentTool,
    XCAFDoc_Material,
    XCAFDoc_ShapeTool,
)

from tests.thbcad.cad.shapes.cases import assert_whole
from tests.thbcad.cases import LENSES, assert_holds, assert_same_surface
from thbcad import Conic, FreeformSurface, KnotVector, Lens, THBSpace, THBSurface, write_step
from thbcad.cad.exchange.iges_brep_solids import iges_bytes, read_iges
from thbcad.cad.exchange.occt_texts import occt_settings, silence
from thbcad.cad.exchange.reading import explore, step_shape
from thbcad.cad.exchange.solid_file import SolidState, solid_volume
from thbcad.cad.exchange.step import (
    SCHEMAS,
    part_step,
    read_step,
    step_bytes,
)
from thbcad.cad.occt_names import Labels, as_face
from thbcad.cad.shapes import NAMES, Part, lens_part
from thbcad.io import having, parse_brep, read_part21
from thbcad.lens import Product, face_colour, optical_forms

LENS = LENSES["ruled"]
PRODUCT = Product("Pearl lens", "A. Grinder", "Optics Ltd", "PMMA", 1.19, 1.49)
SCRIPTS = [
    "Linse Ü ß",
    "O'Brien's \\ lens",
    "透镜",
    "😀 x",
    "a\\X2\\00DC\\X0\\b",
    "long " * 40 + "name",
    "#12=1.50;/*c*/",
]


@pytest.fixture(scope="module", params=SCHEMAS)
def written(request, tmp_path_factory):
    """(schema, path) of the lens with all its names."""
    path = tmp_path_factory.mktemp("step") / f"{request.param}.step"
    write_step(LENS, path, PRODUCT, request.param)
    return request.param, path


def decoded(text):
    """Return the characters of a string of ISO 10303-21, 6.4.3: code page directives do not occur."""

    def characters(found):
        wide, digits = found[1], found[2]
        return bytes.fromhex(digits).decode("utf-16-be" if wide == "2" else "utf-32-be")

    parts = re.split(r"(\\\\)", text.replace("''", "'"))
    return "".join(
        "\\" if part == "\\\\" else re.sub(r"\\X([24])\\([0-9A-F]+)\\X0\\", characters, part)
        for part in parts
    )


def labels(sequence):
    return [sequence.Value(k) for k in range(1, sequence.Length() + 1)]


def name(label):
    found = TDataStd_Name()
    return (
        found.Get().ToExtString()
        if label.IsAttribute(found.ID()) and label.FindAttribute(found.ID(), found)
        else ""
    )


def opened(path, reader):
    """Return (document, label of the one solid) as OCCT's reader of names, colours and materials sees a
    file."""
    silence()
    document = TDocStd_Document(TCollection_ExtendedString("XmlXCAF"))
    for mode in ("SetNameMode", "SetColorMode", "SetMatMode"):
        getattr(reader, mode, lambda on: None)(True)
    reader.ReadFile(str(path))
    assert reader.Transfer(document)
    free = Labels()
    XCAFDoc_DocumentTool.ShapeTool_s(document.Main()).GetFreeShapes(free)
    (label,) = labels(free)
    return document, label


@pytest.fixture
def names_of_faces():
    """OCCT reads them only when told."""
    STEPCAFControl_Controller.Init_s()
    with occt_settings({"read.stepcaf.subshapes.name": "1"}):
        yield


# ---- every schema ----


def test_names_read_back(written):
    schema, path = written
    read = read_step(path)
    assert (read.product, read.author, read.organization, read.material) == (
        "Pearl lens",
        "A. Grinder",
        "Optics Ltd",
        "PMMA",
    )
    assert (read.schema, read.face_names) == (schema, NAMES)


def test_the_solid_is_whole_and_bit_exact(written):
    _, path = written
    read = read_step(path)
    assert_whole(read, 6)
    assert read.tolerance == 1e-7
    assert read.volume == pytest.approx(LENS.volume(), rel=1e-6)
    assert_holds(read, LENS)


def test_face_names_stand_at_their_faces(written):
    """By the own reader of the text: the splines of the faces that the file calls front and rear."""
    _, path = written
    entities = read_part21(path)
    named = {
        face.number: entities[face.number].parameters("ADVANCED_FACE", 4)[0]
        for face in parse_brep(path).faces
    }
    assert tuple(named.values()) == NAMES
    for face, own in zip(parse_brep(path).faces, optical_forms(LENS)):
        assert_same_surface(face.surface, own)


def test_an_opener_sees_names_colours_and_material(written, names_of_faces):
    _, path = written
    document, solid = opened(path, STEPCAFControl_Reader())
    assert name(solid) == "Pearl lens"
    faces = Labels()
    XCAFDoc_ShapeTool.GetSubShapes_s(solid, faces)
    assert [name(face) for face in labels(faces)] == list(NAMES)
    for face in labels(faces):
        colour = Quantity_Color()
        assert XCAFDoc_ColorTool.GetColor_s(face, XCAFDoc_ColorSurf, colour)
        rgb = colour.Values(Quantity_TOC_sRGB)
        # float32 inside OCCT
        assert rgb == pytest.approx(face_colour(name(face)), abs=1e-6)
    materials = Labels()
    XCAFDoc_DocumentTool.MaterialTool_s(document.Main()).GetMaterialLabels(materials)
    (label,) = labels(materials)
    material = XCAFDoc_Material()
    assert label.FindAttribute(XCAFDoc_Material.GetID_s(), material)
    assert (material.GetName().ToCString(), material.GetDescription().ToCString()) == (
        "PMMA",
        "refractive index 1.49",
    )
    assert material.GetDensity() == pytest.approx(1.19, rel=1e-15)


def test_the_density_is_in_grams_per_cubic_centimetre(written):
    """OCCT itself writes g^3 cm^2, and reads every exponent as these."""
    entities = read_part21(written[1])
    found = {}
    for element in having(entities, "DERIVED_UNIT_ELEMENT"):
        unit, exponent = element.parameters("DERIVED_UNIT_ELEMENT", 2)
        found[tuple(entities[unit].parameters("SI_UNIT", 2))] = exponent
    assert found == {(None, "GRAM"): 1.0, ("CENTI", "METRE"): -3.0}


def test_build123d_sees_the_name_and_a_colour(written):
    _, path = written
    solid = build123d.import_step(path)
    assert solid.label.replace("_", " ") == "Pearl lens"
    assert solid.color is not None


def test_a_file_names_neither_machine_nor_user_nor_day(written):
    _, path = written
    text = path.read_text("ascii")
    for word in (socket.gethostname(), getpass.getuser()):
        assert f"'{word}" not in text
    assert set(re.findall(r"\d{4}-\d\d-\d\dT[\d:]+", text)) == {"2000-01-01T00:00:00"}
    assert "CALENDAR_DATE" not in text


# ---- texts ----


@pytest.mark.parametrize("schema", SCHEMAS)
@pytest.mark.parametrize("text", SCRIPTS)
def test_texts_of_every_script_read_back(text, schema, tmp_path):
    """By OCCT, and decoded by hand from a file that is ASCII throughout."""
    product = Product(text, text, text, text)
    write_step(LENS, tmp_path / "lens.step", product, schema)
    read = read_step(tmp_path / "lens.step")
    assert (read.product, read.author, read.organization, read.material) == (text, text, text, text)
    written = (tmp_path / "lens.step").read_text("ascii")
    (head,) = re.findall(
        r"FILE_NAME\(\s*('(?:[^']|'')*')\s*,\s*'2000[^']*'\s*,\s*\(\s*('(?:[^']|'')*')", written
    )
    (entity,) = re.findall(r"=PRODUCT\(\s*('(?:[^']|'')*')", written)
    assert [decoded(part[1:-1]) for part in (*head, entity)] == [text] * 3


def test_face_names_of_a_part_read_back(tmp_path):
    part = lens_part(LENS)
    names = ("front Ü", "rear 'b'", "edge 1", "flange", "x", "")
    (tmp_path / "part.step").write_bytes(part_step(Part(part.solid, names, part.faces), Product()))
    assert read_step(tmp_path / "part.step").face_names == names


def test_a_face_name_of_two_lines_is_refused():
    part = lens_part(LENS)
    with pytest.raises(ValueError, match="the name of a face must be one line"):
        part_step(Part(part.solid, ("front\nx", *NAMES[1:]), part.faces), Product())


def test_a_part_of_another_shape_is_written(tmp_path):
    solid = BRepPrimAPI_MakeBox(1.0, 2.0, 3.0).Solid()
    faces = [as_face(face) for face in explore(solid, TopAbs_FACE)]
    (tmp_path / "box.step").write_bytes(
        part_step(Part(solid, [f"edge {k}" for k in range(6)], faces), Product("box"))
    )
    box = build123d.import_step(tmp_path / "box.step")
    assert (box.label, box.volume) == ("box", pytest.approx(6.0))


# ---- material ----


def test_a_material_without_an_index_gets_that_of_the_lens():
    assert b"'refractive index 1.5'" in step_bytes(LENS, Product(material="PMMA"))
    assert b"'refractive index 1.49'" in step_bytes(LENS, Product(material="PMMA", index=1.49))


def test_what_is_unknown_is_not_written(tmp_path):
    assert b"material" not in step_bytes(LENS)
    write_step(LENS, tmp_path / "lens.step", Product(material="PMMA"))
    assert having(read_part21(tmp_path / "lens.step"), "MEASURE_REPRESENTATION_ITEM") == []
    read = read_step(tmp_path / "lens.step")
    assert read.material == "PMMA"


# ---- the same bytes ----


@pytest.mark.parametrize("schema", SCHEMAS)
def test_other_files_in_between_do_not_change_the_bytes(schema, tmp_path):
    first = step_bytes(LENS, PRODUCT, schema)
    for other in SCHEMAS:
        step_bytes(LENSES["plano"], Product("other"), other)
    iges_bytes(LENS)
    (tmp_path / "lens.step").write_bytes(first)
    read_step(tmp_path / "lens.step")
    assert step_bytes(LENS, PRODUCT, schema) == first


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((PRODUCT, "AP209"), "schema must be AP242, AP214, got 'AP209'"),
        (("lens",), "product must be a Product, got str"),
    ],
)
def test_other_arguments_are_refused(arguments, message, tmp_path):
    with pytest.raises(ValueError, match=message):
        write_step(LENS, tmp_path / "lens.step", *arguments)
    assert list(tmp_path.iterdir()) == []


# ---- IGES and BREP ----


def test_iges_has_names(tmp_path):
    path = tmp_path / "lens.igs"
    path.write_bytes(iges_bytes(LENS, Product("Linse für 透镜", "A. Grinder", "Optics Ltd")))
    text = path.read_text("ascii")
    assert re.findall(r"^406,1,\d+H(.*);", text, re.MULTILINE) == ["Linse f?r ??", *NAMES]
    assert all(f"{len(word)}H{word}" in text for word in ("A. Grinder", "Optics Ltd"))
    _, solid = opened(path, IGESCAFControl_Reader())
    assert name(solid) == "Linse f?r ??"
    read = read_iges(path)
    assert (read.valid, read.product, read.face_names) == (True, "", ("",) * 6)


@pytest.mark.parametrize("tolerance", [1e-6, 1e-9])
@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES)
def test_the_volume_keeps_its_tolerance(lens, tolerance, tmp_path):
    """Against the closed form, which holds conics to 1e-11 mm of height."""
    write_step(lens, tmp_path / "lens.step")
    assert solid_volume(read_step(tmp_path / "lens.step").shape, tolerance) == pytest.approx(
        lens.volume(), rel=tolerance
    )


def test_a_box_has_its_volume_wherever_it_lies():
    for corner in (gp_Pnt(0, 0, 0), gp_Pnt(5, -7, 11), gp_Pnt(-1, -1, -1.5)):
        assert solid_volume(BRepPrimAPI_MakeBox(corner, 2.0, 3.0, 4.0).Shape(), 1e-9) == pytest.approx(
            24, rel=1e-13
        )
    assert solid_volume(BRepPrimAPI_MakeSphere(gp_Pnt(1, 2, 3), 2.0).Shape(), 1e-9) == pytest.approx(
        32 / 3 * pi, rel=1e-9
    )


def test_a_rough_lens_keeps_the_tolerance():
    """OCCT's adaptive integral of the whole place vector is off by 1e-6 to 1e-4 on lenses like this one."""
    space = THBSpace(*[KnotVector.uniform(3, 60)] * 2)
    sag = THBSurface(space, 1e-2 * np.random.default_rng(0).standard_normal(space.dim))
    lens = Lens(FreeformSurface((50, 50)), FreeformSurface((50, 50), Conic(-150.0, -1.0), sag), 20.0, 1.5)
    assert solid_volume(lens_part(lens).solid, 1e-6) == pytest.approx(lens.volume(), rel=1e-6)


def test_the_pole_of_a_sphere_is_no_free_edge(tmp_path):
    """A plano-convex lens of another program: the sphere about z has its pole on the rear."""
    solid = build123d.Pos(0, 0, 5) * build123d.Cylinder(5, 10) & build123d.Pos(
        0, 0, -16.5
    ) * build123d.Sphere(20)
    path = tmp_path / "plano.step"
    build123d.export_step(solid, path)
    state = SolidState(step_shape(path))
    assert (state.solids, state.free_edges, state.closed, state.valid) == (1, 0, True, True)
    height = 20 - np.sqrt(20**2 - 5**2)
    cap = pi * height**2 * (20 - height / 3)
    assert state.volume == pytest.approx(pi * 25 * (3.5 - height) + cap, rel=1e-6)
    faces = explore(state.shape, TopAbs_FACE)
    without_one = []
    for left_out in faces:
        shell = BRepBuilderAPI_Sewing()
        for face in (face for face in faces if face is not left_out):
            shell.Add(face)
        shell.Perform()
        without_one.append(SolidState(shell.SewedShape()).free_edges)
    assert sorted(without_one) == [1, 1, 2]
