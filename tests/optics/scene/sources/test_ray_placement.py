"""Rays of files in the scene: turned, thinned with their flux kept, and dealt into samples that are alike."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from optics.scene.ray_files import RaySet
from optics.scene.sources import Profile, placed_rays
from tests.optics.cases import lambertian_parts
from thbcad import Pose

SQUARE = 1 << 14


def lambertian(half_angle=90.0):
    """Rays of a Lambertian square of 1 mm, as a file holds them, with the source in z = 0."""
    (rays,) = lambertian_parts((0.5, 0.5), 0.0, 1.0, half_angle, Profile(), SQUARE, 3, 1 << 30)
    return RaySet(rays.origin.T, rays.direction.T, rays.flux)


def placed(rays, shift=(0.0, 0.0, 0.0), turn=None, flux=1.0):
    return placed_rays(rays, Pose(np.eye(3) if turn is None else turn, np.array(shift)), flux)


def test_rays_are_moved_turned_and_scaled():
    rays = RaySet([[1, 2, 3]], [[0, 0, 1]], [5.0])
    about_x = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])  # y to z
    there = placed(rays, (10.0, 20.0, 30.0), about_x, flux=2.0)
    np.testing.assert_allclose(there.origin[:, 0], [11, 17, 32])
    np.testing.assert_allclose(there.direction[:, 0], [0, -1, 0], atol=1e-15)
    np.testing.assert_allclose(there.flux, [2.0])


@given(count=st.integers(1, 300), offset=st.floats(0, 1, exclude_max=True), seed=st.integers(0, 50))
def test_thinning_keeps_the_flux_and_takes_rays_of_the_file(count, offset, seed):
    rng = np.random.default_rng(seed)
    direction = rng.normal(size=(40, 3))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    there = placed(RaySet(rng.normal(size=(40, 3)), direction, rng.random(40) + 0.01), flux=3.0)
    fewer = there.thinned(count, offset)
    assert fewer.flux.sum() == pytest.approx(3.0, rel=1e-12)
    assert len(fewer.flux) == min(count, 40)
    known = {tuple(ray) for ray in there.origin.T}
    assert {tuple(ray) for ray in fewer.origin.T} <= known
    assert sum(len(hand.flux) for hand in there.dealt(8)) == 40
    for hand in there.dealt(8):
        assert hand.flux.sum() == pytest.approx(3.0, rel=1e-12)


def test_a_ray_is_taken_as_often_as_its_flux_asks_for():
    """Over all offsets; so the mean over thinned sets is that over the file."""
    there = placed(RaySet(np.zeros((3, 3)), [[0, 0, 1], [0, 0.6, 0.8], [0.6, 0, 0.8]], [1.0, 2.0, 5.0]))
    offsets = (np.arange(4000) + 0.5) / 4000
    share = np.zeros(3)
    for offset in offsets:
        taken = there.thinned(2, offset)
        share += [taken.flux[(d == taken.direction.T).all(axis=1)].sum() for d in there.direction.T]
    np.testing.assert_allclose(share / 4000, there.flux, atol=1e-3)


@pytest.mark.parametrize("count", [64, 256, 1024])
def test_a_thinned_set_fills_position_and_direction_more_evenly_than_chance(count):
    """Flux in the 16 boxes of the signs of x, y, p and q, against that of random choices."""
    there = placed(lambertian())
    boxes = 1 << np.arange(4)

    def spread(origin, direction, flux):
        signs = np.stack([*(origin[:2] > 0), *(direction[:2] > 0)])
        return np.std(np.bincount(boxes @ signs, flux, 16) * 16)

    ordered = [spread(t.origin, t.direction, t.flux) for t in (there.thinned(count, k / 8) for k in range(8))]
    rng = np.random.default_rng(0)
    chance = []
    for _ in range(8):
        chosen = rng.choice(SQUARE, count, replace=False)
        flux = np.full(count, 1 / count)
        chance.append(spread(there.origin[:, chosen], there.direction[:, chosen], flux))
    assert np.mean(ordered) < 0.5 * np.mean(chance)


@pytest.mark.slow
def test_the_radiance_of_a_lambertian_square_of_one_watt():
    """Flux over area and projected solid angle, 318 310 W / (sr m^2), from a million rays.

    Estimator: the flux of the rays in the inner quarter of the area and within 30 degrees, over that area and
    pi sin^2 30 degrees.
    """
    (rays,) = lambertian_parts((0.5, 0.5), 0.0, 1.0, 90.0, Profile(), 1 << 20, 0, 1 << 30)
    there = placed(RaySet(rays.origin.T, rays.direction.T, rays.flux))
    inner = (np.abs(there.origin[:2]) < 0.25).all(axis=0)
    near = np.hypot(*there.direction[:2]) < 0.5
    area, solid_angle = 0.25e-6, np.pi * 0.25  # m^2, sr
    found = there.flux[inner & near].sum() / (area * solid_angle)
    assert found == pytest.approx(1 / (1e-6 * np.pi), rel=2e-3)
    assert found == pytest.approx(318310, rel=2e-3)
