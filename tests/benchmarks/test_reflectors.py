"""Mirrors before light and charts of a script's own, by the public API, and the distance that judges them."""

import pickle

import numpy as np
import pytest

import optics
from benchmarks.checkout import EXAMPLES
from benchmarks.reflectors.far_sight import squared_distance
from benchmarks.reflectors.own_light import BACKWARD, Stereographic, StereographicPoint
from benchmarks.reflectors.reflectors import CASES, MIRROR
from benchmarks.reflectors.sloped_light import SlopedArea
from benchmarks.reflectors.wasserstein import distance, drawn_points
from optics.base.runtime import UserError
from optics.scene.problem import load_problem

SPHERE = {
    "source.distance": 100.0,
    "element.M1.face.half_width": [45.0, 45.0],
    "element.M1.face.radius": -100.0,
    "element.M1.face.conic": 0.0,
    "element.M1.face.freeform": {"z_freedom": 5.0, "spans": [4, 4], "max_level": 1},
    "target.kind": "tophat",
    "target.half_width": [0.3, 0.3],
    "target.lit": [2 / 3, 2 / 3],
    "target.pixels": [24, 24],
    "optimizer.iterations": [20],
}


def problem_of(**changes):
    return load_problem(EXAMPLES / "lamp_reflector.toml").with_(**(MIRROR | SPHERE | changes))


def own_light():
    return StereographicPoint(flux=1.0, distance=100.0, half=0.2), Stereographic(BACKWARD)


def test_a_sphere_sends_light_of_a_source_of_ones_own_back_along_the_way_it_came():
    """So a square of even intensity is one in the chart, whose borders are pixels'."""
    system = optics.System(problem_of(), *own_light())
    base = system.base
    found = system.measure(base)
    # a target takes d Omega / (du dv) ~ 1 - 2 w in the middles of pixels p wide: they lack 8 p^2 / 24 of it
    assert found.metrics["rel_l2"] < 0.025**2 / 3
    assert found.metrics["efficiency"] == pytest.approx(1.0, abs=1e-12)
    again = pickle.loads(pickle.dumps(system))
    np.testing.assert_array_equal(again.measure(base).irradiance, found.irradiance)


def test_a_plane_mirror_keeps_the_slopes_of_light_of_ones_own():
    """(p, q) = 2 (u, v) / (1 - w), w = u^2 + v^2: even slopes are 4 (1 + w) / (1 - w)^3 of their density."""
    plane = {
        "element.M1.face.radius": np.inf,
        "target.half_width": [0.25, 0.25],
        "target.pixels": [8, 8],
        "target.lit": [1.0, 1.0],
    }
    source = SlopedArea(flux=1.0, distance=40.0, half=3.0, reach=0.9, round=True)
    chart = Stereographic(BACKWARD, per_solid_angle=False)
    system = optics.System(problem_of(**plane), source, chart)
    found = system.measure(system.base)
    u = np.linspace(-0.25, 0.25, 8 * 10 + 1)
    w = ((u[:-1] + u[1:]) / 2) ** 2 + ((u[:-1, None] + u[1:, None]) / 2) ** 2
    even = 4 * (1 + w) / (1 - w) ** 3 / (np.pi * 0.9**2)
    # the standard error of the estimate, relative to the light; rms over 64 pixels
    error = 2 * found.metrics["rel_l2_floor"]
    np.testing.assert_array_less(
        rms(found.irradiance / even.reshape(8, 10, 8, 10).mean(axis=(1, 3)) - 1), error
    )


def rms(values):
    return np.sqrt(np.mean(np.square(values)))


def test_the_exact_map_of_turned_light_sends_each_circle_the_share_asked_for():
    """exp(-16 r^2) per solid angle on a square: by sums over circles, of points drawn otherwise."""
    case = CASES["4: disk to Gaussian"]
    sent = np.hypot(*case.perfect_landing().T)
    asked = np.hypot(*case.drawn(7).T)
    shares = [0.02, 0.2, 0.5, 0.8, 0.98]
    np.testing.assert_allclose(np.quantile(sent, shares), np.quantile(asked, shares), atol=1.5e-3)


@pytest.mark.slow
def test_a_design_finds_the_sphere_and_has_no_problem_file():
    flat = problem_of(**{"element.M1.face.conic": -1.0, "element.M1.face.radius": -120.0})
    source, receiver = own_light()
    design = optics.design(flat, source=source, receiver=receiver)
    assert design.metrics["rel_l2"] < 0.02
    x = np.linspace(-30, 30, 7)
    z = design.lens.front.grid(x, x) + source.distance
    radius = np.sqrt(x[:, None] ** 2 + x**2 + z**2)
    assert np.std(radius) < 1e-3 * np.mean(radius)
    with pytest.raises(UserError, match="cannot be saved, as no problem file describes it"):
        design.save("anywhere")


@pytest.mark.parametrize("stretch", [np.eye(2), [[1.3, 0.2], [0.2, 0.8]]])
def test_the_distance_of_points_from_their_images_by_a_convex_gradient_is_how_far_these_move(stretch):
    """Brenier: x -> A x + b with A positive definite pairs them at least cost, however they are listed."""
    points = drawn_points(1 << 9, 0.6, np.ones((4, 4)), seed=3)
    images = points @ stretch + (0.02, -0.01)
    mixed = np.random.default_rng(4).permutation(images)
    moved = np.sqrt(np.mean(np.sum((images - points) ** 2, axis=1)))
    assert distance(points, mixed) == pytest.approx(moved, rel=1e-12)


def test_drawn_points_spread_like_their_density():
    density = np.outer([1.0, 3.0, 0.0, 4.0], [2.0, 1.0, 1.0, 0.0])
    points = drawn_points(1 << 12, 1.0, density, seed=0)
    counts = np.histogram2d(*points.T, bins=4, range=[(-1, 1)] * 2)[0]
    # 2^12 Sobol points: each strip of u holds its share to a few points
    np.testing.assert_allclose(counts / 2**12, density / density.sum(), atol=4e-3)
    assert not counts[density == 0].any()


def test_the_far_sighted_loss_of_light_moved_a_little_is_the_square_of_how_far():
    """A Gaussian moved along x by d has W2 = d; light that is missing everywhere alike has not moved."""
    sigma, moved, rng = 0.1, 1e-3, np.random.default_rng(5)
    x, y = (h * (2 * np.arange(n) + 1 - n) / n for h, n in ((0.5, 80), (0.6, 96)))
    first, second = (
        np.exp(-((x - d) ** 2 + y[:, None] ** 2) / (2 * sigma**2)) / (2 * np.pi * sigma**2 * 6400)
        for d in (0.0, moved)
    )
    squared = squared_distance(first, (0.5, 0.6))
    off = (second - first) / first.sum()
    # tails beyond 3.7 sigma, of 1e-3 of the light, count less: DARKEST lifts their weight
    assert squared(off)[0] == pytest.approx(moved**2, rel=0.02)
    assert squared(-0.01 * first / first.sum())[0] == pytest.approx(0, abs=1e-18)
    along = rng.standard_normal(off.shape)
    ahead, behind = (squared(off + step * along)[0] for step in (1e-3, -1e-3))
    assert np.vdot(squared(off)[1], along) == pytest.approx((ahead - behind) / 2e-3, rel=1e-6)
