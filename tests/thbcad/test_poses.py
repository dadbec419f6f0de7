"""Rigid motions: the laws of their group, and scipy's rotations beside them."""

import pickle

import numpy as np
import pytest
from hypothesis import assume, example, given, strategies as st
from scipy.spatial.transform import Rotation

from thbcad import Pose

LAW = 1e-14
numbers = st.floats(-10, 10, allow_subnormal=False)
triples = st.tuples(numbers, numbers, numbers)
poses = st.builds(lambda shift, turn, about: Pose.at(shift, turn, about), triples, triples, triples)
shifts = st.builds(Pose.at, triples)
SOME = np.random.default_rng(1).normal(size=(3, 7))


def apart(one, other):
    """How far two poses are apart: their rotations, and their shifts relative to the larger one's size."""
    size = max(1.0, np.abs(one.shift).max(), np.abs(other.shift).max())
    return max(np.abs(one.rotation - other.rotation).max(), np.abs(one.shift - other.shift).max() / size)


def scale(*poses):
    """The size of what is added up where poses are composed, mm."""
    return 1.0 + sum(np.abs(pose.shift).sum() for pose in poses)


@given(a=poses, b=poses | shifts, c=poses)
def test_poses_are_a_group(a, b, c):
    one = Pose.at()
    assert apart(a @ one, a) == apart(one @ a, a) == 0
    left, right = (a @ b) @ c, a @ (b @ c)
    assert np.abs(left.rotation - right.rotation).max() < LAW
    assert np.abs(left.shift - right.shift).max() < LAW * scale(a, b, c)
    for around in (a @ a.inverse(), a.inverse() @ a):
        assert np.abs(around.rotation - np.eye(3)).max() < LAW
        assert np.abs(around.shift).max() < LAW * scale(a)
    assert apart((a @ b).inverse(), b.inverse() @ a.inverse()) < LAW * scale(a, b)


@given(a=poses, b=poses | shifts)
def test_a_product_does_the_second_first(a, b):
    assert np.abs((a @ b).points(SOME) - a.points(b.points(SOME))).max() < 10 * LAW * scale(a, b)
    assert np.abs((a @ b).directions(SOME) - a.directions(b.directions(SOME))).max() < 10 * LAW


@given(position=triples, vector=triples, about=triples)
def test_rotations_are_those_of_scipy(position, vector, about):
    pose, turn = Pose.at(position, vector, about), Rotation.from_rotvec(vector)
    wanted = (turn.apply(SOME.T - about) + about + position).T
    assert np.abs(pose.points(SOME) - wanted).max() < 1e-13
    assert np.abs(pose.points(np.array(about)) - (np.array(about) + position)).max() < 1e-13
    assert np.abs(Rotation.from_rotvec(pose.rotation_vector).as_matrix() - pose.rotation).max() < LAW


@given(tilt=triples, position=triples)
def test_a_tilt_turns_about_own_axes_one_after_the_other(tilt, position):
    pose = Pose.tilted(position, tilt)
    one_by_one = Pose.at(position)
    for axis, angle in zip(np.eye(3), np.radians(tilt)):
        one_by_one = one_by_one @ Pose.at((0, 0, 0), angle * axis)
    assert apart(pose, one_by_one) < LAW
    wanted = Rotation.from_euler("XYZ", tilt, degrees=True).apply(SOME.T).T
    assert np.abs(pose.directions(SOME) - wanted).max() < 10 * LAW


@given(direction=triples, position=triples)
@example(direction=(0, 0, -2), position=(1, 2, 3))
def test_a_body_that_faces_a_direction_is_turned_straight_to_it(direction, position):
    direction = np.array(direction, float)
    assume(np.linalg.norm(direction) > 1e-3)
    pose = Pose.facing(position, direction)
    assert (pose.shift == position).all()
    np.testing.assert_allclose(pose.rotation[:, 2], direction / np.linalg.norm(direction), atol=1e-12)
    assert abs(pose.rotation_vector[2]) < 1e-9  # of all rotations that do so the smallest
    with pytest.raises(ValueError, match="three zeros"):
        Pose.facing(position, 0.0 * direction)


