"""Changes of one entity of a STEP file: named where they are damage, seen where they are not."""

import re

import numpy as np
import pytest
from OCP.BRepPrimAPI import BRepPrimAPI_MakeCylinder

from tests.thbcad.cases import LENSES
from tests.thbcad.io.cases import written
from thbcad.cad.exchange import step_bytes
from thbcad.io.step_brep import brep_of_text
from thbcad.io.step_text import REAL

TABLE63 = step_bytes(LENSES["table63"]).decode()
PLANO = step_bytes(LENSES["plano"]).decode()


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
        brep_of_text(changed(pattern, replacement))


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
    solid = brep_of_text(TABLE63.replace(shell, rest))
    assert (len(solid.faces), solid.unpaired) == (5, 4)


def test_a_face_turned_round_leaves_four_unpaired_edges():
    assert brep_of_text(changed(r"(FACE_BOUND\('',#\d+,)\.F\.", r"\g<1>.T.")).unpaired == 4


@pytest.mark.parametrize("text", [TABLE63, PLANO], ids=["ruled", "planar"])
def test_loops_run_around_their_faces(text):
    """Along its curve or against it, every edge begins where the one before ends; normals point out of the
    solid."""
    solid = brep_of_text(text)
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
    solid = brep_of_text(changed(r"(EDGE_LOOP\('',\()(#\d+),(#\d+)", r"\g<1>\g<3>,\g<2>"))
    assert (solid.unpaired, solid.gaps) == (0, 3)


def test_a_pole_moved_by_its_last_digit_is_seen():
    good = brep_of_text(TABLE63).faces[1].surface
    pole = good.coefficients[1, 2]
    moved = np.nextafter(pole[2], np.inf)
    points = re.finditer(rf"CARTESIAN_POINT\('',\(({REAL}),\s*({REAL}),\s*({REAL})", TABLE63)
    places = [m for m in points if tuple(map(float, m.groups())) == tuple(pole)]
    assert len(places) == 1
    start, stop = places[0].span(3)
    text = TABLE63[:start] + f"{moved:#.17G}" + TABLE63[stop:]
    read = brep_of_text(text).faces[1].surface
    assert read.coefficients[1, 2, 2] == moved
    assert (read.coefficients != good.coefficients).sum() == 1
