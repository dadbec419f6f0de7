"""Etendue of source, lens and target of a problem, and the size of the source's image."""

from math import atan, degrees, log, pi, radians, sin, sqrt

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.integrate import dblquad
from scipy.optimize import minimize

from optics.designing.etendue.throughput_bound import (
    RAYS,
    aperture_etendue,
    brightest,
    front_fraction,
    image_half_width,
    least_mean,
    rear_area,
    spread,
    throughput,
)
from optics.light.blur import patch_images
from optics.light.tracing import Tracer
from tests.cases import examples
from tests.optics.cases import example_system, hollow_lens, small_system, target_z, tracer_to

LAMBERTIAN = {"source.kind": "lambertian", "source.half_width": [0.5, 0.25], "source.distance": 20.0}
FLAT = {"lens.rear.radius": float("inf"), "lens.rear.conic": 0.0}


def parallel_rectangles(a, b, distance):
    """Return the etendue pi A_1 F_12 of two coaxial parallel rectangles of half-widths a and b in closed
    form.

    Source: J. R. Ehlert, T. F. Smith, View factors for perpendicular and parallel rectangular plates, J.
    Thermophysics 7 (1993).
    """

    def corner(x, y):
        wide, tall = sqrt(x * x + distance**2), sqrt(y * y + distance**2)
        return (
            y * wide * atan(y / wide)
            + x * tall * atan(x / tall)
            - distance**2 / 2 * log(x * x + y * y + distance**2)
        )

    return (
        sum(
            i * j * k * m * corner(i * a[0] - j * b[0], k * a[1] - m * b[1])
            for i in (1, -1)
            for j in (1, -1)
            for k in (1, -1)
            for m in (1, -1)
        )
        / 2
    )


@pytest.mark.parametrize("half_angle", [90.0, 30.0])
def test_etendue_of_sources(tmp_path, half_angle):
    glowing = LAMBERTIAN | {"source.half_angle": half_angle}
    square, disk = (
        small_system(tmp_path, glowing | {"source.profile": name}) for name in ("uniform", "round")
    )
    etendue = square.source.etendue
    assert etendue == pytest.approx(pi * 0.5 * sin(radians(half_angle)) ** 2, rel=1e-14)
    assert disk.source.etendue == pytest.approx(pi / 4 * etendue, rel=1e-14)


@pytest.mark.parametrize("changes", [{}, {"source.kind": "point", "source.distance": 20.0}])
def test_sources_without_extent_have_none(tmp_path, changes):
    found = throughput(small_system(tmp_path, changes, drop=("source.half_width",) if changes else ()))
    assert (found.source, found.front, found.radiance) == (0, 0, float("inf"))
    assert 0 < found.meets_front <= 1


@pytest.mark.parametrize("distance", [60.0, 1000.0])
def test_etendue_between_aperture_and_target(tmp_path, distance):
    """Against the closed form; 8 nodes of Gauss's rule are exact for polynomials of degree 15 in (10 /
    60)."""
    sizes = {"target.half_width": [20.0, 35.0], "lens.rear.half_width": [10.0, 7.0]}
    found = aperture_etendue(small_system(tmp_path, sizes | {"target.distance": distance}))
    assert found == pytest.approx(parallel_rectangles((10.0, 7.0), (20.0, 35.0), distance), rel=1e-8)


def test_etendue_between_a_round_aperture_and_the_target(tmp_path):
    """Against the view of a disk from an element parallel to it, over the target (Howell, factor B-13)."""
    sizes = {"target.half_width": [20.0, 35.0], "target.distance": 30.0, "lens.outline": "round"}
    found = aperture_etendue(small_system(tmp_path, sizes))

    def seen(y, x, a=10.0, h=30.0):
        far = x * x + y * y + h * h
        return pi / 2 * (1 - (far - a * a) / sqrt((far + a * a) ** 2 - 4 * (x * x + y * y) * a * a))

    assert found == pytest.approx(4 * dblquad(seen, 0, 20, 0, 35)[0], rel=1e-6)


