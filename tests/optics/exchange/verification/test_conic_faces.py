"""Faces that are planes, spheres and conics in the file: traced by every program, and every number counts."""

import re
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, strategies as st

from optics.exchange.verification.independent_checks import text_and_occt_checks
from optics.exchange.verification.lone_file import bare_checks
from optics.exchange.verification.optiland_tracer import optiland_checks
from optics.exchange.verification.reference_tracer import trace_step
from optics.exchange.verification.step_checks import surface_deviation, verify
from optics.exchange.verification.step_file import StepFile
from optics.exchange.verification.traced_faces import ConicFace
from optics.scene.receivers import receiver_at
from tests.cases import examples
from tests.optics.cases import failing, moved_point
from tests.optics.exchange.verification.cases import written
from thbcad import FreeformSurface, Lens
from thbcad.lens import optical_forms, placed_surfaces
from thbcad.sags import Conic, PlacedConic

FRONTS = {
    "plane": {},
    "sphere": {"lens.front.radius": -45.0},
    "hollow sphere": {"lens.front.radius": 60.0},
    "ellipsoid": {"lens.front.radius": -45.0, "lens.front.conic": 0.6},
    "hyperboloid": {"lens.front.radius": 60.0, "lens.front.conic": -2.5},
    "paraboloid": {"lens.front.radius": -45.0, "lens.front.conic": -1.0},
}
REARS = {
    "equal": {"lens.thickness": 9.0},
    "unequal": {"lens.rear.half_width": [11.0, 9.0], "lens.thickness": 9.0},
}


QUICK = ("sphere", "equal"), ("hyperboloid", "unequal")
EVERY_PAIR = [
    pytest.param(*pair, marks=[] if pair in QUICK else [pytest.mark.slow]) for pair in product(FRONTS, REARS)
]


@pytest.mark.slow
@pytest.mark.parametrize(("front", "rear"), EVERY_PAIR)
def test_every_program_traces_the_file(tmp_path, backend, front, rear):
    """By OCCT, by closed forms, and by optiland: landing points within 1e-8 mm, numbers exact."""
    system, lens, file = written(tmp_path, FRONTS[front] | REARS[rear])
    assert system.problem.verify.landing == 1e-8
    checks = [
        *text_and_occt_checks(system.with_lens(lens), file, backend),
        *verify(system.with_lens(lens), file, backend),
        *optiland_checks(system.with_lens(lens), file),
        *bare_checks(file).checks,
    ]
    assert failing(checks) == []
    assert sum(check.name.startswith("landing points") for check in checks) == 3
    for face, own, vertex in zip(
        (file.solid.front, file.solid.rear), (lens.front, lens.rear), (0.0, lens.thickness)
    ):
        assert surface_deviation(face, own, vertex) <= 1e-12


@pytest.fixture(scope="module", params=["plane", "sphere", "hyperboloid"])
def good(request, tmp_path_factory):
    """A lens with a conic front, its system and the text of its STEP file."""
    system, lens, file = written(tmp_path_factory.mktemp("conics"), FRONTS[request.param] | REARS["equal"])
    return SimpleNamespace(system=system, lens=lens, text=file.path.read_text(), kind=request.param)


def moved_front(good, step):
    """Return the text with a number of the front changed: the height of a plane or of a centre, a pole."""
    front = optical_forms(good.lens)[0]
    if good.kind == "plane":
        plane = r"(=PLANE\('',.*\n.*\n.*POINT\('',\(0\.,0\.,)0\."
        text, found = re.subn(plane, rf"\g<1>{step:.17E}", good.text, count=1)
    elif good.kind == "sphere":
        # the centres of the four rims lie beside the axis
        text, found = moved_point(good.text, [0, 0, front.centre], [0, 0, step]), 1
    else:
        text, found = moved_point(good.text, front.patch.coefficients[1, 1], [0, 0, step]), 1
    assert found
    return text


