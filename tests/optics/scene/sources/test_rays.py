"""Rays of glowing areas and of points: moments, symmetry, flux within cones, against closed forms."""

from math import asin, cos, pi, radians, sin

import numpy as np
import pytest
from scipy.stats import truncnorm

from optics.scene.sources.collimated import collimated_beam
from optics.scene.sources.profile import Profile
from optics.scene.sources.rays import Rays, single_rays
from optics.scene.sources.spreading import concentric, point_rays
from tests.optics.cases import lambertian_parts, small_lens
from thbcad.sags import Conic

HALF_WIDTH = 0.5, 0.25
DISTANCE, FLUX = 2.0, 3.0
COUNT = 1 << 14
LIGHT = np.array([[1.0, 0.5, 0.0], [2.0, 0.25, 3.0]])  # rows, columns; row 0 at +y
EVEN = Profile()
PROFILES = [
    EVEN,
    Profile("round"),
    Profile("gaussian", (0.4, 0.7)),
    Profile("image", light=LIGHT),
    Profile("round_gaussian", (0.4, 0.7)),
]


def lambertian(half_angle=90.0, profile=EVEN, count=COUNT, seed=0, most=1 << 62):
    """Return a Lambertian source's rays in one piece."""
    parts = lambertian_parts(HALF_WIDTH, DISTANCE, FLUX, half_angle, profile, count, seed, most)
    return Rays.joined([*parts])


def point(half_angle=60.0, exponent=1.0, counts=(64, 48), shift=(0.0, 0.0)):
    return point_rays(DISTANCE, FLUX, half_angle, exponent, counts, shift)


def mean(rays, values):
    """Return the mean of values over the rays, weighted by their flux."""
    flux = rays.flux
    return np.sum(flux * values) / flux.sum()


def sobol_error(count=COUNT):
    """Return a bound of the error of means of smooth functions of size 1 over `count` scrambled Sobol points.

    Random points err by count^-1/2, one standard deviation; Sobol points by less, at 2^14 by a factor of ten
    and more.
    """
    return count**-0.5


# Both kinds


@pytest.mark.parametrize(
    "rays",
    [
        lambertian(),
        lambertian(35.0),
        lambertian(profile=PROFILES[1]),
        point(),
        point(90.0, 0.0),
        point(5.0, 80.0, (17, 33), (0.5, -0.5)),
    ],
    ids=["lambertian", "cone", "disk", "point", "half space", "beam"],
)
def test_rays_go_forward_from_the_plane_of_the_source(rays):
    """Unit vectors: sums of three squares and a root, each rounded once."""
    np.testing.assert_allclose(np.linalg.norm(rays.direction, axis=0), 1, rtol=0, atol=4e-16)
    assert (rays.direction[2] >= 0).all()
    assert (rays.origin[2] == -DISTANCE).all()
    assert np.asarray(rays.flux).min() > 0
    assert rays.total == pytest.approx(FLUX, rel=1e-12)


def as_rows(rays, sign_x, sign_y):
    """Return the rays' numbers mirrored, one row per ray, in a fixed order."""
    signs = np.array([[sign_x], [sign_y], [1.0]])
    rows = np.concatenate([signs * rays.origin, signs * rays.direction, rays.flux[None]]).T + 0.0  # -0 is 0
    return rows[np.lexsort(rows.T)]


SYMMETRIC = {
    **{profile.kind: lambertian(70.0, profile, 1 << 10) for profile in PROFILES[:3]},
    "scrambled again": lambertian(70.0, count=1 << 10, seed=77),
    "few": lambertian(count=4),
    "point": point(counts=(16, 24)),
    "odd point": point(80.0, 3.0, (15, 9)),
}


@pytest.mark.parametrize("sign", [(-1, 1), (1, -1), (-1, -1)])
@pytest.mark.parametrize("rays", SYMMETRIC.values(), ids=SYMMETRIC.keys())
def test_a_set_of_rays_is_its_own_mirror_image_bit_for_bit(rays, sign):
    np.testing.assert_array_equal(as_rows(rays, *sign), as_rows(rays, 1, 1))