def test_the_far_field_is_the_limit_of_distance(tmp_path):
    """The aperture's extent matters by (10 / distance)^2."""
    distance, angles = 1e5, [30.0, 20.0]
    sides = [distance * np.tan(np.radians(a)) for a in angles]
    far, near = (
        aperture_etendue(small_system(tmp_path, {"target.distance": d, "target.half_width": half}))
        for d, half in ((float("inf"), angles), (distance, sides))
    )
    assert far == pytest.approx(near, rel=1e-7)


def test_pixels_see_at_most_the_area_of_the_rear(tmp_path):
    """A flat aperture sees cos^4 / D^2 of what a turned one of its area could, cos^3 / D^2; the nearest
    places count."""
    system = small_system(tmp_path, FLAT | {"target.half_width": [40.0, 30.0]})
    most = (rear_area(system.base) / spread(system)).sum() * system.target.screen().pixel_area
    assert aperture_etendue(system) < most < 1.5 * aperture_etendue(system)
    axis = small_system(tmp_path, FLAT | {"target.half_width": [0.1, 0.1]})
    np.testing.assert_allclose(spread(axis), 59.0**2)  # the rear may rise by z_freedom = 1 mm
    aside = small_system(tmp_path, FLAT | {"target.half_width": [4000.0, 0.1], "target.pixels": [2000, 2]})
    edge = 4000.0 - 4.0 - 10.0
    assert spread(aside)[0, -1] == pytest.approx((61.0**2 + edge**2) ** 1.5 / 61.0)


def test_light_aside_of_a_round_lens_comes_farther_than_of_its_square(tmp_path):
    """The distance of a pixel's nearest corner from a circle, and of one from the corner of a rectangle."""
    place = {"target.half_width": [400.0, 300.0], "target.pixels": [40, 30], "lens.rear.radius": 40.0}
    square, disk = (
        small_system(tmp_path, place | {"lens.outline": name, "lens.rear.conic": -1.0})
        for name in ("rectangle", "round")
    )
    # the rear is 1 mm free, and rises from its vertex by r^2 / 80 at r^2 = 200 or 100; the polygon around a
    # circle reaches 0.12 % farther
    for system, aside, rim in (
        (square, np.hypot(370.0, 270.0), 200 / 80),
        (disk, np.hypot(380.0, 280.0) - 10.0, 1.25),
    ):
        far = 61.0
        assert spread(system)[0, 0] == pytest.approx((far**2 + aside**2) ** 1.5 / far, rel=1e-12)
        near = 60.0 - rim - 1.0
        assert spread(system)[15, 20] == pytest.approx(near**2, rel=2e-4)


def test_solid_angle_of_pixels_in_the_far_field(tmp_path):
    system = small_system(tmp_path, {"target.distance": float("inf"), "target.half_width": [30.0, 20.0]})
    total = (1 / spread(system)).sum() * system.target.screen().pixel_area
    a, b = np.tan(np.radians([30.0, 20.0]))
    assert total == pytest.approx(4 * atan(a * b / sqrt(1 + a * a + b * b)), rel=1e-4)  # of a pyramid


def test_area_of_a_paraboloid(tmp_path):
    """z = r^2 / (2 R): over a disk 2 pi R^2 / 3 ((1 + r^2 / R^2)^(3/2) - 1); over the square by quadrature of
    scipy."""
    lens = small_system(tmp_path).base
    expected = dblquad(lambda y, x: sqrt(1 + (x * x + y * y) / 1600), -10, 10, -10, 10)[0]
    assert rear_area(lens) == pytest.approx(expected, rel=1e-7)


