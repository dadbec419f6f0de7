"""Convex regions hold all straight paths between two stacks, and little else."""

import numpy as np
from hypothesis import given, strategies as st

from thbcad.certified import (
    Stack,
    ellipse_supports,
    rectangle_supports,
    region_between,
    supports_of,
)

ROUNDING = 1e-9


@given(st.integers(0, 1 << 30))
def test_straight_paths_stay_inside_and_clipping_keeps_them(seed):
    rng = np.random.default_rng(seed)
    groups = [rng.normal(size=(6, 12, 3)) + np.array([0, 0, z]) for z in (-8.0, 8.0)]
    for group in groups:
        group[..., 2] = group[:, :1, 2]
    stacks = [Stack(g[:, 0, 2], np.array([supports_of(points[:, :2]) for points in g])) for g in groups]
    region = region_between(*stacks).shrunk(-ROUNDING)
    start, stop = (g.reshape(-1, 3) for g in groups)
    for share in np.linspace(0, 1, 5):
        assert region.holds(start + share * (stop - start)).all()
    cut = stacks[0].towards(stacks[1], 1.0)
    share = (1.0 - start[:, 2]) / (stop - start)[:, 2]
    at = start + share[:, None] * (stop - start)
    assert (supports_of(at[:, :2]) <= cut.supports[0] + ROUNDING).all()


def test_a_box_and_a_cone_are_held_exactly():
    square, circle = rectangle_supports((2.0, 1.0)), ellipse_supports((3.0, 3.0))
    box = region_between(Stack(np.array([0.0]), square[None]), Stack(np.array([4.0]), square[None]))
    inside = box.holds(
        np.array([[1.99, 0.99, 3.99], [2.01, 0, 1], [0, 1.01, 1], [0, 0, 4.01], [0, 0, -0.01]])
    )
    assert inside.tolist() == [True, False, False, False, False]
    cone = region_between(Stack(np.zeros(1), 0 * circle[None]), Stack(np.array([3.0]), circle[None]))
    angles = np.linspace(0, 6, 50)
    for z in (0.5, 2.0):
        ring = np.column_stack([np.cos(angles), np.sin(angles), np.full_like(angles, 1.0)]) * [z, z, z]
        assert cone.holds(0.999 * ring).all()
        assert not cone.holds(ring * [1.002, 1.002, 1]).any()  # 64 sides: 1 / cos(pi / 64) = 1.0012


def test_lines_and_planes_are_cut_to_what_is_inside():
    square = rectangle_supports((2.0, 1.0))
    box = region_between(Stack(np.array([0.0]), square[None]), Stack(np.array([4.0]), square[None]))
    part = box.part_of_line(np.array([-5.0, 0.5, 1.0]), np.array([5.0, 0.5, 1.0]))
    assert np.allclose(part, [[-2, 0.5, 1], [2, 0.5, 1]])
    beside = box.part_of_line(np.array([-5.0, 1.0, 1.0]), np.array([5.0, 1.0, 1.0]))
    assert not len(beside)  # it runs in a side
    corners = box.section(np.array([0.0, 0.0, 1.0]), np.eye(3)[0], np.eye(3)[1], 50.0)
    assert np.allclose(np.abs(corners), [2, 1, 1])
    assert not len(box.section(np.array([0.0, 0.0, 4.0]), np.eye(3)[0], np.eye(3)[1], 50.0))
