"""Verification of STEP files: good ones pass, every kind of damage is caught."""

import re
from types import SimpleNamespace

import numpy as np
import pytest
from OCP.BRep import BRep_Builder
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox
from OCP.gp import gp_Pnt
from OCP.STEPControl import STEPControl_AsIs, STEPControl_Writer
from OCP.TopoDS import TopoDS_Compound

from optics.base.runtime import Check, verification
from optics.exchange.verification.step_checks import TOLERANCE, differing_numbers, surface_deviation, verify
from optics.exchange.verification.step_file import StepFile
from optics.exchange.verification.trace_comparison import deposit
from optics.scene.receivers import Screen
from optics.scene.system import System, lens_product
from tests.optics.cases import failing, moved_point
from tests.optics.exchange.verification.cases import EVERY_LENS, SPLINES, shaped
from tests.optics.exchange.verification.changed_texts import moved, point
from thbcad import KnotVector, write_step
from thbcad.cad.exchange import compact
from thbcad.cad.shapes import lens_solid
from thbcad.lens import placed_surfaces
from thbcad.splines import BSplineSurface


def written(problem, lens, path):
    """Write a STEP file as a design does."""
    write_step(lens, path, lens_product(problem), problem.export.schema)


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    """A lens, its problem, and the text of its STEP file."""
    folder = tmp_path_factory.mktemp("verify")
    problem, lens = shaped(folder, SPLINES)
    written(problem, lens, folder / "lens.step")
    return SimpleNamespace(problem=problem, lens=lens, text=(folder / "lens.step").read_text())


def failed(good, folder, text, backend):
    """Return the names of the checks that fail for a file with this text."""
    (folder / "lens.step").write_text(text)
    checked = verification(
        verify(System(good.problem).with_lens(good.lens), StepFile(folder / "lens.step"), backend)
    )
    names = [c["name"] for c in checked["checks"] if not c["ok"]]
    assert checked["ok"] == (not names)
    return names


@pytest.mark.every(3)
@pytest.mark.parametrize("changes", EVERY_LENS)
def test_a_good_file_passes(tmp_path, backend, changes):
    problem, lens = shaped(tmp_path, changes)
    written(problem, lens, tmp_path / "lens.step")
    checks = verify(System(problem).with_lens(lens), StepFile(tmp_path / "lens.step"), backend)
    assert failing(checks) == []
    assert len(checks) == 14


def test_the_limits_are_the_problems(good, tmp_path, backend):
    (tmp_path / "lens.step").write_text(good.text)
    limits = {
        c.name: c.limit
        for c in verify(System(good.problem).with_lens(good.lens), StepFile(tmp_path / "lens.step"), backend)
    }
    v = good.problem.verify
    assert sorted(limit for limit in limits.values() if limit) == sorted(
        [v.volume, v.surface, v.surface, v.landing, v.irradiance, TOLERANCE]
    )


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize(("face", "name"), [(0, "front"), (1, "rear")])
def test_a_pole_moved_by_a_nanometre_is_caught(good, tmp_path, backend, face, name, axis):
    pole = placed_surfaces(good.lens)[face].coefficients[2, 1]
    names = failed(good, tmp_path, moved_point(good.text, pole, 1e-6 * np.eye(3)[axis]), backend)
    assert f"{name} poles and knots that differ from the lens in memory" in names
    assert f"{name} face against the lens in memory" in names


def test_a_rear_pole_moved_by_a_nanometre_moves_the_light(good, tmp_path, backend):
    pole = placed_surfaces(good.lens)[1].coefficients[3, 3]
    names = failed(good, tmp_path, moved_point(good.text, pole, [0, 0, 1e-6]), backend)
    assert "landing points, independent trace of the file" in names


def test_a_pole_moved_by_its_last_bit_is_caught(good, tmp_path, backend):
    pole = placed_surfaces(good.lens)[1].coefficients[3, 3]
    names = failed(good, tmp_path, moved_point(good.text, pole, [0, 0, np.spacing(pole[2])]), backend)
    assert names == ["rear poles and knots that differ from the lens in memory"]


