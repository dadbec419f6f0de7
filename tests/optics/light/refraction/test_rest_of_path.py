"""Fixed surfaces and a receiver: where rays land, and where to aim them."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.optimize import brentq

from optics.light.refraction import RestOfPath
from optics.light.refraction.rest_of_path import bent
from optics.scene.paths import Surface
from optics.scene.receivers import Plane, receiver_at
from oracles.light_formulas import refracted_vector
from thbcad.lens import FreeformSurface
from thbcad.poses import Pose
from thbcad.sags import Conic

CONICS = {
    "plane": Conic(),
    "sphere": Conic(-30.0),
    "paraboloid": Conic(25.0, -1.0),
    "ellipsoid": Conic(40.0, 0.5),
}
FAR = float("inf")
THICKNESS, INDEX = 2.0, 1.57


def behind_a_front(conic, target_z, index=INDEX, thickness=THICKNESS):
    """Return what lies behind the front of a lens, in its frame."""
    rear = Surface(FreeformSurface((5.0, 5.0), conic), Pose.at((0.0, 0.0, thickness)))
    return RestOfPath((rear,), (index, 1.0), receiver_at(target_z))


def unit(*vector):
    return np.array(vector) / np.sqrt(sum(np.square(v) for v in vector))


def landing_by_hand(rest, point, slopes):
    """Return where one ray lands: the meeting by bisection, refraction by vectors."""
    (x, y, z), (p, q), conic = point, slopes, rest.surfaces[0].shape.conic
    t = brentq(lambda t: z + t - THICKNESS - conic(x + p * t, y + q * t), -20.0, 20.0, xtol=1e-14)
    at = np.array([x + p * t, y + q * t, z + t])
    zx, zy = (float(conic(at[0], at[1], d)) for d in ((1, 0), (0, 1)))
    along, normal = np.array([p, q, 1.0]), np.array([-zx, -zy, 1.0])
    (out,) = refracted_vector(*(v[None, :] / np.linalg.norm(v) for v in (along, normal)), INDEX)
    if rest.receiver.far_field:
        return np.degrees(np.arctan2(out[:2], out[2]))
    return at[:2] + out[:2] / out[2] * (rest.receiver.pose.shift[2] - at[2])


@pytest.mark.parametrize("target_z", [20.0, FAR])
@pytest.mark.parametrize("conic", CONICS.values(), ids=CONICS)
@given(st.tuples(*[st.floats(-4.0, 4.0)] * 2), st.tuples(*[st.floats(-0.25, 0.25)] * 2), st.floats(-1.0, 1.0))
def test_rays_land_where_the_vector_law_says(conic, target_z, place, slopes, height):
    rest, point = behind_a_front(conic, target_z), (*place, height)
    u, v, through = rest.land(point, unit(*slopes, 1.0))
    assert through
    np.testing.assert_allclose([u, v], landing_by_hand(rest, point, slopes), rtol=0, atol=1e-10)


def test_rays_that_miss_a_surface_land_nowhere():
    u, v, through = behind_a_front(Conic(-10.0), 1000.0).land((15.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    assert np.isnan([u, v]).all()
    assert not through


@pytest.mark.parametrize("target_z", [20.0, FAR])
@pytest.mark.parametrize("conic", CONICS.values(), ids=CONICS)
def test_aimed_light_lands_where_it_is_wanted(conic, target_z):
    rng, rest = np.random.default_rng(5), behind_a_front(conic, target_z)
    points = rng.uniform([[-4], [-4], [-0.5]], [[4], [4], [0.5]], (3, 400))
    wanted = rng.uniform(-8, 8, (2, 400))
    directions, reached = rest.toward(points, *wanted)
    assert reached.all()
    np.testing.assert_allclose(np.linalg.norm(directions, axis=0), 1.0, rtol=0, atol=1e-14)
    np.testing.assert_allclose(rest.land(points, directions)[:2], wanted, rtol=0, atol=1e-9)


def test_what_light_cannot_reach_is_told():
    """Behind a plane light leaves by less than 90 degrees."""
    rest = behind_a_front(Conic(), 3.0, 1.5)
    directions, reached = rest.toward(np.zeros((3, 2)), np.array([1.0, 50.0]), np.zeros(2))
    assert reached.tolist() == [True, False]
    assert np.isfinite(directions).all()


def test_a_plane_mirror_behind_is_the_receiver_unfolded():
    """A mirror at 45 degrees at 70 mm, a screen 200 mm beside it: a screen at 270 mm, one axis flipped."""
    mirror = Surface(
        FreeformSurface((90.0, 90.0)), Pose.at((0, 0, 70), rotation_vector=(0, -np.pi / 4, 0)), "reflect"
    )
    beside = Plane(Pose.at((200, 0, 70), rotation_vector=(0, np.pi / 2, 0)))
    folded = RestOfPath((mirror,), (1.0, 1.0), beside)
    rng = np.random.default_rng(7)
    points, (p, q) = rng.uniform(-5, 5, (3, 200)), rng.uniform(-0.2, 0.2, (2, 200))
    along = unit(p, q, np.ones(200))
    u, v, through = folded.land(points, along)
    x, y, _ = RestOfPath((), (1.0,), receiver_at(270.0)).land(points, along)
    assert through.all()
    np.testing.assert_allclose([-u, v], [x, y], rtol=0, atol=1e-12 * 270)
    back, reached = folded.toward(points, u, v)
    assert reached.all()
    np.testing.assert_allclose(back, along, rtol=0, atol=1e-9)


def test_angles_keep_the_law_of_sines():
    """n sin i = sin t at a plane that is tilted by i, for light along z."""
    tilt = np.radians([0.0, 5.0, 20.0, 40.0])
    (x, _, z), passes = bent(False, (1.5, 1.0), (0.0, 0.0, 1.0), (np.tan(tilt), 0.0 * tilt))
    out = np.arctan2(x, z) + tilt  # from the normal (-sin, 0, cos)
    assert passes.all()
    np.testing.assert_allclose(np.sin(out), 1.5 * np.sin(tilt), rtol=0, atol=1e-14)


def test_light_leaves_along_a_surface_that_would_reflect_it():
    (x, _, z), passes = bent(False, (1.5, 1.0), (0.0, 0.0, 1.0), (np.array(2.0), np.array(0.0)))
    assert not passes
    assert x * 2.0 - z == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("before", [300.0, 700.0, 1140.0])
def test_a_curved_mirror_is_met_next_to_its_vertex_from_however_far(before):
    """A ray to the vertex meets the sphere of R = -800 mm also 800 sqrt(2) = 1131 mm before that."""
    pose = Pose.tilted((0, 0, before), (45, 0, 0))
    mirror = Surface(FreeformSurface((90.0, 120.0), Conic(-800.0)), pose, "reflect")
    screen = Plane(Pose.tilted((0, 300, before), (-90, 0, 0)))
    rest, zero = RestOfPath((mirror,), (1.0, 1.0), screen), np.zeros(1)
    u, v, through = rest.land((zero, zero, zero), (zero, zero, zero + 1))
    assert through.all()
    np.testing.assert_allclose([u, v], 0, rtol=0, atol=1e-9)
