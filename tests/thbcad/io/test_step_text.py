"""STEP files read from their text: bit for bit what OCCT reads, and a sentence for every kind of damage."""

import re
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, strategies as st
from OCP.BRepBuilderAPI import BRepBuilderAPI_NurbsConvert
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder, BRepPrimAPI_MakeTorus

from tests.cases import ROOT
from tests.thbcad.cases import LENSES, assert_same_surface, bits
from tests.thbcad.io.cases import written
from thbcad.cad.exchange import read_faces, read_step, step_bytes, write_step
from thbcad.cad.shapes import lens_solid
from thbcad.io.brep_records import MILLIMETRE
from thbcad.io.step_brep import brep, brep_of_text, length_unit, parse_brep
from thbcad.io.step_text import (
    MOST_NESTED,
    REAL,
    Enumeration,
    Reference,
    Typed,
    entities_of_text,
    having,
    header_of_text,
    read_part21,
)
from thbcad.lens import Product, optical_forms
from thbcad.sags import patch_numbers
from thbcad.splines import BSplineSurface, NURBSSurface

HEAD = "ISO-10303-21;\nHEADER;\nFILE_NAME('a; ENDSEC;','');\nENDSEC;\nDATA;\n"
TAIL = "ENDSEC;\nEND-ISO-10303-21;\n"
TABLE63 = step_bytes(LENSES["table63"]).decode()
PLANO = step_bytes(LENSES["plano"]).decode()


def read(body):
    return entities_of_text(HEAD + body + TAIL)


def solid_of(text):
    return brep(entities_of_text(text))


# ---- the grammar ----


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


@pytest.mark.parametrize("schema", ["AP242", "AP214", "AP203"])
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
    starts = {"AP242": "AP242_MANAGED", "AP214": "AUTOMOTIVE_DESIGN", "AP203": "CONFIG_CONTROL_DESIGN"}
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
    loaded = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.split()
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


@pytest.mark.parametrize("unit", ["INCH", "M", "CM", "UM"])
def test_the_unit_is_told(unit, tmp_path):
    """OCCT writes the same lens in other units."""
    wanted = {"INCH": "INCH", "M": "METRE", "CM": "CENTI METRE", "UM": "MICRO METRE"}[unit]
    path = written(lens_solid(LENSES["table63"]), tmp_path / "lens.step", unit)
    assert length_unit(entities_of_text(path.read_text())) == wanted


def test_rational_faces_read_as_occt_reads_them(tmp_path):
    """A quarter of a torus as NURBS: complex entities, with weights."""
    torus = BRepPrimAPI_MakeTorus(10.0, 3.0, 0.5, 1.25, 1.5).Shape()
    path = written(BRepBuilderAPI_NurbsConvert(torus, True).Shape(), tmp_path / "torus.step")
    solid = parse_brep(path)
    rational = 0
    for face, other in zip(solid.faces, read_faces(path), strict=True):
        assert type(face.surface) is type(other)
        points = [s.points if isinstance(s, NURBSSurface) else s.coefficients for s in (face.surface, other)]
        np.testing.assert_array_equal(*points)
        np.testing.assert_array_equal(face.surface.kv_u.knots, other.kv_u.knots)
        np.testing.assert_array_equal(face.surface.kv_v.knots, other.kv_v.knots)
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