# Glowing areas


@pytest.mark.parametrize("half_angle", [90.0, 40.0, 3.0])
def test_a_glowing_rectangle_has_the_moments_of_uniform_light(half_angle):
    """<x^2> = h^2 / 3, <p^2> = <q^2> = sin^2 / 4; whatever is odd in x, p or in y, q vanishes; position and
    direction are independent."""
    rays = lambertian(half_angle)
    (x, y, _), (p, q, cosine) = rays.origin, rays.direction
    reach = sin(radians(half_angle))
    for a in (x, y, p, q, x * y, x * q, y * p, p * q):
        assert abs(mean(rays, a)) < 1e-15  # every ray has its mirror images
    for a, reach_of_x in ((x * p, HALF_WIDTH[0]), (y * q, HALF_WIDTH[1])):
        assert abs(mean(rays, a)) < sobol_error() * reach * reach_of_x
    scaled = [(x / HALF_WIDTH[0]) ** 2, (y / HALF_WIDTH[1]) ** 2, (p / reach) ** 2, (q / reach) ** 2]
    for a, expected in zip(scaled, (1 / 3, 1 / 3, 1 / 4, 1 / 4)):
        assert mean(rays, a) == pytest.approx(expected, abs=sobol_error())
    for k in range(4):
        for m in range(k):
            assert mean(rays, scaled[k] * scaled[m]) == pytest.approx(
                mean(rays, scaled[k]) * mean(rays, scaled[m]) if {k, m} != {2, 3} else 1 / 24,
                abs=sobol_error(),
            )  # <p^2 q^2> over a disk of radius 1 is 1 / 24
    assert mean(rays, cosine) == pytest.approx(
        2 / 3 * (1 - cos(radians(half_angle)) ** 3) / reach**2, abs=sobol_error()
    )
    assert np.hypot(p, q).max() <= reach * (1 + 1e-15)


@pytest.mark.parametrize("inner", [10.0, 30.0, 60.0, 85.0])
def test_a_glowing_area_sends_the_square_of_the_sine_into_a_cone(inner):
    rays = lambertian(90.0)
    within = rays.direction[2] >= cos(radians(inner))
    assert mean(rays, within) == pytest.approx(sin(radians(inner)) ** 2, abs=sobol_error())


def test_a_disk_is_even_over_its_ellipse():
    """<x^2> = h^2 / 4 over an ellipse; a share r^2 of the light within the ellipse r times as large."""
    rays = lambertian(60.0, Profile("round"))
    s, t = (rays.origin[k] / HALF_WIDTH[k] for k in (0, 1))
    assert np.hypot(s, t).max() <= 1 + 1e-15
    assert np.ptp(rays.flux) == 0
    assert [mean(rays, s * s), mean(rays, t * t)] == pytest.approx([1 / 4, 1 / 4], abs=sobol_error())
    for r in (0.3, 0.6, 0.9):
        assert mean(rays, np.hypot(s, t) < r) == pytest.approx(r * r, abs=sobol_error())


def test_a_gaussian_area_follows_its_profile():
    """Rays of equal flux whose positions are distributed as a Gaussian cut off at the rectangle: scipy's
    truncnorm."""
    rays = lambertian(60.0, PROFILES[2])
    np.testing.assert_allclose(rays.flux, FLUX / COUNT, rtol=1e-15)
    for k, sigma in ((0, 0.4), (1, 0.7)):
        s = rays.origin[k] / HALF_WIDTH[k]
        assert np.abs(s).max() <= 1
        for edge in (-0.8, -0.2, 0.1, 0.6):
            assert mean(rays, s < edge) == pytest.approx(
                truncnorm(-1 / sigma, 1 / sigma, scale=sigma).cdf(edge), abs=sobol_error()
            )


