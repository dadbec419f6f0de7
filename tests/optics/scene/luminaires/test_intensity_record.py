"""The record of a luminaire: orientation, interpolation, and the flux of what it interpolates."""

import numpy as np
import pytest
from scipy.integrate import dblquad

from optics.base.runtime import UserError
from optics.scene.luminaires import Luminaire, Opening, directions_at
from optics.scene.luminaires.intensity_record import angles_of
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
