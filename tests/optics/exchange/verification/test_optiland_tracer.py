"""optiland as a stranger: its rays land where ours do, and every kind of damage to a face is caught."""

import subprocess
import sys
from importlib.util import find_spec

import numpy as np
import pytest

from optics.exchange.verification import optiland_tracer as module
from optics.exchange.verification.optiland_tracer import optiland_available, optiland_checks, optiland_through
from optics.exchange.verification.rays_behind import RaysBehind
from optics.exchange.verification.reference_tracer import trace_step
from optics.scene.receivers import receiver_at
from optics.scene.sources import Profile
from oracles.light_formulas import fresnel, meridional
from tests.cases import slow_unless
from tests.optics.cases import failing, hollow_lens, lambertian_parts, moved_point, small_lens
from tests.optics.exchange.verification.cases import EVERY_SHAPE, LENSES, written
from thbcad import read_step, write_step
from thbcad.lens import placed_surfaces
from thbcad.sags import Conic
from thbcad.splines import BSplineSurface

# found, not small_system: that takes a second in every process that collects this file
pytestmark = pytest.mark.skipif(find_spec("optiland") is None, reason="optiland is not installed")

FATE = "rays with another fate by optiland's trace of the file"
LANDING = "landing points by optiland's trace of the file"
IRRADIANCE = "irradiance by optiland's trace of the file, relative"
ALONG = np.array([0.0, 0.0, 1.0])


def optiland_trace(front, rear, origins, directions, index, target):
    """Return where rays of 1 W land that optiland traces through two faces."""
    rays = RaysBehind(origins, directions, np.ones(len(origins)))
    return optiland_through(front, rear, rays, index).landing(target)


def along_axis(x, y):
    """Return (origins, directions) of rays along z that start 20 mm before the lens."""
    return np.column_stack([x, y, np.full_like(x, -20.0)]), np.tile(ALONG, (len(x), 1))


def glowing(count, half_angle=89.0):
    """Return (origins, directions) of a source of 1 mm, 2 mm before the vertex, in the hollow of
    `hollow_lens`."""
    (rays,) = lambertian_parts((0.5, 0.5), 2.0, 1.0, half_angle, Profile(), count, 3, count)
    return rays.origin.T, rays.direction.T


def rough_hollow(height=0.1, spans=4):
    """Return the hollow lens with waves of `height` mm on both faces, without symmetry."""
    waves = [lambda space, s=s: np.random.default_rng(s).uniform(-height, height, space.dim) for s in (1, 2)]
    return hollow_lens(*waves, spans=(spans, spans))


@pytest.mark.every(3)
@pytest.mark.parametrize(
    "name", slow_unless(lambda name: name in EVERY_SHAPE and name != "sphere front", LENSES)
)
def test_a_good_file_passes(tmp_path, backend, name):
    system, lens, file = written(tmp_path, LENSES[name])
    checks = optiland_checks(system.with_lens(lens), file)
    assert failing(checks) == []
    assert [c.name for c in checks] == [FATE, LANDING, IRRADIANCE]
    limits = system.problem.verify
    assert [c.limit for c in checks] == [0, limits.landing, limits.irradiance]


def test_rays_without_light_do_not_count(tmp_path, backend):
    system, lens, file = written(tmp_path, {"source.profile": "round"})
    assert failing(optiland_checks(system.with_lens(lens), file)) == []


def test_a_pole_moved_by_a_nanometre_is_caught(tmp_path, backend):
    """Slopes of 1e-6 mm over a span of a few mm move the light by more than 1e-8 mm on a target 60 mm
    away."""
    system, lens, file = written(tmp_path)
    pole = placed_surfaces(lens)[1].coefficients[4, 5]
    file.path.write_text(moved_point(file.path.read_text(), pole, [0.0, 0.0, 1e-6]))
    assert LANDING in failing(optiland_checks(system.with_lens(lens), file))