def test_a_front_moved_by_a_nanometre_is_caught(good, tmp_path, backend):
    file = StepFile(tmp_path / "lens.step")
    file.path.write_text(moved_front(good, 1e-6))
    if good.kind == "hyperboloid":  # it is no conic of revolution any more
        with pytest.raises(ValueError, match=r"the front in .* is neither a spline"):
            text_and_occt_checks(good.system, file, backend)
        return
    checks = text_and_occt_checks(good.system, file, backend)
    checks += verify(good.system, file, backend)
    names = failing(checks)
    assert "text of the file: front numbers that differ from the lens in memory" in names
    assert "front poles and knots that differ from the lens in memory" in names
    assert "front face against the lens in memory" in names


@pytest.mark.parametrize("good", ["plane", "sphere"], indirect=True)
def test_a_last_bit_of_the_front_is_caught(good, tmp_path, backend):
    value = optical_forms(good.lens)[0].centre if good.kind == "sphere" else 0.0
    file = StepFile(tmp_path / "lens.step")
    file.path.write_text(moved_front(good, np.spacing(value)))
    names = failing(verify(good.system, file, backend))
    assert names == ["front poles and knots that differ from the lens in memory"]


@pytest.mark.parametrize("good", ["sphere", "hyperboloid"], indirect=True)
def test_a_rim_with_another_radius_is_caught(good, tmp_path, backend):
    """The lines of planes are compared by their ends."""
    kind = {"sphere": "CIRCLE", "hyperboloid": "HYPERBOLA"}[good.kind]
    found = re.search(rf"{kind}\('',#\d+,([\d.]+)", good.text)
    text = good.text[: found.start(1)] + repr(float(found[1]) + 1e-6) + good.text[found.end(1) :]
    file = StepFile(tmp_path / "lens.step")
    file.path.write_text(text)
    names = failing(text_and_occt_checks(good.system, file, backend))
    assert "text of the file: rims and corners that differ from the lens in memory" in names


@pytest.mark.slow
@examples(40)
@given(
    st.sampled_from([(np.inf, 0.0), (-30.0, 0.0), (25.0, 0.0), (-30.0, 0.7), (20.0, -2.5), (-25.0, -0.6)]),
    st.integers(0, 2**32 - 1),
)
def test_closed_forms_meet_what_the_spline_meets(shape, seed):
    """The same slanted rays on the conic and on its spline, 1e-11 mm apart, by Newton's method."""
    lens = Lens(FreeformSurface((9, 8), Conic(*shape)), FreeformSurface((9, 8)), 12.0, 1.5)
    rng = np.random.default_rng(seed)
    origins = np.column_stack([*rng.uniform(-12, 12, (2, 200)), np.full(200, -20.0)])
    directions = np.column_stack([*rng.uniform(-0.6, 0.6, (2, 200)), np.ones(200)])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    by_form, by_spline = (
        trace_step(SimpleNamespace(front=front, rear=rear), origins, directions, 1.0, 1.5, receiver_at(60.0))
        for front, rear in (optical_forms(lens), placed_surfaces(lens))
    )
    np.testing.assert_array_equal(by_form.flux > 0, by_spline.flux > 0)
    lit = by_form.flux > 0
    assert lit.any()
    # 1e-11 mm of height, 4e-11 of slope by its splines of degree 5, over 60 mm
    np.testing.assert_allclose(by_form.points[lit], by_spline.points[lit], rtol=0, atol=1e-8)
    np.testing.assert_allclose(by_form.flux, by_spline.flux, rtol=0, atol=1e-9)


def test_rays_over_the_rim_and_from_behind_meet_nothing():
    face = ConicFace(PlacedConic(Conic(-20.0, 0.0), 3.0, (5.0, 4.0)))
    origins = np.array([[0.0, 0, -5], [6.0, 0, -5], [0.0, 0, 5], [0.0, 0, 5], [9.0, 0.0, 3.0]])
    directions = np.array([[0.0, 0, 1], [0, 0, 1], [0, 0, 1], [0, 0, -1], [-0.99, 0, np.sqrt(1 - 0.99**2)]])
    points, normals, met = face.intersect(origins, directions)
    assert met.tolist() == [True, False, False, False, False]
    np.testing.assert_allclose(points[0], [0, 0, 3], atol=1e-15)
    np.testing.assert_allclose(normals[0], [0, 0, 1], atol=1e-15)
