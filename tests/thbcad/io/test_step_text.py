"""STEP files read from their text: bit for bit what OCCT reads, and a sentence for every kind of damage."""

import re

import numpy as np
import pytest
from hypothesis import given, strategies as st
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox

from tests.cases import python
from tests.thbcad.cad.exchange.cases import CURVES, REFINED, SURFACES, assert_same
from tests.thbcad.cases import LENSES, assert_same_surface, bits
from tests.thbcad.io.cases import rational_torus, written
from thbcad import write_step
from thbcad.cad.exchange import read_faces, read_step, step_bytes, write_curves, write_faces
from thbcad.cad.shapes import lens_solid
from thbcad.io.brep_records import MILLIMETRE
from thbcad.io.step_brep import brep_of_text, length_unit, parse_brep
from thbcad.io.step_text import (
    MOST_NESTED,
    Enumeration,
    Reference,
    Typed,
    entities_of_text,
    having,
    header_of_text,
    read_part21,
)
from thbcad.io.step_values import curve_of, points_of, spline_surface
from thbcad.lens import Product, optical_forms
from thbcad.sags import patch_numbers
from thbcad.splines import BSplineSurface, NURBSCurve, NURBSSurface

HEAD = "ISO-10303-21;\nHEADER;\nFILE_NAME('a; ENDSEC;','');\nENDSEC;\nDATA;\n"
TAIL = "ENDSEC;\nEND-ISO-10303-21;\n"
TABLE63 = step_bytes(LENSES["table63"]).decode()
PLANO = step_bytes(LENSES["plano"]).decode()


def read(body):
    return entities_of_text(HEAD + body + TAIL)


# ---- the grammar ----


def test_points_are_read_together_whatever_their_names_and_blanks():
    entities = read(
        "#1=CARTESIAN_POINT('',(1.,-2.5E-3,3.));"
        "#2 = CARTESIAN_POINT ( '7.;(8.,''9.)' , ( 1.E+2 ,\n0. , +4.5 ) ) ;"
        "#3=CARTESIAN_POINT('',(1.,2.));#4=A(#1,#2,#3);"
    )
    both, user = [Reference(k) for k in (1, 2)], entities[4]
    assert points_of(entities, both, user).tolist() == [[1.0, -2.5e-3, 3.0], [100.0, 0.0, 4.5]]
    assert points_of(entities, [], user).shape == (0, 3)
    with pytest.raises(ValueError, match="#3 must be a CARTESIAN_POINT of three reals"):
        points_of(entities, [*both, Reference(3)], user)
    with pytest.raises(ValueError, match="#4 must refer to an entity of the file"):
        points_of(entities, [*both, Reference(5)], user)


def test_every_kind_of_parameter():
    (entity,) = read(
        "#7 = A_B2('it''s; #9',-3,+1.5E-3,2.,.MILLI.,$,*,#7,(#7,(),(1.,2)),LENGTH(1.E2));\n"
    ).values()
    assert entity.number == 7
    (values,) = entity.parts.values()
    assert values == [
        "it's; #9",
        -3,
        1.5e-3,
        2.0,
        "MILLI",
        None,
        None,
        7,
        [7, [], [1.0, 2]],
        Typed("LENGTH", [100.0]),
    ]
    assert [type(v) for v in values[1:4]] == [int, float, float]
    assert isinstance(values[4], Enumeration)
    assert isinstance(values[7], Reference)


def test_a_complex_entity_has_several_types():
    (entity,) = read("#1 = ( LENGTH_UNIT() NAMED_UNIT(*)\n SI_UNIT(.MILLI.,.METRE.) );").values()
    assert entity.parts == {"LENGTH_UNIT": [], "NAMED_UNIT": [None], "SI_UNIT": ["MILLI", "METRE"]}


def test_comments_and_spaces_count_for_nothing():
    entities = read("/* #1 = A(; */#1=A ( 'a /* b */' , /* it's\n */ #2 ) ;  #2\n=\nB( );")
    assert [e.parts for e in entities.values()] == [{"A": ["a /* b */", 2]}, {"B": []}]


def test_names_in_strings_are_no_types():
    entities = read("#1 = A('PRODUCT #5');#2 = PRODUCT('x');")
    assert [e.number for e in having(entities, "PRODUCT")] == [2]


@pytest.mark.parametrize(
    ("written", "said"),
    [
        (r"J\X2\00FC\X0\rgen", "J\u00fcrgen"),
        (r"\X2\900F955C\X0\)", "\u900f\u955c)"),
        (r"\X4\0001F600\X0\.", "\U0001f600."),
        (r"\X2\D83DDE00\X0\.", "\U0001f600."),
        (r"\X2\D83D\X0\!", "\ufffd!"),
        (r"\X\FC ber", "\u00fc ber"),
        (r"\PA\\S\|", "\u00fc"),
        (r"Optik \\ GmbH", "Optik \\ GmbH"),
        (r"\\X2\\00FC", r"\X2\00FC"),
        (r"\X2\00F", r"\X2\00F"),
        ("it''s", "it's"),
        ("two\r\n lines", "two lines"),
    ],
)
def test_strings_say_what_their_directives_mean(written, said):
    """ISO 10303-21, 6.4.3; a line end is no part of a string, a broken directive is left as it is."""
    (entity,) = read(f"#1 = A('{written}');").values()
    assert entity.parts == {"A": [said]}


