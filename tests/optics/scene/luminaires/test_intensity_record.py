"""Intensities of luminaires: orientation, interpolation, directions drawn from them, rays summed to one."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.integrate import dblquad, quad
from scipy.stats import chisquare, qmc

from optics.base.runtime import UserError
from optics.scene.luminaires import DirectionSampler, IntensityGrid, Luminaire, Opening, directions_at
from optics.scene.luminaires.intensity_record import angles_of
from tests.cases import examples
from tests.optics.scene.luminaires.cases import GAMMA, C, asymmetric, lambertian


def test_gamma_0_is_z_and_c_grows_counterclockwise_seen_along_the_light():
    directions = directions_at(np.array([0.0, 0.0, 90.0, 180.0]), np.array([0.0, 90.0, 90.0, 90.0]))
    np.testing.assert_allclose(directions.T, [[0, 0, 1], [1, 0, 0], [0, -1, 0], [-1, 0, 0]], atol=1e-15)
    rng = np.random.default_rng(0)
    c, gamma = rng.uniform(0, 360, 100), rng.uniform(1, 179, 100)
    np.testing.assert_allclose(np.array(angles_of(directions_at(c, gamma))), [c, gamma], rtol=1e-12)


def test_the_intensity_at_the_grid_is_that_of_the_grid():
    lamp = asymmetric()
    c, gamma = np.meshgrid(C[:-1], GAMMA[1:-1], indexing="ij")
    found = lamp.intensity(directions_at(c.ravel(), gamma.ravel()))
    np.testing.assert_allclose(found.reshape(c.shape), lamp.candela[:-1, 1:-1], rtol=1e-12)


def test_between_angles_it_is_bilinear_and_beyond_them_zero():
    lamp = Luminaire([0, 90, 360], [10, 30], [[1, 2], [3, 5], [1, 2]])
    found = lamp.at(np.array([45.0, 45.0, 315.0, 45.0, 45.0]), np.array([10.0, 20.0, 30.0, 9.9, 30.1]))
    np.testing.assert_allclose(found, [2, 2.75, 2.5, 0, 0], rtol=1e-14)


@pytest.mark.slow
def test_the_flux_is_the_integral_of_the_interpolated_intensity():
    """Against adaptive quadrature over every rectangle of the grid."""
    lamp = asymmetric()
    total = 0.0
    for a, b in zip(np.radians(C), np.radians(C[1:])):
        for low, high in zip(np.radians(GAMMA), np.radians(GAMMA[1:])):
            total += dblquad(
                lambda g, c: float(lamp.at(*np.degrees([c, g]))) * np.sin(g), a, b, low, high, epsabs=1e-10
            )[0]
    assert lamp.flux == pytest.approx(total, rel=1e-10)


def test_a_lambertian_lamp_has_pi_times_its_peak():
    """Chords lie below the cosine by up to h^2 / 8; over the half sphere they miss h^2 / 12 of the flux."""
    for step in (10.0, 1.0):
        missing = 1 - lambertian(100.0, step).flux / (100 * np.pi)
        assert missing == pytest.approx(np.radians(step) ** 2 / 12, rel=0.02)


@pytest.mark.parametrize(
    ("gamma", "part"), [(30.0, 0.25), (45.0, 0.5), (90.0, 1.0), (180.0, 1.0), (0.0, 0.0)]
)
def test_the_flux_within_an_angle_is_that_of_the_cone(gamma, part):
    lamp = lambertian()
    assert lamp.flux_within(gamma) == pytest.approx(part * lamp.flux, rel=1e-4, abs=1e-12)


@pytest.mark.parametrize("size", [(-1.0, 2.0), (np.nan, 2.0), (1.0, np.inf)])
def test_openings_without_a_size_are_refused(size):
    with pytest.raises(UserError, match="must be finite and not negative"):
        Opening(size)


BAD = [
    (([0, 360], [0, 90], [[1, 2, 3]] * 2), "must have the shape"),
    (([0, 360], [0, 90], [1, 2]), "must have 2 dimensions"),
    (([0, 360], [0, 90], [[1, np.nan]] * 2), "must be finite"),
    (([0, 360], [0, 90], [[1, -2]] * 2), "must not be negative"),
    (([0, 360], [0, 90], [[0, 0]] * 2), "flux of a luminaire must be finite"),
    (([0, 360], [0, 90], [[1e308, 1e308]] * 2), "flux of a luminaire must be finite"),
    (([0, 360], [90, 0], [[1, 2]] * 2), "gamma must ascend, got 0 after 90"),
    (([0, 360], [0, 181], [[1, 2]] * 2), "between 0 and 180"),
    (([0, 350], [0, 90], [[1, 2]] * 2), "from 0 to 360 degrees, got 0 to 350"),
    (([0, 360], [0, 90], [[1, 2], [1, 3]]), "C = 0 and C = 360 must be the same"),
    (([0], [0, 90], [[1, 2]]), "at least two planes C"),
]


@pytest.mark.parametrize(("arguments", "words"), BAD)
def test_what_is_no_luminaire_is_refused(arguments, words):
    with pytest.raises(UserError, match=words), np.errstate(over="ignore"):
        Luminaire(*arguments)


def test_the_flux_of_the_rays_is_that_of_the_interpolated_intensity():
    rng = np.random.default_rng(1)
    direction = rng.normal(size=(3, 1000))
    direction[:, :6] = np.concatenate([np.eye(3), -np.eye(3)], axis=1)  # poles and planes of the grid
    direction /= np.linalg.norm(direction, axis=0)
    flux = rng.random(1000)
    grid = IntensityGrid(51, 45)
    assert grid.steps == pytest.approx((360 / 51, 4.0))
    lamp = grid.luminaire(grid.flux(direction, flux), Opening())
    assert lamp.flux == pytest.approx(flux.sum(), rel=1e-13)


def test_rays_of_a_luminaire_give_its_intensity_again():
    """But for what smoothing over a step does at the kinks of a bilinear lamp, and for the noise."""
    lamp = asymmetric()
    direction = DirectionSampler(lamp)(*qmc.Sobol(2, seed=1).random(1 << 18).T)
    grid = IntensityGrid(72, 36)
    found = grid.luminaire(grid.flux(direction, np.full(1 << 18, lamp.flux / (1 << 18))), Opening())
    c, gamma = np.meshgrid(found.planes, found.gammas, indexing="ij")
    difference = found.candela - lamp.at(c.ravel(), gamma.ravel()).reshape(c.shape)
    assert np.linalg.norm(difference[:, 3:]) < 0.01 * np.linalg.norm(found.candela)


def test_a_ray_near_the_axis_lights_the_axis_from_all_sides():
    grid = IntensityGrid(36, 18)
    nodes = grid.flux(directions_at(np.array([45.0]), np.array([2.5])), np.array([1.0]))
    np.testing.assert_allclose(nodes[:, 0], 0.75 / 36)
    np.testing.assert_allclose(nodes[[4, 5], 1], 0.125)


def test_a_ray_between_nodes_lights_the_four_around_it():
    grid = IntensityGrid(36, 18)
    nodes = grid.flux(directions_at(np.array([357.5]), np.array([42.5])), np.array([1.0]))
    lit = {(int(i), int(j)): nodes[i, j] for i, j in np.argwhere(nodes > 1e-12)}
    assert lit == pytest.approx({(35, 4): 0.1875, (35, 5): 0.0625, (0, 4): 0.5625, (0, 5): 0.1875})


GRID = (np.arange(200) + 0.5) / 200


def quantiles():
    """Return the middles of 200 x 200 equal parts of the unit square."""
    return (q.ravel() for q in np.meshgrid(GRID, GRID, indexing="ij"))


def test_the_flux_below_the_angle_of_a_quantile_is_that_part_of_all():
    """At every gamma that comes out, the cone within it holds u of the flux: no random number takes part."""
    lamp = asymmetric()
    u = np.array([1e-9, 0.01, 0.2, 0.5, 0.77, 0.99, 1 - 1e-9])
    _, gamma = angles_of(DirectionSampler(lamp)(u, np.full(len(u), 0.3)))
    within = [lamp.flux_within(g) / lamp.flux for g in gamma]
    np.testing.assert_allclose(within, u, atol=1e-13)


def test_the_light_before_the_plane_of_a_quantile_is_that_part_of_its_cone():
    lamp, v = asymmetric(), np.array([0.1, 0.35, 0.6, 0.95])
    c, gamma = angles_of(DirectionSampler(lamp)(np.full(4, 0.4), v))
    np.testing.assert_allclose(gamma, gamma[0], rtol=1e-12)
    light = lambda at: float(lamp.at(at, gamma[0]))  # noqa: E731
    whole = quad(light, 0, 360, points=C, epsabs=1e-10)[0]
    parts = [quad(light, 0, end, points=C[end > C], epsabs=1e-10)[0] / whole for end in c]
    np.testing.assert_allclose(parts, v, atol=1e-11)


def test_samples_fall_into_the_cells_of_the_grid_as_their_flux_says():
    lamp = asymmetric()
    rng = np.random.default_rng(3)
    c, gamma = angles_of(DirectionSampler(lamp)(*rng.random((2, 200_000))))
    counts = np.histogram2d(c, gamma, [C, GAMMA])[0]
    flux = np.array([[cell_flux(lamp, i, j) for j in range(len(GAMMA) - 1)] for i in range(len(C) - 1)])
    assert chisquare(counts.ravel(), flux.ravel() * 200_000 / flux.sum()).pvalue > 1e-3


def cell_flux(lamp, i, j):
    """Return the flux of a rectangle of the grid: its mean over C is linear in gamma."""
    a, b = np.radians(GAMMA[j : j + 2])
    p, q = lamp.candela[i : i + 2, j : j + 2].mean(axis=0)
    profile = lambda g: (p + (q - p) * (g - a) / (b - a)) * np.sin(g)  # noqa: E731
    return quad(profile, a, b)[0] * np.radians(C[i + 1] - C[i])


def test_a_lambertian_lamp_sends_its_light_as_lambert_says():
    direction = DirectionSampler(lambertian(step=0.25))(*quantiles())
    assert direction[2].mean() == pytest.approx(2 / 3, rel=1e-4)
    np.testing.assert_allclose(direction[:2].mean(axis=1), 0, atol=1e-12)


@examples(50)
@given(st.lists(st.floats(0, 1), min_size=12, max_size=12).filter(lambda row: max(row) > 1e-3), st.data())
def test_directions_come_from_where_there_is_light(values, data):
    candela = np.array([*np.reshape(values, (3, 4)), values[:4]])
    lamp = Luminaire([0.0, 100.0, 200.0, 360.0], [0.0, 1.0, 70.0, 180.0], candela)
    u, v = (np.array([data.draw(st.floats(0, 1, exclude_max=True))]) for _ in range(2))
    direction = DirectionSampler(lamp)(u, v)
    assert np.linalg.norm(direction) == pytest.approx(1, abs=1e-14)
    if 1e-6 < u < 1 - 1e-6 and 1e-6 < v < 1 - 1e-6:
        assert lamp.intensity(direction) > 0