@pytest.mark.parametrize("text", [TABLE63, PLANO], ids=["ruled", "planar"])
@pytest.mark.parametrize("tenth", range(10))
def test_a_file_cut_off_at_every_tenth_is_refused(tmp_path, text, tenth):
    path = tmp_path / "lens.step"
    path.write_text(text[: len(text) * tenth // 10])
    with pytest.raises(ValueError, match=r"lens\.step is not a whole STEP file"):
        parse_brep(path)


@pytest.mark.slow
@given(st.integers(0, len(TABLE63.rstrip()) - 1))
def test_a_file_cut_off_anywhere_is_refused(end):
    with pytest.raises(ValueError, match=r"head|cut off"):
        entities_of_text(TABLE63[:end])


@pytest.mark.slow
@given(
    st.lists(
        st.tuples(st.integers(0, len(PLANO) - 1), st.sampled_from("#'();,.*$/0 9ETA-\n\0é")),
        min_size=1,
        max_size=4,
    ),
    st.booleans(),
)
def test_any_characters_changed_are_read_or_refused(changes, insert):
    text = PLANO
    for place, character in changes:
        text = text[:place] + character + text[place + (not insert) :]
    try:
        solid = solid_of(text)
    except ValueError:
        return
    assert len(solid.faces) >= 1


@given(st.data())
def test_any_entity_removed_is_named(data):
    used = set(re.findall(r"#(\d+)\b(?! ?=)", re.sub("'[^']*'", "", TABLE63)))  # without 'Context #1'
    number = data.draw(st.sampled_from(sorted(used)))
    text = re.sub(rf"(?m)^#{number} ?= ?[^;]*;\n", "", TABLE63)
    assert text != TABLE63
    with pytest.raises(ValueError, match=rf"lacks entity #{number},"):
        entities_of_text(text)


def changed(pattern, replacement, text=TABLE63):
    """Return the text with the first match replaced."""
    out, count = re.subn(pattern, replacement, text, count=1)
    assert count == 1
    assert out != text
    return out


@pytest.mark.parametrize(
    ("pattern", "replacement", "sentence"),
    [
        (
            r"MANIFOLD_SOLID_BREP\(",
            "BREP_WITH_VOIDS(",
            "one MANIFOLD_SOLID_BREP, got 0 and a BREP_WITH_VOIDS",
        ),
        (r"SI_UNIT\(\.MILLI\.,", "SI_UNIT(,", "grammar"),
        (r"SI_UNIT\(\.MILLI\.,", "SI_UNIT(", "SI_UNIT must have 2 parameters, got 1"),
        (r"LENGTH_UNIT\(\)", "", "one unit of length, got 0"),
        (r"(SURFACE_WITH_KNOTS\('',)3", r"\g<1>4", "must have as many|clamped|by its knots|knots must be"),
        (r"(SURFACE_WITH_KNOTS\('',)3", r"\g<1>300000000000", "from 1 to 11"),
        (r"(SURFACE_WITH_KNOTS\('',3,3,\(\s*\()#\d+,", r"\g<1>", "4 x 4 poles by its knots, got 4 x 3 or 4"),
        (r"(SURFACE_WITH_KNOTS[^;]*?)\(4,4\)", r"\g<1>(4,999999999999)", "from 1 to 11"),
        (r"(SURFACE_WITH_KNOTS[^;]*?)\(4,4\)", r"\g<1>(4,4,1)", "as many multiplicities"),
        (r"(SURFACE_WITH_KNOTS[^;]*?)\(4,4\)", r"\g<1>(4,5)", "clamped|more than"),
        (r"(SURFACE_WITH_KNOTS[^;]*?\()-8\.0*", r"\g<1>9.", "must not decrease"),
        (r"(SURFACE_WITH_KNOTS[^;]*?\()-8\.0*,", r"\g<1>-8,", "list of reals"),
        (r"(CURVE_WITH_KNOTS\('',3,\()#\d+,", r"\g<1>", "4 poles by its knots, got 3"),
        (r"(CURVE_WITH_KNOTS\('',3,\()#\d+,", r"\g<1>#1,", "#1 must be a CARTESIAN_POINT"),
        (r"(CARTESIAN_POINT\('',\()-5\.0*,", r"\g<1>", "must be a CARTESIAN_POINT of three reals"),
        (r"(CARTESIAN_POINT\('',\()-5\.0*,", r"\g<1>-5.E999,", r"beyond 1e\+09"),
        (r"(CARTESIAN_POINT\('',\()-5\.0*,", r"\g<1>-5.E160,", r"beyond 1e\+09"),
        (r"(CLOSED_SHELL\('',\()(#\d+),#\d+", r"\g<1>\g<2>,\g<2>", "names a face twice"),
        (r"(ADVANCED_FACE\('\w*',\(#\d+\),#\d+,)\.[TF]\.", r"\g<1>", "grammar"),
        (r"(EDGE_LOOP\('',)\([^)]*\)", r"\g<1>#1", "must have a list"),
        (r"(ORIENTED_EDGE\('',\*,\*,#\d+,)\.[TF]\.", r"\g<1>.U.", r"\.T\. or \.F\."),
        (r"DATA;", "DATA;#999999=ITEM_DEFINED_TRANSFORMATION('','',#11,#11);", "placement #999999"),
    ],
)
def test_damage_is_named(pattern, replacement, sentence):
    with pytest.raises(ValueError, match=sentence):
        solid_of(changed(pattern, replacement))


@pytest.mark.parametrize(
    ("pattern", "replacement", "sentence"),
    [
        (r"(VECTOR\('',#\d+,)1\.\)", r"\g<1>1.E308)", r"at most 1e\+09, got 1e\+308"),
        (r"(VECTOR\('',#\d+,)1\.\)", r"\g<1>-1.E999)", r"at most 1e\+09, got -inf"),
        (r"(CIRCLE\('',#\d+,)[\d.]+\)", r"\g<1>1.E308)", r"positive sizes of at most 1e\+15"),
        (r"(CIRCLE\('',#\d+,)[\d.]+\)", r"\g<1>0.)", "positive sizes"),
        (r"(CYLINDRICAL_SURFACE\('',#\d+,)[\d.]+\)", r"\g<1>1.E16)", r"positive sizes of at most 1e\+15"),
    ],
)
def test_lengths_beyond_those_of_parts_are_refused(pattern, replacement, sentence, tmp_path):
    text = written(BRepPrimAPI_MakeCylinder(2.0, 5.0).Solid(), tmp_path / "solid.step").read_text()
    with pytest.raises(ValueError, match=sentence):
        brep_of_text(changed(pattern, replacement, text))


@pytest.mark.parametrize(
    "spline",
    [
        "CURVE_WITH_KNOTS('',3,(),.UNSPECIFIED.,.T.,.F.,(4,4),",
        "SURFACE_WITH_KNOTS('',3,3,(),.UNSPECIFIED.,.F.,.F.,.F.,(4,4),(4,4),(0.,1.),",
        "SURFACE_WITH_KNOTS('',3,3,((),()),.UNSPECIFIED.,.F.,.F.,.F.,(4,4),(4,4),(0.,1.),",
    ],
)
def test_a_spline_without_poles_is_refused(spline):
    text = TABLE63.replace("DATA;", f"DATA;#999999=B_SPLINE_{spline}(0.,1.),.UNSPECIFIED.);", 1)
    with pytest.raises(ValueError, match="#999999 must have poles"):
        brep_of_text(text)


@pytest.mark.parametrize("which", range(6))
def test_a_face_missing_leaves_four_unpaired_edges(which):
    shell = re.search(r"CLOSED_SHELL\('',\(([^)]*)\)", TABLE63)[1]
    rest = ",".join(f for k, f in enumerate(shell.split(",")) if k != which)
    solid = solid_of(TABLE63.replace(shell, rest))
    assert (len(solid.faces), solid.unpaired) == (5, 4)


def test_a_face_turned_round_leaves_four_unpaired_edges():
    assert solid_of(changed(r"(FACE_BOUND\('',#\d+,)\.F\.", r"\g<1>.T.")).unpaired == 4


@pytest.mark.parametrize("text", [TABLE63, PLANO], ids=["ruled", "planar"])
def test_loops_run_around_their_faces(text):
    """Along its curve or against it, every edge begins where the one before ends; normals point out of the
    solid."""
    solid = solid_of(text)
    edges = {edge.number: edge.ends for edge in solid.edges}
    middle = np.mean(list(edges.values()), axis=(0, 1))
    for face in solid.faces:
        (loop,) = face.loops
        ends = [edges[number][:: 1 if along else -1] for number, along in loop]
        for before, after in zip(ends[-1:] + ends[:-1], ends):
            np.testing.assert_array_equal(before[1], after[0])
        corners = np.array([start for start, _ in ends])
        around = np.cross(
            corners[2] - corners[0], corners[3] - corners[1]
        )  # to the left of the loop lies the face
        assert around @ (corners.mean(axis=0) - middle) > 0
        if face.plane is not None:
            assert (around @ face.plane[1] > 0) == face.outward


def test_edges_in_another_order_leave_gaps():
    solid = solid_of(changed(r"(EDGE_LOOP\('',\()(#\d+),(#\d+)", r"\g<1>\g<3>,\g<2>"))
    assert (solid.unpaired, solid.gaps) == (0, 3)


def test_a_pole_moved_by_its_last_digit_is_seen():
    good = brep(entities_of_text(TABLE63)).faces[1].surface
    pole = good.coefficients[1, 2]
    moved = np.nextafter(pole[2], np.inf)
    points = re.finditer(rf"CARTESIAN_POINT\('',\(({REAL}),\s*({REAL}),\s*({REAL})", TABLE63)
    places = [m for m in points if tuple(map(float, m.groups())) == tuple(pole)]
    assert len(places) == 1
    start, stop = places[0].span(3)
    text = TABLE63[:start] + f"{moved:#.17G}" + TABLE63[stop:]
    read = brep(entities_of_text(text)).faces[1].surface
    assert read.coefficients[1, 2, 2] == moved
    assert (read.coefficients != good.coefficients).sum() == 1
