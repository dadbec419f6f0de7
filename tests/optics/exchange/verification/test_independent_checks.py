"""Checks by strangers: good files pass, every kind of damage is caught by one of them or refused with a
sentence."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from optics.exchange.verification.independent_checks import text_and_occt_checks
from optics.exchange.verification.lone_file import _axis, bare_checks, unit_note
from optics.exchange.verification.occt_tracer import occt_through
from optics.exchange.verification.rays_behind import RaysBehind
from optics.exchange.verification.step_file import StepFile, optical_faces
from optics.scene.receivers import receiver_at
from optics.scene.system import System
from oracles.light_formulas import fresnel, meridional
from tests.cases import slow_unless
from tests.optics.cases import failing, moved_point, small_lens
from tests.optics.exchange.verification.cases import EVERY_SHAPE, LENSES, SPLINES, shaped, written
from tests.optics.exchange.verification.changed_texts import moved
from thbcad import write_step
from thbcad.cad.exchange import compact, step_solid
from thbcad.cad.shapes import lens_solid
from thbcad.io import parse_brep
from thbcad.lens import placed_surfaces
from thbcad.sags import Conic
from thbcad.splines import KnotVector

LANDING = "landing points by OCCT's intersections with the file"
REAR = "text of the file: rear numbers that differ from the lens in memory"
FRONT = "text of the file: front numbers that differ from the lens in memory"
EDGES = "text of the file: edge face numbers that differ from the lens in memory"
RIMS = "text of the file: rims and corners that differ from the lens in memory"
UNIT = "text of the file: unit of length that is not mm"
FACES = "text of the file: faces besides the six expected"
GAPS = "text of the file: edges that do not begin where the one before ends"
VOLUME = "volume by quadrature over the text of the file against the closed form, relative"
IMAGES = "text of the file: edges from their vertices and from their curves in the faces' parameters"
UNPAIRED = "text of the file: edges that do not border two faces"


RULED = SPLINES | {"lens.rear.half_width": [8.0, 9.0]}


@pytest.fixture(
    scope="module",
    params=[
        pytest.param(SPLINES, id="plane edges", marks=pytest.mark.slow),
        pytest.param(RULED, id="ruled edges"),
    ],
)
def good(request, tmp_path_factory):
    """A lens with plane or with ruled edges, its system, and the text of its STEP file."""
    system, lens, file = written(tmp_path_factory.mktemp("strangers"), request.param)
    return SimpleNamespace(system=system, lens=lens, text=file.path.read_text(), ruled=request.param == RULED)


def failed(good, folder, text, backend):
    """Return the names of the checks that fail for a file with this text."""
    (folder / "lens.step").write_text(text)
    file = StepFile(folder / "lens.step")
    return {*failing(text_and_occt_checks(good.system, file, backend))}


@pytest.mark.every(3)
@pytest.mark.parametrize("name", slow_unless(EVERY_SHAPE.__contains__, LENSES))
def test_a_good_file_passes(tmp_path, backend, name):
    system, lens, file = written(tmp_path, LENSES[name])
    checks = text_and_occt_checks(system.with_lens(lens), file, backend)
    assert failing(checks) == []
    assert {c.name for c in checks} >= {LANDING, REAR, FRONT, EDGES, RIMS, UNIT, FACES, UNPAIRED, GAPS}
    assert next(c for c in checks if c.name == LANDING).limit == system.problem.verify.landing == 1e-8
    assert failing(bare_checks(file).checks) == []


def test_rays_without_light_do_not_count(tmp_path, backend):
    system, lens, file = written(tmp_path, {"source.profile": "round"})
    assert failing(text_and_occt_checks(system.with_lens(lens), file, backend)) == []


def test_a_lens_of_another_index_than_the_problem_names_is_traced_with_its_own(tmp_path, backend):
    problem, lens = shaped(tmp_path, {})
    dense = replace(lens, index=lens.index + 0.1)
    write_step(dense, tmp_path / "lens.step")
    checks = text_and_occt_checks(System(problem).with_lens(dense), StepFile(tmp_path / "lens.step"), backend)
    assert next(c for c in checks if c.name == LANDING).ok


def occt_trace(solid, origins, directions, index, target):
    """Return where rays of 1 W land that OCCT traces through the first two faces of a solid."""
    rays = RaysBehind(origins, directions, np.ones(len(origins)))
    return occt_through(solid, (0, 1), rays, [(0, 1 / index), (1, index)]).landing(target)


def test_rays_land_where_snells_law_in_angles_sends_them():
    """A plano-convex paraboloid, rays in a meridional plane: tan and arcsin against OCCT's faces."""
    lens = small_lens(rear=Conic(-40.0, -1.0))
    r = np.linspace(-9, 9, 19)
    rays = meridional(r).to(0.0).refracted(0.0, 1.0, 1.5)
    at_rear = rays.to(6.0 - r**2 / 80)
    expected = at_rear.refracted(-r / 40, 1.5, 1.0).to(60.0).r
    origins = np.column_stack([r, np.zeros_like(r), np.full_like(r, -20.0)])
    found = occt_trace(lens_solid(lens), origins, np.tile([0.0, 0.0, 1.0], (19, 1)), 1.5, receiver_at(60.0))
    np.testing.assert_allclose(found.points[:, 0], expected, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.points[:, 1], 0, rtol=0, atol=1e-12)
    # 0.96 = 4 n / (n + 1)^2 at the plane front; the oracle's Fresnel needs an angle, which r = 0 has not
    slanted = r != 0
    expected = 0.96 * fresnel(np.abs(np.arctan(r[slanted] / 40)), 1.5, 1.0)
    np.testing.assert_allclose(found.flux[slanted], expected, rtol=1e-13)


