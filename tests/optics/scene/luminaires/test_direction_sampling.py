"""Directions of a luminaire's light: exact strata, and moments against quadrature."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.integrate import quad
from scipy.stats import chisquare

from optics.scene.luminaires import DirectionSampler, Luminaire
from optics.scene.luminaires.intensity_record import angles_of
from tests.cases import examples
from tests.optics.scene.luminaires.cases import GAMMA, C, asymmetric, lambertian

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
