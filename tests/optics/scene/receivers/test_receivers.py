"""Where rays land: on a plane or in the far field, wherever that lies, by any library of arrays."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from optics.scene.receivers import FarField, Plane, receiver_at
from thbcad import Pose

numbers = st.floats(-10, 10, allow_subnormal=False)
small = st.floats(-0.5, 0.5, allow_subnormal=False)
POSES = st.builds(Pose.at, st.tuples(numbers, numbers, numbers), st.tuples(small, small, small))


def rays(seed=1, count=50):
    """Points (3, n) before all planes of the tests, and directions within 27 degrees of z."""
    rng = np.random.default_rng(seed)
    point = np.stack([*rng.uniform(-5, 5, (2, count)), rng.uniform(-80, -60, count)])
    direction = np.stack([*rng.uniform(-0.35, 0.35, (2, count)), np.ones(count)])
    return point, direction / np.linalg.norm(direction, axis=0)


@given(pose=POSES)
def test_rays_end_on_the_plane_where_its_chart_says(pose):
    point, direction = rays()
    landed = Plane(pose).land(point, direction)
    assert landed.met.all()
    there = point + landed.length * direction
    by_chart = pose.points(np.stack([landed.u, landed.v, np.zeros(landed.u.size)]))
    assert np.abs(there - by_chart).max() < 1e-11
    assert np.abs(landed.p - pose.inverse().directions(direction)[0]).max() < 1e-14


@given(pose=POSES)
def test_a_moved_scene_lands_at_the_same_place(pose):
    """Receiver and rays move together."""
    point, direction = rays()
    for receiver in (Plane(Pose.at((0, 0, 7.0))), FarField()):
        moved = type(receiver)(pose @ receiver.pose)
        one = receiver.land(point, direction)
        other = moved.land(pose.points(point), pose.directions(direction))
        assert max(np.abs(one.u - other.u).max(), np.abs(one.v - other.v).max()) < 1e-11


@given(pose=POSES)
def test_light_sent_toward_a_place_lands_there(pose):
    point, direction = rays()
    for receiver in (Plane(pose), FarField(pose)):
        landed = receiver.land(point, direction)
        again = np.stack(np.broadcast_arrays(*receiver.toward(point, landed.u, landed.v)))
        assert np.abs(again / np.linalg.norm(again, axis=0) - direction).max() < 1e-13


def test_angles_of_the_far_field_are_those_of_each_axis():
    u, v = np.array([30.0, -20.0]), np.array([0.0, 45.0])
    direction = np.stack([np.tan(np.radians(u)), np.tan(np.radians(v)), np.ones(2)])
    landed = FarField().land(np.full((3, 2), np.nan), direction / np.linalg.norm(direction, axis=0))
    np.testing.assert_allclose([landed.u, landed.v], [u, v], rtol=1e-15, atol=1e-14)


@pytest.mark.parametrize("receiver", [Plane(Pose.at((0, 0, 5.0))), FarField()], ids=["plane", "far field"])
def test_light_from_behind_or_along_meets_nothing_and_stays_finite(receiver):
    direction = np.array([[0.0, 1.0, 0.6], [0.0, 0.0, 0.0], [-1.0, 0.0, 0.8]])
    landed = receiver.land(np.zeros((3, 3)), direction)
    assert landed.met.tolist() == [False, False, True]
    assert np.isfinite([landed.u, landed.v]).all()


@given(pose=POSES)
def test_the_device_lands_rays_where_numpy_does(backend, pose):
    point, direction = rays()
    on_device = [tuple(map(backend.array, three)) for three in (point, direction)]
    for receiver in (Plane(pose), FarField(pose)):
        one = receiver.land(point, direction)
        other = receiver.land(*on_device, backend.dr, lambda number: backend.dr.opaque(backend.Float, number))
        for key in ("u", "v", "p", "q"):
            assert np.abs(getattr(one, key) - getattr(other, key).numpy()).max() < 1e-11


def test_a_height_names_a_plane_and_infinity_the_far_field():
    plane, far = receiver_at(12.0), receiver_at(np.inf)
    assert (plane.unit, plane.area_unit, plane.far_field) == ("mm", "mm^2", False)
    assert (far.unit, far.area_unit, far.far_field) == ("degrees", "square degrees", True)
    assert plane.pose.shift.tolist() == [0, 0, 12]
    turned = receiver_at(12.0, Pose.at(rotation_vector=(np.pi / 2, 0, 0)))
    np.testing.assert_allclose(turned.pose.shift, [0, -12, 0], atol=1e-14)