@pytest.mark.parametrize("schema", ["AP242", "AP214"])
def test_the_words_of_a_product_read_back(schema):
    product = Product("Linse '\u00e4' (\u900f\u955c)", "J\u00fcrgen O'Neill", "Optik \\ GmbH", "PMMA", 1.19)
    solid = brep_of_text(step_bytes(LENSES["plano"], product, schema).decode("ascii"))
    assert solid.name == product.name
    labels = ("name", "author", "organization", "material", "density")
    assert {label: solid.labels[label] for label in labels} == {
        "name": (product.name,),
        "author": (product.author,),
        "organization": (product.organization,),
        "material": ("PMMA", "refractive index 1.5"),
        "density": ("1.19", "density"),
    }
    starts = {"AP242": "AP242_MANAGED", "AP214": "AUTOMOTIVE_DESIGN"}
    assert solid.labels["schema"][0].startswith(starts[schema])


def test_the_header_is_read_with_comments_and_semicolons_in_it():
    header = header_of_text(HEAD.replace("HEADER;", "HEADER; /* FILE_NAME('b'); */") + TAIL)
    assert header == {"FILE_NAME": ["a; ENDSEC;", ""]}
    with pytest.raises(ValueError, match="the header does not follow the grammar"):
        header_of_text(HEAD.replace("FILE_NAME(", "FILE_NAME") + TAIL)


def test_the_name_of_a_schema_has_no_dot():
    """OCCT's own writer sets one behind that of AP242."""
    schemas = {re.search(r"FILE_SCHEMA\(\(\s*'([^']*)'", text)[1] for text in (TABLE63, PLANO)}
    assert schemas == {"AP242_MANAGED_MODEL_BASED_3D_ENGINEERING_MIM_LF {1 0 10303 442 1 1 4 }"}


BROKEN = [
    *(
        "",
        "A",
        "A(",
        "A(1",
        "A(1,)",
        "A(,1)",
        "A(1 2)",
        "A)",
        "A(1)B(2)",
        "(A(1)",
        "()",
        "(A() A())",
        "a(1)",
        "A(1.)) ",
    ),
    *("A(1.5e3)", "A(1E3)", "A(nan)", "A(0x1)", "A(1_0.0)", "A(.T)", "A('a)", "A(#)", f"A({'1' * 16})"),
    *("A(" * n + ")" * n for n in (40, MOST_NESTED + 3)),
    *("A(" + "(" * n + ")" * n + ")" for n in (40, MOST_NESTED + 1)),
]


@pytest.mark.parametrize("body", BROKEN)
def test_text_that_breaks_the_grammar_is_refused(body):
    with pytest.raises(ValueError, match=r"grammar|cut off"):
        [e.parts for e in read(f"#1 = {body};").values()]


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "head"),
        ("STEP;", "head"),
        (HEAD, "after entity #0"),
        (HEAD + "#1 = A();" + TAIL[:8], "after entity #1"),
        (HEAD + "#1 = A();" + TAIL + "#", "after entity #1"),
        (HEAD + "#1 = A(); A(); #2 = A();" + TAIL, "after entity #1"),
        (HEAD + "#1 = A(); #1 = A();" + TAIL, "#1 stands twice"),
        (HEAD + "#1 = A(#2,#44);#2 = A('#5');" + TAIL, "lacks entity #44"),
        (HEAD + "#1 = A(#" + "9" * 9999 + ");" + TAIL, "lacks entity"),
    ],
)
def test_a_file_that_is_not_whole_is_refused(text, sentence):
    with pytest.raises(ValueError, match=sentence):
        entities_of_text(text)


@pytest.mark.parametrize(
    "body",
    ["'" * 20001, "#1 = A(" + "'a;" * 20000, "#1=" + "/*" * 20000, "#1 = A(" + "1" * 50000, "#" * 50000],
)
def test_hopeless_text_is_refused_at_once(body):
    """Regular expressions that step back would take hours here."""
    with pytest.raises(ValueError, match="cut off"):
        read(body)


def test_what_is_no_file_is_refused(tmp_path):
    with pytest.raises(ValueError, match="is not a file"):
        read_part21("/dev/zero")
    with pytest.raises(FileNotFoundError):
        read_part21(tmp_path / "none.step")


def test_the_reader_is_independent_of_occt():
    program = "import sys, thbcad.io.step_brep; print(*{m.split('.')[0] for m in sys.modules})"
    loaded = python(program, check=True).stdout.split()
    assert "numpy" in loaded
    assert "OCP" not in loaded


