"""The silhouette of a problem's envelope, seen from the target."""

from math import atan, pi, sqrt

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from optics.designing.etendue.silhouette import (
    _seen,
    greatest_slack,
    pixel_etendue,
    projected_solid_angle,
)
from optics.scene.problem import Problem
from optics.scene.receivers import Screen
from optics.scene.system import System
from oracles.seen_envelope import sampled_etendue, sampled_faces, sampled_lenses
from tests.cases import examples, slow_unless
from tests.optics.cases import HOLLOW, example_system, flat_problem, small_system

GLOWING = HOLLOW | {"source.kind": "lambertian", "source.half_width": [0.5, 0.5]}
BOX = np.array([[i, j, k] for i in (-3.0, 2.0) for j in (-1.0, 4.0) for k in (-2.0, 5.0)])


def looked_at(points, x, rays, rng):
    """Return P of a convex hull seen from x by random directions, and its standard error.

    Directions are uniform over the unit disk of (p, q), so that P is pi times the share of hits.  A line
    meets the hull where the part of it between all half-spaces is not empty.
    """
    r, phi = np.sqrt(rng.uniform(size=rays)), rng.uniform(0, 2 * pi, rays)
    d = np.stack([r * np.cos(phi), r * np.sin(phi), -np.sqrt(1 - r * r)])
    planes = ConvexHull(points).equations
    speed, gap = planes[:, :3] @ d, -(planes[:, :3] @ x + planes[:, 3])
    with np.errstate(divide="ignore"):
        at = gap[:, None] / speed
    enter = np.where(speed < 0, at, 0.0).max(axis=0)
    leave = np.where(speed > 0, at, np.inf).min(axis=0)
    share = float((enter < leave).mean())
    return pi * share, pi * sqrt(share * (1 - share) / rays)


def test_a_square_right_below_has_its_closed_form():
    """4 a / w atan(a / w) with w = sqrt(1 + a^2) for the half-width a at distance 1 (Howell, B-3, four times
    a quarter)."""
    for a in (1e-4, 0.3, 2.0):
        points = np.array([[i * a, j * a, k] for i in (-1, 1) for j in (-1, 1) for k in (-1e-9, 0.0)])
        wide = sqrt(1 + a * a)
        assert projected_solid_angle(points, np.zeros(1), np.zeros(1), 1.0)[0] == pytest.approx(
            4 * a / wide * atan(a / wide), rel=1e-6
        )


@examples(5)
@given(st.floats(-20, 20), st.floats(-20, 20), st.floats(5.5, 30))
def test_a_body_is_seen_as_by_random_directions(x, y, z):
    rng = np.random.default_rng(7)
    points = np.concatenate([BOX, rng.uniform(-3, 4, (10, 3))])
    expected, error = looked_at(points, np.array([x, y, z]), 40_000, rng)
    found = projected_solid_angle(points, np.array([x]), np.array([y]), z)[0]
    assert abs(found - expected) <= 5 * error + 1e-3


