"""The universal bound: what etendue forbids every lens of a problem."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.optimize import lsq_linear

import optics
from optics.designing.etendue import universal_bound
from optics.designing.etendue.brightness_limit import least_distance
from optics.scene.system import System
from tests.cases import examples
from tests.optics.cases import HOLLOW, flat_problem, small_system

SMALL_TARGET = HOLLOW | {
    "source.kind": "lambertian",
    "source.half_width": [4.0, 4.0],
    "source.distance": 7.0,
    "target.kind": "tophat",
    "target.shape": "ellipse",
    "target.distance": 50.0,
    "target.half_width": [20.0, 20.0],
    "target.pixels": [32, 32],
}
SEEDS = st.integers(0, 2**32 - 1)


@examples(60)
@given(SEEDS, st.floats(0.3, 4.0))
def test_the_least_distance_is_that_of_a_general_solver(seed, brightness):
    """Bounded least squares with the mean as a row of great weight, whose error is about 1 / weight^2."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 12))
    goal = rng.exponential(size=n) * (rng.uniform(size=n) > 0.3) + 1e-3
    most = brightness * rng.exponential(size=n) * (rng.uniform(size=n) > 0.1)
    found = least_distance(goal, most)
    if most.sum() < goal.sum():
        assert found is None
        return
    weight = 1e5
    rows = np.vstack([np.eye(n), weight * np.ones(n)])
    right = np.append(goal, weight * goal.sum())
    best = lsq_linear(rows, right, (0, np.maximum(most, 1e-12)), "bvls", tol=1e-15, max_iter=5000).x
    expected = np.linalg.norm(best - goal) / np.linalg.norm(goal)
    assert found == pytest.approx(expected, abs=1e-7)


@examples(40)
@given(SEEDS)
def test_no_light_below_the_caps_is_nearer(seed):
    rng = np.random.default_rng(seed)
    goal, most = rng.uniform(size=(6, 7)) ** 3, rng.uniform(0.2, 1.5, (6, 7))
    share = rng.uniform(size=(6, 7))
    light = most * share
    light *= goal.sum() / light.sum()
    if (light > most).any():
        most = np.maximum(most, light)
    assert least_distance(goal, most) <= np.linalg.norm(light - goal) / np.linalg.norm(goal)


def test_light_within_the_caps_is_not_forbidden():
    goal = np.array([[1.0, 2.0], [0.0, 3.0]])
    assert least_distance(goal, goal) == 0
    assert least_distance(goal, goal + np.eye(2)) == 0
    # one unit of the brightest pixel goes to the three others, a third each
    assert least_distance(goal, np.array([[9.0, 9.0], [9.0, 2.0]])) == pytest.approx(
        np.sqrt((1 + 3 / 9) / 14), rel=1e-12
    )


@pytest.fixture
def small(tmp_path):
    return universal_bound(small_system(tmp_path, SMALL_TARGET))


def test_the_least_error_grows_with_the_efficiency_until_no_light_has_it(small):
    curve = dict(small.curve())
    assert list(curve) == pytest.approx([k / 10 for k in range(1, 11)])
    some = [least for least in curve.values() if least is not None]
    assert some == sorted(some)
    assert some[0] == 0 < some[-1]
    reachable = small.most_on_target / small.flux
    assert all((least is None) == (efficiency > reachable) for efficiency, least in curve.items())


def test_the_picture_is_forbidden_from_its_efficiency_on(small):
    exact = small.exact_efficiency
    assert 0 < exact < 1
    assert small.least_rel_l2(exact * (1 - 1e-9)) == 0
    assert small.least_rel_l2(1.05 * exact) > 0


def test_the_brightest_light_fills_the_silhouette(small):
    """Radiance 1 / (64 pi) W / (mm^2 sr), and P between those of squares as deep as rear rim and vertex."""
    area = 40.0**2
    low, high = (a / np.sqrt(1 + a * a) for a in (8 / (50 + 6.4 + 1), 8 / (50 - 1)))
    assert small.most_on_lit < small.most_on_target == pytest.approx(small.most.sum())
    assert 4 * low * np.arctan(low) < 64 * np.pi * small.peak < 4 * high * np.arctan(high)
    assert small.peak * area > small.most_on_target