def test_rays_land_where_snells_law_in_angles_sends_them():
    """A plano-convex paraboloid, rays in a meridional plane: tan and arcsin against optiland's Newton and
    vectors."""
    r = np.linspace(-9, 9, 18)  # none at 0: the oracle's Fresnel needs an angle
    inside = meridional(r).to(0.0).refracted(0.0, 1.0, 1.5)
    expected = inside.to(6.0 - r**2 / 80).refracted(-r / 40, 1.5, 1.0).to(60.0).r
    found = optiland_trace(
        *placed_surfaces(small_lens(rear=Conic(-40.0, -1.0))), *along_axis(r, 0 * r), 1.5, receiver_at(60.0)
    )
    np.testing.assert_allclose(found.points[:, 0], expected, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.points[:, 1], 0, rtol=0, atol=1e-12)
    # 0.96 = 4 n / (n + 1)^2 at the plane front; a dozen roundings, arcsin and arccos double them
    np.testing.assert_allclose(found.flux, 0.96 * fresnel(np.abs(np.arctan(r / 40)), 1.5, 1.0), rtol=1e-13)


def test_far_field_points_are_angles():
    faces = placed_surfaces(small_lens(rear=Conic(-40.0, -1.0)))
    rays = along_axis(np.linspace(-9, 9, 7), np.linspace(-5, 8, 7))
    far, near = (optiland_trace(*faces, *rays, 1.5, receiver_at(z)).points for z in (np.inf, 1e9))
    # from 1e9 mm the lens is a point of 20 mm
    np.testing.assert_allclose(np.tan(np.radians(far)), near / 1e9, rtol=0, atol=2e-8)


@pytest.mark.every(2)
@pytest.mark.parametrize(("height", "spans"), [(0.1, 4), (0.8, 8)])
def test_steep_rays_in_a_hollow_meet_as_ours_do(tmp_path, height, spans):
    """Every ray has the fate of scipy's trace, lands where that says and carries what that says."""
    lens = rough_hollow(height, spans)
    write_step(lens, tmp_path / "lens.step")
    step = read_step(tmp_path / "lens.step")
    origins, directions = glowing(512)
    ours = trace_step(step, origins, directions, 1.0, 1.5, receiver_at(1005.0))
    found = optiland_trace(step.front, step.rear, origins, directions, 1.5, receiver_at(1005.0))
    np.testing.assert_array_equal(found.flux > 0, ours.flux > 0)
    assert 256 < np.count_nonzero(found.flux) < 512
    # meetings are known to 1e-12 mm, normals on curvatures below 1 / mm as well; a metre away that is 1e-9
    # mm, and rays that leave at 65 degrees land 1 / cos^2 = 6 times as far off
    target = (np.abs(ours.points) <= 2000.0).all(axis=1)
    assert np.count_nonzero(target) > 100
    np.testing.assert_allclose(found.points[target], ours.points[target], rtol=0, atol=1e-8)
    np.testing.assert_allclose(found.flux[target], ours.flux[target], rtol=0, atol=1e-11)


def test_starts_at_one_height_lose_steep_rays(monkeypatch):
    """What the search for a start is for: from the rim's height alone, Newton's method is held at the rim."""
    faces, rays = placed_surfaces(rough_hollow()), glowing(256)
    searched = optiland_trace(*faces, *rays, 1.5, receiver_at(1005.0))
    monkeypatch.setattr(
        module, "_nearest", lambda surface, heights, points, directions: np.zeros(len(points), dtype=int)
    )
    single = optiland_trace(*faces, *rays, 1.5, receiver_at(1005.0))
    arrives = single.flux > 0
    assert np.count_nonzero(arrives) < np.count_nonzero(searched.flux)
    # those that still arrive are no strays: only rays held on the way are counted as lost
    np.testing.assert_allclose(single.flux[arrives], searched.flux[arrives], rtol=0, atol=1e-11)


def test_an_iteration_that_has_not_ended_loses_the_ray(monkeypatch):
    """One step of Newton's method is not enough for steep rays; they must not go on from beside the face."""
    faces = placed_surfaces(rough_hollow())
    rays = glowing(64)
    ended = optiland_trace(*faces, *rays, 1.5, receiver_at(1005.0))
    monkeypatch.setattr(module, "NEWTON_STEPS", 1)
    found = optiland_trace(*faces, *rays, 1.5, receiver_at(1005.0))
    arrives = found.flux > 0
    assert np.count_nonzero(arrives) < np.count_nonzero(ended.flux)
    np.testing.assert_allclose(found.flux[arrives], ended.flux[arrives], rtol=0, atol=1e-11)