def test_a_picture_glows_pixel_by_pixel():
    """Row 0 at +y, column 0 at -x; a picture without symmetry shows on rays with all their mirror images."""
    rays = lambertian(60.0, PROFILES[3])
    s, t = (rays.origin[k] / HALF_WIDTH[k] for k in (0, 1))
    for row in range(2):
        for column in range(3):
            here = (np.floor((s + 1) * 1.5) == column) & ((t > 0) == (row == 0))
            share = rays.flux[here].sum() / FLUX
            assert share == pytest.approx(LIGHT[row, column] / LIGHT.sum(), abs=2 * sobol_error())


@pytest.mark.parametrize("profile", PROFILES, ids=lambda p: p.kind)
def test_any_profile_carries_the_flux(profile):
    """Exact where all rays carry the same; otherwise as good as the mean of the density over the points."""
    error = 1e-13 if profile.kind in ("uniform", "round") else 2 * sobol_error()
    assert lambertian(profile=profile).total == pytest.approx(FLUX, rel=error)


@pytest.mark.filterwarnings("ignore:The balance properties of Sobol")
@pytest.mark.parametrize("most", [4, 100, 1 << 10, 5000])
@pytest.mark.parametrize("profile", [PROFILES[0], PROFILES[2]], ids=["uniform", "gaussian"])
def test_parts_make_up_the_whole(most, profile):
    count = 1 << 12 if most > 4 else 1 << 6
    parts = list(lambertian_parts(HALF_WIDTH, DISTANCE, FLUX, 80.0, profile, count, 5, most))
    assert max(p.origin.shape[1] for p in parts) <= most
    whole = lambertian(80.0, profile, count, 5)
    np.testing.assert_array_equal(
        as_rows(lambertian(80.0, profile, count, 5, most), 1, 1), as_rows(whole, 1, 1)
    )
    assert sum(p.total for p in parts) == pytest.approx(whole.total, rel=1e-13)


def test_another_seed_is_another_set_of_the_same_light():
    one, other = lambertian(seed=1), lambertian(seed=2)
    assert not np.isin(one.origin[0], other.origin[0]).any()
    assert one.total == other.total
    np.testing.assert_array_equal(lambertian(seed=1).origin, one.origin)


# Points


@pytest.mark.parametrize("exponent", [0.0, 1.0, 4.5, 80.0])
@pytest.mark.parametrize("half_angle", [90.0, 60.0, 8.0])
def test_a_point_sends_a_power_of_the_cosine_into_every_cone(half_angle, exponent):
    """Flux within theta: (1 - cos^(m + 1) theta) / (1 - cos^(m + 1) of the cone).

    Equal-area cells on n rings, cut by the cone's edge: one ring of 2 / n in solid angle at the
    most is miscounted, weighted with the intensity relative to its mean, which is at most m + 1.
    """
    n = 256
    rays = point(half_angle, exponent, (n, n))
    assert np.allclose(rays.origin[:2], 0, atol=0)
    whole = 1 - cos(radians(half_angle)) ** (exponent + 1)
    for share in (0.2, 0.5, 0.8):
        theta = radians(half_angle) * share
        found = mean(rays, rays.direction[2] > cos(theta))
        bound = 2 / n * (exponent + 1) * (1 - cos(radians(half_angle))) / whole
        assert found == pytest.approx((1 - cos(theta) ** (exponent + 1)) / whole, abs=bound)
    intensity = np.asarray(rays.flux) / rays.direction[2] ** exponent
    assert np.ptp(intensity) < 1e-12 * intensity.max()
    assert rays.direction[2].min() >= cos(radians(half_angle)) - 1e-15


@pytest.mark.parametrize("exponent", [0.0, 3.0])
def test_a_points_moments_converge_with_the_grid(exponent):
    """<cos theta> = (m + 1) / (m + 2) over the half space: the midpoint rule errs by O(n^-2)."""
    expected = (exponent + 1) / (exponent + 2)
    errors = [
        abs(mean(r, r.direction[2]) - expected) for r in (point(90.0, exponent, (n, n)) for n in (16, 32, 64))
    ]
    if exponent == 0:  # the mean height of equal-area rings is exact for even counts but for O(n^-2)
        assert errors[-1] < 1e-3
    assert errors[-1] < 2e-3
    assert errors[0] / max(errors[2], 1e-300) > 8


