"""Rays as an intensity: the flux is kept, and the light is where the rays go."""

import numpy as np
import pytest
from scipy.stats import qmc

from optics.scene.luminaires import DirectionSampler, IntensityGrid, Opening, directions_at
from tests.optics.scene.luminaires.cases import asymmetric


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