def test_rays_beside_the_lens_totally_reflected_or_backwards_do_not_arrive():
    faces = placed_surfaces(small_lens(rear=Conic(-11.0, -1.0), thickness=10.0))
    origins, directions = along_axis(
        np.array([11.0, 0.0, 0.0, 9.9, 0.0]), np.array([0.0, -10.5, 0.0, 9.9, 0.0])
    )
    directions[2] *= -1
    found = optiland_trace(*faces, origins, directions, 1.5, receiver_at(60.0))
    np.testing.assert_array_equal(found.flux > 0, [False, False, False, False, True])
    np.testing.assert_array_equal(np.isfinite(found.points).all(axis=1), found.flux > 0)


def test_rays_beside_a_plane_front_do_not_reach_a_larger_rear():
    faces = placed_surfaces(small_lens(rear_half_width=(12.0, 12.0)))
    found = optiland_trace(
        *faces, *along_axis(np.array([9.9, 11.0, 0.0]), np.array([9.9, 0.0, -10.1])), 1.5, receiver_at(60.0)
    )
    np.testing.assert_array_equal(found.flux > 0, [True, False, False])


def test_a_plane_rear_is_met_in_spite_of_rounding():
    """Where a spline's rounding lifts the plane above its poles, rays have fallen through it all the same."""
    faces = placed_surfaces(small_lens(front=Conic(-40.0, -1.0), rear=Conic()))
    rng = np.random.default_rng(0)
    found = optiland_trace(*faces, *along_axis(*rng.uniform(-9, 9, (2, 200))), 1.5, receiver_at(60.0))
    assert (found.flux > 0).all()


def test_rays_that_start_behind_the_front_do_not_meet_it():
    faces = placed_surfaces(rough_hollow())
    apex = faces[0]([0.0], [0.0])[0]
    origins = apex + np.outer([-0.01, 0.01], ALONG)
    np.testing.assert_array_equal(
        optiland_trace(*faces, origins, np.tile(ALONG, (2, 1)), 1.5, receiver_at(60.0)).flux > 0,
        [True, False],
    )


def test_parts_of_the_rays_land_as_all(monkeypatch):
    faces, rays = placed_surfaces(rough_hollow()), glowing(64)
    whole = optiland_trace(*faces, *rays, 1.5, receiver_at(1005.0))
    monkeypatch.setattr(module, "AT_ONCE", 7)
    parts = optiland_trace(*faces, *rays, 1.5, receiver_at(1005.0))
    np.testing.assert_allclose(parts.points, whole.points, rtol=1e-11, atol=1e-8)
    np.testing.assert_allclose(parts.flux, whole.flux, rtol=1e-9, atol=0)


def test_knots_need_not_run_from_0_to_1():
    """The same poles over other parameter ranges are the same faces."""
    faces, rays = placed_surfaces(rough_hollow()), glowing(64, 40.0)
    moved = [
        BSplineSurface(*(type(kv)(kv.degree, 3 * kv.knots + 7) for kv in (s.kv_u, s.kv_v)), s.coefficients)
        for s in faces
    ]
    a, b = (optiland_trace(*s, *rays, 1.5, receiver_at(1005.0)).points for s in (faces, moved))
    np.testing.assert_allclose(a, b, rtol=1e-11, atol=1e-8)


def test_the_settings_of_optiland_are_put_back():
    from optiland import backend

    faces, rays = placed_surfaces(small_lens()), along_axis(np.linspace(-9, 9, 5), np.linspace(-7, 8, 5))
    exact = optiland_trace(*faces, *rays, 1.5, receiver_at(60.0)).points
    backend.set_precision("float32")
    try:
        np.testing.assert_array_equal(optiland_trace(*faces, *rays, 1.5, receiver_at(60.0)).points, exact)
        with pytest.raises(TypeError):
            optiland_trace(*faces, *rays, "glass", receiver_at(60.0))
        assert (backend.get_backend(), backend.get_precision()) == ("numpy", 32)
    finally:
        backend.set_precision("float64")


@pytest.mark.slow
def test_to_ask_for_optiland_does_not_load_it():
    program = (
        "import sys; from optics.exchange.verification import optiland_available as a; print(a(), 'optiland' "
        "in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert optiland_available()
    assert done.stdout.split() == ["True", "False"]