def test_area_and_light_of_a_round_lens(tmp_path, backend):
    """The area of a paraboloid over its disk; light beside the front is that of a trace of the same rays."""
    near = {"source.kind": "lambertian", "source.half_angle": 90.0, "source.distance": 4.0}
    system = small_system(tmp_path, {**near, "lens.outline": "round"})
    lens, r = system.base, system.base.rear.half_width[0] / 40
    # pixels that the circle cuts count whole or not: r / 512 of it, at random
    assert rear_area(lens) == pytest.approx(2 * pi * 40**2 / 3 * ((1 + r * r) ** 1.5 - 1), rel=1e-6)
    rays = system.source.rays(RAYS)
    tracer = Tracer(backend, system.with_lens(lens).path, rays)
    _, landing = tracer.trace()
    beside = tracer.fates(landing, system.target.settings.half_width).by_name["beside_lens"]
    assert front_fraction(system) == pytest.approx(1 - beside / rays.total, abs=1e-12)


def test_share_that_meets_a_plane_front(tmp_path):
    """A small source on the axis: the closed projected solid angle of a square over pi.

    Independent random rays, 2^15 with three mirror images each, would err by sqrt(0.24 0.76 / 2^15) = 2.4e-3;
    Sobol points err less.
    """
    found = front_fraction(small_system(tmp_path, LAMBERTIAN | {"source.half_width": [1e-3, 1e-3]}))
    ratio = 10 / 20
    wide = sqrt(1 + ratio**2)
    assert found == pytest.approx(4 * ratio / wide * atan(ratio / wide) / pi, abs=2.4e-3)


@pytest.mark.parametrize("distance", [0.5, 2.0, 8.0])
def test_share_that_meets_a_hollow_front(backend, tmp_path, distance):
    """Ray by ray as the tracer decides."""
    front = {
        "lens.front.radius": -5.0,
        "lens.front.conic": -1.0,
        "lens.front.half_width": [5.0, 5.0],
        "lens.rear.half_width": [8.0, 8.0],
    }
    changes = front | {"source.distance": distance, "lens.rear.radius": -10.0}
    system = small_system(tmp_path, LAMBERTIAN | changes)
    lens, problem = system.base, system.problem
    tracer = tracer_to(backend, lens, system.source.rays(RAYS), target_z(problem))
    with backend.dr.suspend_grad():
        _, landing = tracer.trace([sag.coefficients for sag in lens.sags])
    beside = tracer.fates(landing, problem.target.half_width).by_name["beside_lens"]
    assert front_fraction(system) == pytest.approx(1 - beside, abs=1e-12)


def test_a_picture_is_as_bright_as_its_brightest_place(tmp_path):
    system = small_system(tmp_path, LAMBERTIAN | {"source.profile": "gaussian", "source.sigma": [0.3, 0.3]})
    s = (np.arange(1000) + 0.5) / 500 - 1
    expected = 1 / np.exp(-0.5 * (s / 0.3) ** 2).mean() ** 2
    assert brightest(system.source.profile) == pytest.approx(expected, rel=1e-5)
    assert half_width(system, 1.0)[0] < half_width(small_system(tmp_path, LAMBERTIAN), 1.0)[0]


def half_width(system, share, rel_l2=float("inf")):
    return image_half_width(system, share, rel_l2)


def test_size_of_images(tmp_path):
    """w^2 = D^2 U / S with U = pi / 2, S = 400 and D from the highest place of the rear (z_freedom = 1):
    proportions 2 to 1."""
    wide, high = half_width(small_system(tmp_path, LAMBERTIAN | FLAT), 0.5)
    assert wide == pytest.approx(2 * high)
    assert 4 * wide * high == pytest.approx(59.0**2 * 0.5 * pi / 2 / 400)
    far = small_system(tmp_path, LAMBERTIAN | FLAT | {"target.distance": float("inf")})
    # the middle pixels of the far field are half a pixel off the axis: 1e-4
    assert half_width(far, 0.5)[0] == pytest.approx(degrees(wide / 59.0), rel=1e-3)