# ---- solids ----


@pytest.mark.parametrize("name", LENSES)
def test_the_text_holds_the_very_splines(tmp_path, name):
    """Read from the text, by OCCT, and in memory: the same bits."""
    path = tmp_path / "lens.step"
    write_step(LENSES[name], path)
    solid, step = parse_brep(path), read_step(path)
    assert (solid.name, solid.unit, len(solid.faces), len(solid.edges), solid.unpaired, solid.gaps) == (
        "lens",
        MILLIMETRE,
        6,
        12,
        0,
        0,
    )
    for face, by_occt, own in zip(solid.faces, (step.front, step.rear), optical_forms(LENSES[name])):
        assert_same_surface(by_occt, own)
        if isinstance(own, BSplineSurface):
            assert_same_surface(face.surface, own)
        elif own.kind == "PLANE":
            assert bits(face.plane.ravel() + 0.0) == bits(own.numbers + 0.0)
        elif own.kind == "SPHERE":
            assert bits(face.sphere.ravel()[:10] + 0.0) == bits(own.numbers + 0.0)
        else:
            assert bits(patch_numbers(face.surface) + 0.0) == bits(own.numbers + 0.0)
    for face, other in zip(solid.faces, read_faces(path), strict=True):
        if face.surface is None:
            assert face.surface_type in ("PLANE", "SPHERICAL_SURFACE")
        elif isinstance(other, BSplineSurface):
            assert_same_surface(face.surface, other)


def test_the_text_holds_the_very_loose_surfaces_and_curves(tmp_path):
    """What the writer of STEP shares no code with reads every number that was written."""
    faces, curves = [*SURFACES.values(), REFINED.to_bspline()], list(CURVES.values())
    write_faces([*SURFACES.values(), REFINED], tmp_path / "faces.step")
    write_curves(curves, tmp_path / "curves.step")
    entities = read_part21(tmp_path / "faces.step")
    found = having(entities, "B_SPLINE_SURFACE_WITH_KNOTS")
    assert_same([spline_surface(entities, entity) for entity in found], faces)
    entities = read_part21(tmp_path / "curves.step")
    found = [curve_of(entities, entity) for entity in having(entities, "B_SPLINE_CURVE_WITH_KNOTS")]
    whole = np.ones(())
    assert_same([NURBSCurve(c.kv, c.poles, whole if c.weights is None else c.weights) for c in found], curves)


@pytest.mark.parametrize("unit", ["INCH", "M", "CM", "UM"])
def test_the_unit_is_told(unit, tmp_path):
    """Of a file in any unit, the same lens."""
    wanted = {"INCH": "INCH", "M": "METRE", "CM": "CENTI METRE", "UM": "MICRO METRE"}[unit]
    path = written(lens_solid(LENSES["table63"]), tmp_path / "lens.step", unit)
    assert length_unit(entities_of_text(path.read_text())) == wanted


def test_rational_faces_read_as_occt_reads_them(tmp_path):
    path = rational_torus(tmp_path / "torus.step")
    solid = parse_brep(path)
    rational = 0
    for face, other in zip(solid.faces, read_faces(path), strict=True):
        assert type(face.surface) is type(other)
        assert_same_surface(face.surface, other)
        if isinstance(other, NURBSSurface):
            rational += 1
            assert "RATIONAL_B_SPLINE_SURFACE" in face.surface_type
            np.testing.assert_array_equal(face.surface.weights, other.weights)
    assert rational
    assert solid.unpaired == 0


def test_faces_that_are_no_splines_have_no_surface(tmp_path):
    solid = parse_brep(written(BRepPrimAPI_MakeBox(1.0, 2.0, 3.0).Solid(), tmp_path / "box.step"))
    assert [(f.surface_type, f.surface) for f in solid.faces] == [("PLANE", None)] * 6
    for face in solid.faces:
        assert sorted(abs(face.plane[1])) == [0, 0, 1]
    for edge in solid.edges:
        assert edge.kv is None
        way = edge.ends[1] - edge.ends[0]
        np.testing.assert_array_equal(edge.poles, [edge.ends[0], edge.ends[0] + way / np.linalg.norm(way)])
    assert sorted({tuple(end) for e in solid.edges for end in e.ends.tolist()}) == [
        (x, y, z) for x in (0, 1) for y in (0, 2) for z in (0, 3)
    ]


# ---- damage ----


@given(st.data())
def test_any_entity_removed_is_named(data):
    used = set(re.findall(r"#(\d+)\b(?! ?=)", re.sub("'[^']*'", "", TABLE63)))  # without 'Context #1'
    number = data.draw(st.sampled_from(sorted(used)))
    text = re.sub(rf"(?m)^#{number} ?= ?[^;]*;\n", "", TABLE63)
    assert text != TABLE63
    with pytest.raises(ValueError, match=rf"lacks entity #{number},"):
        entities_of_text(text)