def test_a_knot_moved_is_caught(good, tmp_path, backend):
    """The first interior knot of every spline of the file, -7.5 mm (level 1), moves by a micrometre."""
    knot = compact(f"{placed_surfaces(good.lens)[1].kv_u.breaks[1]:#.17G}")
    assert good.text.count(knot) > 0
    names = failed(good, tmp_path, good.text.replace(knot, f"{float(knot) + 1e-3:#.17G}"), backend)
    assert "rear poles and knots that differ from the lens in memory" in names


@pytest.mark.parametrize("which", [2, 3, 4, 5])
def test_a_missing_edge_face_is_caught(good, tmp_path, backend, which):
    shell = re.search(r"CLOSED_SHELL\('',\(([^)]*)\)", good.text)
    faces = shell[1].split(",")
    assert len(faces) == 6
    text = good.text.replace(shell[1], ",".join(f for k, f in enumerate(faces) if k != which))
    names = failed(good, tmp_path, text, backend)
    assert {"faces besides the six expected", "free edges", "shell not closed"} <= set(names)


@pytest.mark.parametrize("which", [0, 3, 5, 7])
def test_a_corner_moved_by_a_micrometre_is_caught(good, tmp_path, backend, which):
    """The vertex alone moves: faces and edges no longer meet in it, whatever tolerance a reader grants."""
    corners = re.findall(r"VERTEX_POINT\('',#(\d+)\)", good.text)
    assert len(corners) == 8
    assert failed(good, tmp_path, moved(good.text, corners[which], [0, 0, 1e-3]), backend)