def test_lost_rays_land_nowhere():
    """One passes beside the lens, one meets an edge face, one is totally reflected, one goes through."""
    lens = small_lens(rear=Conic(-10.0, -1.0), thickness=11.0)
    origins = [[12.0, 0, -5], [9.9, 0, -5], [9.0, 0, -5], [0, 0, -5]]
    directions = np.array([[0, 0, 1.0], [0.1, 0, 1.0], [0, 0, 1.0], [0, 0, 1.0]])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    found = occt_trace(lens_solid(lens), np.array(origins), directions, 1.5, receiver_at(60.0))
    np.testing.assert_array_equal(np.isfinite(found.points).all(axis=1), [False, False, False, True])
    np.testing.assert_array_equal(found.flux > 0, [False, False, False, True])


@pytest.mark.parametrize("tenth", range(10))
def test_a_file_cut_off_is_refused(good, tmp_path, backend, tenth):
    with pytest.raises(ValueError, match=r"lens\.step is not a whole STEP file"):
        failed(good, tmp_path, good.text[: len(good.text) * tenth // 10], backend)
    with pytest.raises(ValueError, match=r"lens\.step is not a whole STEP file"):
        bare_checks(StepFile(tmp_path / "lens.step"))


@pytest.mark.every(4)
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize(("face", "name"), [(0, FRONT), (1, REAR)])
def test_a_pole_moved_by_a_nanometre_is_caught(good, tmp_path, backend, face, name, axis):
    pole = placed_surfaces(good.lens)[face].coefficients[2, 1]
    assert failed(good, tmp_path, moved_point(good.text, pole, 1e-6 * np.eye(3)[axis]), backend) >= {name}


def test_a_rear_pole_moved_by_a_nanometre_moves_the_rays_of_occt(good, tmp_path, backend):
    pole = placed_surfaces(good.lens)[1].coefficients[3, 3]
    assert failed(good, tmp_path, moved_point(good.text, pole, [0, 0, 1e-6]), backend) >= {REAR, LANDING}


def poles_of(text, what):
    """Return the pole numbers of every spline curve or surface that the pattern names."""
    return [
        re.findall(r"#(\d+)", m)
        for m in re.findall(rf"{what}_WITH_KNOTS\(''[\d,\s]*(\([#\d,\s()]*\))\s*,\s*\.", text)
    ]


@pytest.mark.slow
def test_a_rim_pole_moved_by_a_nanometre_is_caught(good, tmp_path, backend):
    in_space = set(
        re.findall(r"#(\d+)=CARTESIAN_POINT\('',\([^,)]*,[^,)]*,", good.text)
    )  # the others lie in parameters of faces
    rims = [p for p in poles_of(good.text, "B_SPLINE_CURVE") if len(p) > 2 and p[0] in in_space]
    assert len(rims) == 8
    for poles in rims[::3]:
        text = moved(good.text, poles[len(poles) // 2], [0, 0, 1e-6])
        assert failed(good, tmp_path, text, backend) == {RIMS, VOLUME}


def test_a_corner_moved_by_a_nanometre_is_caught(good, tmp_path, backend):
    corner = re.findall(r"VERTEX_POINT\('',#(\d+)\)", good.text)[5]
    failures = failed(good, tmp_path, moved(good.text, corner, [0, 0, 1e-6]), backend)
    assert failures - {IMAGES} == {RIMS, VOLUME}  # that is the limit of the images


def test_an_edge_face_moved_by_a_nanometre_is_caught(good, tmp_path, backend):
    if good.ruled:
        point = poles_of(good.text, "B_SPLINE_SURFACE")[3][5]
    else:
        place = re.findall(r"=PLANE\(\'\',#(\d+)\)", good.text)[1]
        point = re.search(rf"#{place}=AXIS2_PLACEMENT_3D\(\'\',#(\d+)", good.text)[1]
    failures = failed(good, tmp_path, moved(good.text, point, [1e-6, 1e-6, 0]), backend)
    assert failures - {IMAGES} == {EDGES, VOLUME}


@pytest.mark.every(4)
@pytest.mark.parametrize("which", range(0, 12, 3))
def test_an_edge_turned_round_is_caught(good, tmp_path, backend, which):
    place = [m.end() for m in re.finditer(r"=EDGE_CURVE\([^;]*,\.(?=T\.\);)", good.text)][which]
    assert failed(good, tmp_path, good.text[:place] + "F" + good.text[place + 1 :], backend) >= {RIMS}


@pytest.mark.every(4)
@pytest.mark.parametrize("which", range(0, 12, 3))
def test_an_edge_to_another_corner_is_caught(good, tmp_path, backend, which):
    corners = re.findall(r"#(\d+)=VERTEX_POINT", good.text)
    found = list(re.finditer(r"=EDGE_CURVE\(\'\',#(\d+),#(\d+)", good.text))[which]
    other = next(c for c in corners if c not in found.groups())
    assert failed(
        good, tmp_path, good.text[: found.start(1)] + other + good.text[found.end(1) :], backend
    ) >= {GAPS, RIMS}


@pytest.mark.every(2)
@pytest.mark.parametrize(
    ("prefix", "words"),
    [(".CENTI.", "the centimetre, 10 mm"), (".MICRO.", "the micrometre, 0.001 mm"), ("$", "metre, 1000 mm")],
)
def test_another_unit_is_caught_where_the_lens_is_known_and_read_where_not(
    good, tmp_path, backend, prefix, words
):
    """A lens is written in mm.  A file by itself may be in any unit, which is said: its numbers are compared
    as they stand."""
    text = good.text.replace("SI_UNIT(.MILLI.", f"SI_UNIT({prefix}")
    assert text != good.text
    assert UNIT in failed(good, tmp_path, text, backend)
    file = StepFile(tmp_path / "lens.step")
    names = failing(bare_checks(file).checks)
    assert not [name for name in names if "numbers of surfaces" in name or "volume" in name]
    (sentence,) = unit_note(file)
    assert words in sentence


def test_a_prefix_taken_away_is_refused(good, tmp_path, backend):
    with pytest.raises(ValueError, match="does not follow the grammar"):
        failed(good, tmp_path, good.text.replace("SI_UNIT(.MILLI.", "SI_UNIT("), backend)


@pytest.mark.every(4)
@pytest.mark.parametrize("which", range(6))
def test_a_face_missing_is_caught(good, tmp_path, backend, which):
    shell = re.search(r"CLOSED_SHELL\('',\(([^)]*)\)", good.text)[1]
    text = good.text.replace(shell, ",".join(f for k, f in enumerate(shell.split(",")) if k != which))
    if which < 2:
        with pytest.raises(ValueError, match="1 optical faces where a lens has 2"):
            failed(good, tmp_path, text, backend)
    else:
        assert failed(good, tmp_path, text, backend) >= {FACES, UNPAIRED}
        bare = failing(bare_checks(StepFile(tmp_path / "lens.step")).checks)
        assert {*bare} >= {UNPAIRED, "free edges, by OCCT"}


def test_a_knot_moved_is_caught(good, tmp_path, backend):
    knot = compact(f"{placed_surfaces(good.lens)[1].kv_u.breaks[1]:#.17G}")
    text = good.text.replace(knot, f"{np.nextafter(float(knot), 0):#.17G}")
    assert text != good.text
    assert failed(good, tmp_path, text, backend) >= {REAR, RIMS}


def test_knots_in_another_order_are_refused(good, tmp_path, backend):
    breaks = [compact(f"{k:#.17G}") for k in placed_surfaces(good.lens)[1].kv_u.breaks[:2]]
    text = re.sub(rf"{breaks[0]},\s*{breaks[1]}", f"{breaks[1]},{breaks[0]}", good.text)
    assert text != good.text
    with pytest.raises(ValueError, match="must not decrease"):
        failed(good, tmp_path, text, backend)


def test_faces_in_another_order_pass(good, tmp_path, backend):
    """What the light does depends on no order in the file."""
    shell = re.search(r"CLOSED_SHELL\('',\(([^)]*)\)", good.text)[1]
    a, b, *rest = shell.split(",")
    assert (
        failed(good, tmp_path, good.text.replace(shell, ",".join([*rest[:1], b, *rest[1:], a])), backend)
        == set()
    )
    assert optical_faces(parse_brep(tmp_path / "lens.step")) == (5, 1)
    assert not step_solid(tmp_path / "lens.step").IsNull()


def test_another_lens_is_caught(good, tmp_path, backend):
    _, other = shaped(tmp_path, {"lens.rear.radius": 41.0})
    write_step(other, tmp_path / "other.step")
    assert failed(good, tmp_path, (tmp_path / "other.step").read_text(), backend) >= {REAR, LANDING, RIMS}


def test_a_solid_inside_out_is_caught_without_its_lens(good, tmp_path):
    """OCCT turns it round as it reads; the text still tells."""
    flag = re.compile(r"(ADVANCED_FACE\([^;]*,)\.([TF])\.\)")
    text = flag.sub(lambda m: f"{m[1]}.{'F' if m[2] == 'T' else 'T'}.)", good.text)
    assert len(flag.findall(text)) == 6
    (tmp_path / "lens.step").write_text(text)
    names = failing(bare_checks(StepFile(tmp_path / "lens.step")).checks)
    assert any(name.startswith("volume by OCCT") for name in names)


def test_knots_too_uneven_for_a_grid_leave_all_poles_beside_it():
    knots = KnotVector(2, np.array([0.0, 0, 0, 0.3, 0.6, 1e300, 1e300, 1e300]))
    _, beside = _axis(knots, np.linspace(-1.0, 1.0, 5)[:, None] * np.ones(4))
    assert beside.all()


def test_a_lens_whose_splines_are_complex_entities_without_weights_verifies(good, tmp_path):
    """ISO 10303-21 allows `(BOUNDED_SURFACE() B_SPLINE_SURFACE(...) ...)`; OCCT wants weights."""
    simple = re.compile(r"= *B_SPLINE_SURFACE_WITH_KNOTS *\('',([^;]*?\.[TFU]\.),(\([\d,]+\),[^;]*)\);")
    text, count = simple.subn(
        r"=(SURFACE()B_SPLINE_SURFACE_WITH_KNOTS(\2)REPRESENTATION_ITEM('')"
        r"GEOMETRIC_REPRESENTATION_ITEM()B_SPLINE_SURFACE(\1)BOUNDED_SURFACE());",
        re.sub(r"\s+", " ", good.text).replace(", ", ",").replace("; ", ";\n"),
    )
    assert count
    (tmp_path / "simple.step").write_text(good.text)
    (tmp_path / "complex.step").write_text(text)
    by_file = [bare_checks(StepFile(tmp_path / f"{name}.step")) for name in ("simple", "complex")]
    assert failing(by_file[1].checks) == []
    assert [c.name for c in by_file[1].checks] == [c.name for c in by_file[0].checks]
    assert by_file[1].left_out == by_file[0].left_out