def over_sampled(system, points=None):
    """Return how many times the etendue by dense sampling the bound is, of pixels all over the target."""
    bound, (rows, columns) = pixel_etendue(system), system.target.screen().shape
    pixels = [(0, 0), (0, columns // 2), (rows // 2, columns // 4), (rows // 2, columns // 2)]
    return np.array([bound[at] for at in pixels]) / sampled_etendue(system, pixels, points)


EMITTER = {"kind": "lambertian", "half_width": (0.1, 0.1), "distance": 20.0}


def target_of(pitch, distance):
    """Return a target of 6 x 6 pixels, whose pitch is a share of the distance, or an angle in radians."""
    sides = tuple(3 * p * distance if distance < np.inf else 3 * np.degrees(p) for p in pitch)
    return {"kind": "tophat", "half_width": sides, "pixels": (6, 6)}


@st.composite
def any_faces(draw):
    """A face with a rectangular rim that reaches 0.9 of the way to the conic's end at most."""
    wide = draw(st.floats(2, 6))
    half_width = wide, wide * draw(st.floats(0.5, 1.0))
    radius = draw(st.sampled_from([-1, 1])) * np.hypot(*half_width) * draw(st.floats(1.4, 10))
    return {"half_width": half_width, "radius": radius, "conic": draw(st.floats(-2, 0.5))}


def disk_system(target):
    """Return the system of a round lens of plane faces, of radius 10 mm and 6 mm thick."""
    rear = {"half_width": (10, 10), "freeform": {"spans": (2, 2), "z_freedom": 1e-4}}
    return System(flat_problem(EMITTER, target, {"outline": "round", "rear": rear}))


def test_the_far_field_sees_the_disk_of_a_round_flat_lens():
    """Along an angle t the shadow of a disk of radius r and thickness d has the area pi r^2 + 2 r d tan(t),
    times cos(t)."""
    target = {"distance": np.inf, "half_width": (30, 20), "pixels": (120, 80)}
    system = disk_system(target)
    across, up = (np.tan(np.radians(centre)) for centre in system.target.screen().centres)
    squares = across[None, :] ** 2 + up[:, None] ** 2
    length, radius, thick = np.sqrt(1 + squares), 10.0, 6.0
    lit = (pi * radius**2 + 2 * radius * thick * np.sqrt(squares)) / length
    # of a pixel of half a degree, by its middle
    angle = np.radians(0.5) ** 2 * (1 + across**2)[None, :] * (1 + up**2)[:, None] / length**3
    times = pixel_etendue(system) / (lit * angle)
    assert times.min() >= 1
    assert times.max() < 1.01


def test_points_near_the_axis_see_the_disk_of_a_round_flat_lens():
    """The view of a disk from an element parallel to it (Howell, factor B-13), which hides its walls."""
    system = disk_system({"half_width": (6, 6)})
    x, y = system.target.screen().centres
    r2, h2, a2 = x[None, :] ** 2 + y[:, None] ** 2, 60.0**2, 10.0**2
    far = r2 + h2
    disk = pi / 2 * (1 - (far - a2) / np.sqrt((far + a2) ** 2 - 4 * r2 * a2))
    times = pixel_etendue(system) / (disk * system.target.screen().pixel_area)
    assert times.min() >= 1
    assert times.max() < 1.01


ROUNDED = {"lens.outline": "rounded", "lens.corner_radius": 2.0}


@pytest.mark.parametrize(
    ("outline", "far"),
    [
        ({"lens.outline": "round"}, False),
        ({"lens.outline": "ellipse", "lens.front.half_width": [5.0, 2.0]}, True),
        (ROUNDED, False),
        (ROUNDED | {"lens.corner_radius": 0.01}, True),
    ],
    ids=["round", "ellipse, far", "rounded", "almost sharp, far"],
)
def test_lenses_within_an_outline_have_bounds_within_three_per_cent(tmp_path, outline, far):
    sides = {"target.half_width": [30.0, 20.0] if far else [600.0, 400.0], "target.pixels": [60, 40]}
    place = {"target.distance": np.inf if far else 1000.0, "lens.rear.freeform.z_freedom": 1.0}
    system = small_system(tmp_path, GLOWING | outline | sides | place)
    times = over_sampled(system, sampled_lenses(system, 64))
    assert times.min() >= 1
    assert times.max() < 1.03


@pytest.mark.slow
@examples(12)
@given(
    any_faces(),
    any_faces(),
    st.sampled_from(["rectangle", "ellipse", "rounded"]),
    st.floats(1e-3, 2.0),
    st.one_of(st.floats(10.0, 1000.0), st.just(np.inf)),
    st.tuples(st.floats(0.01, 0.5), st.floats(0.01, 0.5)),
)
def test_pixels_get_no_more_than_their_bound_and_not_much_less(
    front, rear, outline, freedom, distance, pitch
):
    """Any lens and target, pixels up to half as wide as their distance or 29 degrees, by dense sampling."""
    rear |= {"freeform": {"spans": (2, 2), "z_freedom": freedom}}
    lens = {"index": 1.5, "thickness": 15.0, "front": front, "rear": rear, "outline": outline}
    lens |= {"corner_radius": 0.8} if outline == "rounded" else {}
    target = target_of(pitch, distance) | {"distance": distance}
    system = System(Problem(source=EMITTER, lens=lens, target=target))
    times = over_sampled(system, sampled_lenses(system, 48))
    assert times.min() >= 1
    assert times.max() < 1.5


ANGLES = st.floats(-180, 180)


@pytest.mark.slow
@examples(12)
@given(
    any_faces(),
    st.sampled_from(["rectangle", "ellipse"]),
    st.one_of(st.just(None), st.floats(1e-3, 2.0)),
    st.tuples(ANGLES, ANGLES, ANGLES),
    st.tuples(ANGLES, ANGLES, ANGLES),
    st.one_of(st.floats(12.0, 300.0), st.just(np.inf)),
    st.tuples(st.floats(0.01, 0.5), st.floats(0.01, 0.5)),
)
def test_mirrors_and_targets_anywhere_are_bounded_too(face, outline, freedom, tilt, aside, distance, pitch):
    """Any pose of a mirror before any pose of a target, as near as twice its size, by dense sampling.

    The farthest point of a face lies 6 sqrt(2) mm from its vertex and 9 mm before or behind it at most.
    """
    size = {"half_width": (5, 5)}
    row = [{"kind": "lens", "name": "L", "index": 1.5, "thickness": 5, "front": size, "rear": size}]
    face |= {"radius": np.inf, "conic": 0.0} if freedom is None else {}
    face |= {"freeform": None if freedom is None else {"spans": (2, 2), "z_freedom": freedom}}
    row = [
        *row[: freedom is None],
        {"kind": "mirror", "name": "M", "tilt": tilt, "thickness": 9, "face": face, "outline": outline},
    ]
    turn, far = tuple(np.add(tilt, aside)), distance == np.inf
    middle = Rotation.from_euler("XYZ", turn, degrees=True).apply([0, 0, 1 if far else distance])
    place = {"surface": "far_field"} if far else {"position": tuple(middle)}
    target = target_of(pitch, distance) | {"tilt": turn} | place
    system = System(Problem(source=EMITTER, element=row, target=target))
    times = over_sampled(system, sampled_faces(system, 48))
    assert times.min() >= 1
    assert times.max() < 1.5


@pytest.mark.parametrize(
    "name", slow_unless("flower".__eq__, ["extended", "extended_two", "street", "flower"])
)
def test_bounds_of_the_examples_are_within_three_per_cent(name):
    times = over_sampled(example_system(name))
    assert (times >= 1).all()
    assert times.max() < 1.03


@pytest.mark.every(2)
@pytest.mark.parametrize("pixels", [4, 256])
def test_bounds_of_wide_pixels_are_within_one_and_a_half_times(tmp_path, pixels):
    """Pixels of 10 mm, 20 mm away, which see the lens at very different depths."""
    near = {"target.distance": 20.0, "target.half_width": [5.0 * pixels] * 2, "target.pixels": [pixels] * 2}
    system = small_system(tmp_path, GLOWING | near)
    times = over_sampled(system, sampled_lenses(system, 64))
    assert (times >= 1).all()
    assert times.max() < 1.5
    assert greatest_slack(system, pixel_etendue(system)) == pytest.approx(times.max(), abs=0.05)


@pytest.mark.parametrize("z", [5.0, 5.0 + 1e-9])
def test_a_target_that_touches_the_envelope_may_see_all_directions(z):
    assert (_seen(Screen((2.0, 2.0), (3, 2)), BOX, z) == np.pi).all()