def test_a_brighter_source_forbids_less(tmp_path):
    """The same flux from a quarter of the area has four times the radiance."""
    narrow, wide = (
        universal_bound(small_system(tmp_path, SMALL_TARGET | {"source.half_width": [half, half]}))
        for half in (2.0, 4.0)
    )
    np.testing.assert_allclose(narrow.most, 4 * wide.most)
    assert narrow.least_rel_l2(0.5) < wide.least_rel_l2(0.5)


def test_directions_have_a_bound_too(tmp_path):
    """The whole sphere of directions in view takes the flux; a narrow cone A Omega L."""
    far = {"target.distance": float("inf"), "target.half_width": [2.0, 2.0]}
    found = universal_bound(small_system(tmp_path, SMALL_TARGET | far))
    omega = np.radians(4.0) ** 2
    # the rear's square of 16 x 16 mm is the shadow on the axis; edges of 13 mm add tan(2 degrees) of it
    assert found.most_on_target == pytest.approx(256 * omega / (64 * np.pi), rel=0.1)
    assert found.least_rel_l2(0.9 * found.most_on_target) > 0
    assert found.least_rel_l2(1.0) is None


def test_no_bound_forbids_the_light_of_a_wide_beam_through_a_thin_plate():
    """Close behind a wide plate every point sees the whole cone: E is the flux over the source's area."""
    plain = {"half_width": (10.0, 10.0), "reflectance": 0.0}
    wide = optics.Problem(
        title="a thin plate in a beam of 60 degrees",
        source=optics.Source(kind="collimated", half_width=(10.0, 10.0), distance=0.1, divergence=60.0),
        lens=optics.LensSpec(
            index=1.5,
            thickness=0.2,
            front=optics.Front(**plain),
            rear=optics.Rear(**plain, freeform=optics.Freeform(spans=(2, 2), z_freedom=1e-3)),
        ),
        target=optics.Target(
            kind="tophat", shape="rectangle", distance=5.0, half_width=(0.5, 0.5), pixels=(4, 4)
        ),
    )
    bound = universal_bound(System(wide))
    assert bound.peak >= 1 / 400
    assert bound.most_on_target >= 1 / 400


@pytest.mark.parametrize("outline", ["round", "ellipse", "rounded", "rectangle"])
def test_the_brightest_pixel_is_the_radiance_times_the_area_within_the_outline(outline):
    """Of 1000 lm from 1 mm^2 into pi sr, in cd along the axis of a flat lens; its walls add a little."""
    half = (10.0, 6.0) if outline == "ellipse" else (10.0, 10.0)
    corner = {"corner_radius": 4.0} if outline == "rounded" else {}
    face = {"half_width": half, "freeform": {"spans": (2, 2), "z_freedom": 1e-4}}
    problem = flat_problem(
        {"kind": "lambertian", "half_width": (0.5, 0.5), "distance": 5.0, "flux": 1000.0, "unit": "lm"},
        {"distance": np.inf, "half_width": (0.5, 0.5), "pixels": (8, 8)},
        {"outline": outline, "front": {"half_width": half}, "rear": face} | corner,
    )
    a, b = half
    area = {
        "round": np.pi * a * b,
        "ellipse": np.pi * a * b,
        "rounded": 4 * a * b - (4 - np.pi) * 4.0**2,
        "rectangle": 4 * a * b,
    }[outline]
    bound = universal_bound(System(problem))
    candela = bound.peak * np.degrees(1.0) ** 2
    walls = 2 * np.hypot(a, b) * problem.lens.thickness * np.tan(np.radians(0.5)) * 2**0.5
    assert 1000 / np.pi * area <= candela <= 1000 / np.pi * 1.003 * (area + walls)