@pytest.mark.parametrize("which", [0, 2, 4, 6])
def test_a_rim_moved_by_a_micrometre_is_caught(good, tmp_path, backend, which):
    """The curve of an edge leaves the face that it bounds."""
    rims = re.findall(r"B_SPLINE_CURVE_WITH_KNOTS\('',\d+,\(([#\d,\s]*)\)", good.text)
    rims = [
        row for row in rims if point(good.text, row.split(",")[0].strip("#"))[1].count(",") == 2
    ]  # not those in parameters
    assert len(rims) == 8
    poles = [p.strip("# \n") for p in rims[which].split(",")]
    assert failed(good, tmp_path, moved(good.text, poles[len(poles) // 2], [0, 0, 1e-3]), backend)


def test_a_second_solid_is_caught(good, tmp_path, backend):
    compound, builder = TopoDS_Compound(), BRep_Builder()
    builder.MakeCompound(compound)
    builder.Add(compound, lens_solid(good.lens))
    builder.Add(compound, BRepPrimAPI_MakeBox(gp_Pnt(30, 30, 0), 1.0, 1.0, 1.0).Shape())
    writer = STEPControl_Writer()
    writer.Transfer(compound, STEPControl_AsIs)
    writer.Write(str(tmp_path / "two.step"))
    names = failed(good, tmp_path, (tmp_path / "two.step").read_text(), backend)
    assert {"solids besides the one expected", "faces besides the six expected"} <= set(names)


@pytest.mark.parametrize("unit", ["metre", "centimetre", "micrometre", "inch"])
def test_another_unit_is_caught(good, tmp_path, backend, unit):
    """The same numbers in another unit are another lens."""
    millimetre = "( LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT(.MILLI.,.METRE.) )"
    assert good.text.count(millimetre) == 1
    if unit == "inch":
        text = good.text.replace(
            millimetre, "( CONVERSION_BASED_UNIT('INCH',#90001) LENGTH_UNIT() NAMED_UNIT(#90003) )"
        )
        extra = (
            f"#90001 = LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(25.4),#90002);\n#90002 = {millimetre};\n"
            "#90003 = DIMENSIONAL_EXPONENTS(1.,0.,0.,0.,0.,0.,0.);\nENDSEC;\nEND-ISO"
        )
        text = text.replace("ENDSEC;\nEND-ISO", extra)
    else:
        prefix = {"metre": "$", "centimetre": ".CENTI.", "micrometre": ".MICRO."}[unit]
        text = good.text.replace(millimetre, millimetre.replace(".MILLI.", prefix))
    names = failed(good, tmp_path, text, backend)
    assert "volume by OCCT against the closed form, relative" in names
    assert "rear face against the lens in memory" in names


@pytest.mark.parametrize("step", [1e-6, -1e-6])
def test_another_lens_is_caught(good, tmp_path, backend, step):
    """The file of a lens that is thicker by a nanometre fails for this lens."""
    thicker = type(good.lens)(good.lens.front, good.lens.rear, good.lens.thickness + step, good.lens.index)
    write_step(thicker, tmp_path / "lens.step")
    names = failed(good, tmp_path, (tmp_path / "lens.step").read_text(), backend)
    assert "rear face against the lens in memory" in names
    assert "front face against the lens in memory" not in names


def test_surface_deviation_is_the_greatest_distance_in_z(good):
    rear = placed_surfaces(good.lens)[1]
    assert surface_deviation(rear, good.lens.rear, good.lens.thickness) < 1e-13
    assert surface_deviation(rear, good.lens.rear, good.lens.thickness + 0.25) == pytest.approx(
        0.25, rel=1e-12
    )


CHECKS = [
    (0, 0, True),
    (1e-9, 1e-8, True),
    (1e-8, 1e-8, True),
    (2e-8, 1e-8, False),
    (np.nan, 1, False),
    (np.inf, 1, False),
]


@pytest.mark.parametrize("scale", [1.001, 0.999])
def test_surface_deviation_sees_a_face_of_another_size(good, scale):
    """A plane is the same height everywhere: a face that is too large or too small is still another face."""
    front = placed_surfaces(good.lens)[0]
    face = BSplineSurface(front.kv_u, front.kv_v, front.coefficients * [scale, 1.0, 1.0])
    assert surface_deviation(face, good.lens.front, 0.0) == pytest.approx(abs(scale - 1) * 10, rel=1e-9)


def test_numbers_that_differ_are_counted(good):
    """A face of another degree with as many poles, and none at all, differ in everything."""
    own = placed_surfaces(good.lens)[1]
    everything = own.coefficients.size + len(own.kv_u.knots) + len(own.kv_v.knots)
    higher = own.coefficients.copy()
    higher[2, 3, 1:] += 1.0
    vectors = [
        KnotVector.uniform(kv.degree - 1, kv.dim - kv.degree + 1, kv.start, kv.stop)
        for kv in (own.kv_u, own.kv_v)
    ]
    assert differing_numbers(own, own) == 0
    assert differing_numbers(BSplineSurface(own.kv_u, own.kv_v, higher), own) == 2
    assert differing_numbers(BSplineSurface(*vectors, own.coefficients), own) == everything
    assert differing_numbers(None, own) == everything


@pytest.mark.parametrize(("value", "limit", "ok"), CHECKS)
def test_a_check_passes_up_to_its_limit(value, limit, ok):
    check = Check("name", value, limit, "mm")
    assert check.ok is ok
    assert verification([check])["ok"] is ok


def test_deposit_shares_the_flux_between_the_nearest_pixels():
    """Pixel centres at -1.5 ... 1.5: a ray at x = -0.75, y = 1.25 weighs 1/4, 3/4 by column and 3/4, 1/4 by
    row."""
    screen = Screen((2.0, 2.0), (4, 4))
    image = deposit(
        np.array([[-0.75, 1.25], [np.nan, np.nan], [50.0, 0.0]]), np.array([8.0, 0.0, 1.0]), screen
    )
    expected = np.zeros((4, 4))
    expected[0, :2] = 8 * 0.75 * np.array([0.25, 0.75])
    expected[1, :2] = 8 * 0.25 * np.array([0.25, 0.75])
    np.testing.assert_allclose(image, expected, rtol=1e-14)