@pytest.mark.parametrize("shift", [(0.5, -0.5), (-0.5, 0.5), (0.25, 0.1)])
def test_a_shifted_grid_stays_in_the_cone(shift):
    rays = point(70.0, 1.0, (9, 14), shift)
    assert rays.direction[2].min() >= cos(radians(70.0)) - 1e-15
    assert rays.total == pytest.approx(FLUX, rel=1e-14)
    assert not np.isin(rays.direction[0], point(70.0, 1.0, (9, 14)).direction[0]).any()


# The map from square to disk


def test_the_map_to_the_disk_preserves_area():
    """det J = pi / 4 everywhere: central differences with h = 1e-5 err by h^2 and by 1e-16 / h."""
    a, b = np.random.default_rng(0).uniform(-1, 1, (2, 5000))
    away = np.abs(np.abs(a) - np.abs(b)) > 1e-3  # the map has a kink on the diagonals
    a, b, h = a[away], b[away], 1e-5
    along = [(f - g) / (2 * h) for f, g in zip(concentric(a + h, b), concentric(a - h, b))]
    across = [(f - g) / (2 * h) for f, g in zip(concentric(a, b + h), concentric(a, b - h))]
    far = (
        np.minimum(np.abs(a), np.abs(b)) + np.maximum(np.abs(a), np.abs(b)) > 0.05
    )  # third derivatives grow as 1 / r^2
    jacobian = along[0] * across[1] - along[1] * across[0]
    np.testing.assert_allclose(np.abs(jacobian[far]), pi / 4, rtol=0, atol=1e-6)
    assert (jacobian > 0).all()


def test_the_map_takes_squares_to_circles_and_continues_across_the_diagonals():
    t = np.linspace(-1, 1, 41)
    for radius in (1.0, 0.3):
        for a, b in (
            (radius + 0 * t, radius * t),
            (-radius + 0 * t, radius * t),
            (radius * t, radius + 0 * t),
        ):
            np.testing.assert_allclose(np.hypot(*concentric(a, b)), radius, rtol=1e-15)
    s = np.linspace(-1, 1, 41)
    for sign in (1, -1):
        p, q = concentric(s, sign * s)
        near = concentric(s * (1 - 1e-9), sign * s)
        np.testing.assert_allclose([p, q], near, rtol=0, atol=1e-8)
        np.testing.assert_allclose(np.abs([p, q]), np.abs([s, s]) * np.sqrt(0.5), rtol=0, atol=1e-15)
    np.testing.assert_array_equal(concentric(np.zeros(1), np.zeros(1)), [[0.0], [0.0]])
    assert np.arctan2(*concentric(np.array([1.0]), np.array([0.5]))[::-1])[0] == pytest.approx(
        pi / 8, rel=1e-15
    )
    assert asin(concentric(np.array([1.0]), np.array([0.5]))[1][0]) == pytest.approx(pi / 8, rel=1e-15)


# Beams, ray by ray


@pytest.mark.parametrize("profile", PROFILES[:3], ids=lambda p: p.kind)
@pytest.mark.parametrize("front", [-8.0, 60.0])
def test_a_beam_ray_by_ray_is_the_beam(profile, front):
    lens = small_lens(Conic(front, -1.0), thickness=20.0)
    beam = collimated_beam((14.0, 9.0), 3.0, (10.0, 10.0), (13, 7), profile=profile)
    rays = single_rays(beam, lens)
    np.testing.assert_array_equal(rays.origin[0].reshape(13, 7), np.repeat(beam.x[:, None], 7, axis=1))
    np.testing.assert_array_equal(rays.origin[1].reshape(13, 7), np.repeat(beam.y[None, :], 13, axis=0))
    np.testing.assert_array_equal(rays.direction, np.repeat([[0.0], [0.0], [1.0]], 91, axis=1))
    assert np.unique(rays.origin[2]).size == 1
    assert rays.origin[2].max() < lens.front([10.0], [10.0]).min()
    assert rays.total == pytest.approx(beam.total, rel=1e-14)
    np.testing.assert_array_equal(rays.flux.reshape(13, 7), beam.flux)