@given(pose=poses | shifts)
def test_a_rotation_has_a_tilt_that_makes_it(pose):
    """Also where the first and the last axis are one: a quarter turn about y."""
    for one in (pose, Pose.tilted((0, 0, 0), (33.0, 90.0, -20.0)), Pose.tilted((0, 0, 0), (5.0, -90.0, 1.0))):
        assert np.abs(Pose.tilted((0, 0, 0), one.tilt).rotation - one.rotation).max() < 1e-13


@given(pose=poses | shifts)
def test_triples_and_arrays_of_any_shape_are_taken_to_the_same_places(pose):
    for act in (pose.points, pose.directions):
        wanted = act(SOME)
        assert np.abs(np.array(act(tuple(SOME))) - wanted).max() < 1e-13
        assert np.abs(act(SOME.reshape(3, 7, 1))[..., 0] - wanted).max() < 1e-13
        assert np.abs(act(SOME[:, 0]) - wanted[:, 0]).max() < 1e-13


def test_what_moves_nothing_costs_nothing():
    here, beside = Pose.at(), Pose.at((1.0, 2.0, 3.0))
    assert here.is_identity
    assert not here.rotates
    assert here.points(SOME) is here.directions(SOME) is SOME
    assert not beside.is_identity
    assert not beside.rotates
    assert beside.directions(SOME) is SOME
    assert np.array_equal(beside.points(SOME), SOME + np.array([[1.0], [2.0], [3.0]]))
    assert Pose.at((0, 0, 0), (0, 0, 0), (5.0, 6.0, 7.0)).is_identity


def test_poses_travel_and_do_not_change():
    pose = Pose.at((1, 2, 3), (0.1, 0.2, 0.3))
    assert apart(pickle.loads(pickle.dumps(pose)), pose) == 0
    with pytest.raises(ValueError, match="read-only"):
        pose.shift[0] = 5


def test_mirror_axes_are_those_in_which_a_pose_is_its_own_image():
    poses = {
        (0, 1): Pose.at((0.0, 0.0, 70.0)),
        (0,): Pose.at((0.0, 3.0, 70.0), (0.4, 0.0, 0.0)),
        (1,): Pose.at((0.0, 0.0, 70.0), (0.0, 0.4, 0.0)),
        (): Pose.at((0.0, 0.0, 70.0), (0.0, 0.0, 0.1)),
    }
    assert {axes: pose.mirror_axes for axes, pose in poses.items()} == {axes: axes for axes in poses}
    assert Pose.at((1.0, 2.0, 70.0)).mirror_axes == ()


@pytest.mark.parametrize(
    ("rotation", "shift", "words"),
    [
        (np.diag([1.0, 1.0, -1.0]), np.zeros(3), "mirrors"),
        (np.diag([1.0, 1.0, 1.1]), np.zeros(3), "off by 0.21"),
        (np.eye(2), np.zeros(3), r"got \(2, 2\)"),
        (np.eye(3), np.zeros(2), r"and \(2,\)"),
        (np.full((3, 3), np.nan), np.zeros(3), "finite"),
        (np.eye(3), np.array([0, np.inf, 0]), "finite"),
    ],
)
def test_what_is_no_rigid_motion_is_refused(rotation, shift, words):
    with pytest.raises(ValueError, match=words):
        Pose(rotation, shift)


@pytest.mark.parametrize(
    "numbers",
    [5.0, [2.0], True, None, np.ma.array([1.0, 2, 3], mask=[0, 0, 1]), np.array([1 + 5j, 0, 0]), 10**400],
)
def test_a_place_and_a_turn_are_three_numbers(numbers):
    for make in (Pose.at, lambda a: Pose.at(rotation_vector=a), lambda a: Pose.tilted((0, 0, 0), a)):
        with pytest.raises(ValueError, match="numbers"):
            make(numbers)


def test_an_array_that_holds_no_triples_is_refused():
    for pose in (Pose.at((0, 0, 5)), Pose.at(rotation_vector=(0, 0, 1))):
        with pytest.raises(ValueError, match=r"arrays \(3, \.\.\.\), got one of shape \(1, 3\)"):
            pose.points(np.array([[1.0, 2.0, 3.0]]))