def test_light_aside_comes_in_larger_images(tmp_path):
    """The spread of the one bright pixel; the nearer the light to the target, the surer."""
    light = np.zeros((48, 48), dtype=np.uint8)
    light[20, 47] = 255
    wide = {"target.half_width": [90.0, 90.0], "target.fit": "stretch"}
    system = small_system(tmp_path, LAMBERTIAN | FLAT | wide, light)
    sure, likely, any_light = (half_width(system, 0.5, error)[0] for error in (0.0, 0.5, float("inf")))
    assert any_light < likely < sure
    # the search for the multiplier starts at rel_l2 = 1e-3
    assert 2 * sure**2 == pytest.approx(spread(system)[20, 47] * 0.5 * pi / 2 / 400, rel=1e-2)


@examples(60)
@given(st.integers(0, 2**32 - 1), st.floats(0.05, 1.0))
def test_the_least_mean_is_that_of_convex_optimisation(seed, error):
    rng = np.random.default_rng(seed)
    values, picture = rng.uniform(1, 9, 8), rng.exponential(size=8) * (rng.uniform(size=8) > 0.3) + 1e-3
    picture /= picture.mean()
    allowed = error**2 * (picture**2).mean()
    # SLSQP may stop early and says so only sometimes: the best of some starts
    starts = [picture, np.ones(8), *(8 * rng.dirichlet(np.ones(8), 4))]
    found = [
        minimize(
            lambda e: (e * values).mean(),
            start,
            jac=lambda e: values / 8,
            bounds=[(0, None)] * 8,
            method="SLSQP",
            constraints=[
                {"type": "eq", "fun": lambda e: e.mean() - 1, "jac": lambda e: np.full(8, 1 / 8)},
                {
                    "type": "ineq",
                    "fun": lambda e: allowed - ((e - picture) ** 2).mean(),
                    "jac": lambda e: (picture - e) / 4,
                },
            ],
            options={"ftol": 1e-10},
        )
        for start in starts
    ]
    least = min(
        f.fun for f in found if f.success and f.fun and allowed - ((f.x - picture) ** 2).mean() > -1e-7
    )
    bound = least_mean(values, picture, error)
    # SLSQP keeps its constraints to about 1e-8
    assert bound <= least + 1e-6
    assert bound >= least - 1e-3 * (values.max() - values.min())
    assert least_mean(values, picture, float("inf")) == values.min()


@pytest.mark.slow
def test_images_of_a_lens_are_as_large_as_etendue_says(backend):
    """The images' areas over the middle of the rear are at least the flux times D^2 / cos^3 there over L,
    losses given back.

    In the hollow lens rays leave the rear within 35 degrees of its normal: at most 20 % more.
    """
    system, lens = example_system("extended"), hollow_lens()
    images = patch_images(system.with_lens(lens), backend)
    patches = len(images.flux)
    at = (2 * np.arange(patches) + 1) / patches - 1
    middle = np.ix_(*[np.abs(at) < 0.5] * 2)
    zx, zy = (lens.rear.grid(8 * at, 8 * at, d) for d in ((1, 0), (0, 1)))
    areas = (np.prod(images.width, axis=0) * np.sqrt(1 + zx * zx + zy * zy))[middle].sum() * (
        16 / patches
    ) ** 2
    problem, rays = system.problem, system.source.rays((512, 512))
    tracer = tracer_to(backend, lens, rays, target_z(problem))
    coefficients = [sag.coefficients for sag in lens.sags]
    with backend.dr.suspend_grad():
        hits, _, _ = tracer.at(1, coefficients)
        _, landing = tracer.trace(coefficients)
        x, y, z, p, q, flux = (
            a.numpy() for a in (hits.x, hits.y, hits.z, landing.p, landing.q, landing.flux)
        )
    through = (flux > 0) & (np.abs(x) < 4) & (np.abs(y) < 4)
    distances = (problem.target.distance - z) ** 2 / (1 - p * p - q * q) ** 1.5
    radiance = problem.source.flux / system.source.etendue
    least = (rays.flux[through] * distances[through]).sum() / radiance
    assert least < areas < 1.2 * least
    assert 0 < images.smallest(0.05) <= images.smallest(0.5) < np.nanmax(np.prod(images.width, axis=0))
