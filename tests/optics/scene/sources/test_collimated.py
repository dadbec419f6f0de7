"""Collimated beams: where the rays start and what they carry."""

import numpy as np
import pytest

from optics.scene.sources.collimated import collimated_beam
from optics.scene.sources.profile import Profile


@pytest.mark.parametrize(
    ("source", "aperture"),
    [((9.5, 9.5), (10.0, 10.0)), ((14.0, 9.0), (10.0, 10.0)), ((30.0, 20.0), (10.0, 5.0))],
)
@pytest.mark.parametrize("rays", [(1, 1), (64, 17)])
def test_rays_carry_the_share_that_meets_the_lens(source, aperture, rays):
    beam = collimated_beam(source, 3.0, aperture, rays)
    width, height = (min(s, a) for s, a in zip(source, aperture))
    entering = 3.0 * width * height / (source[0] * source[1])
    assert beam.flux.shape == rays
    assert beam.flux * rays[0] * rays[1] == pytest.approx(np.full(rays, entering), rel=1e-15)
    assert beam.missed == pytest.approx(3.0 - entering, abs=1e-15)


def test_rays_stand_in_the_middle_of_equal_cells():
    beam = collimated_beam((9.0, 4.0), 1.0, (10.0, 10.0), (3, 2))
    np.testing.assert_allclose(beam.x, [-6, 0, 6], atol=1e-15)
    np.testing.assert_allclose(beam.y, [-2, 2], atol=1e-15)


@pytest.mark.parametrize("shift", [(0.5, -0.5), (-0.5, 0.5)])
@pytest.mark.parametrize("rays", [7, 49, 1000])
def test_a_full_shift_stays_inside_the_aperture(shift, rays):
    beam = collimated_beam((47.5, 47.5), 1.0, (50.0, 50.0), (rays, rays), shift)
    assert max(np.abs(beam.x).max(), np.abs(beam.y).max()) <= 47.5


@pytest.mark.parametrize("kind", ["uniform", "round"])
@pytest.mark.parametrize("most", [1, 20, 21, 100, 10**6])
def test_slices_are_the_beam(most, kind):
    beam = collimated_beam((14.0, 9.0), 3.0, (10.0, 10.0), (13, 7), profile=Profile(kind))
    parts = list(beam.slices(most))
    np.testing.assert_array_equal(np.concatenate([p.x for p in parts]), beam.x)
    assert all(len(p.x) * len(p.y) <= max(most, 7) for p in parts)
    assert sum(p.missed for p in parts) == beam.missed
    np.testing.assert_array_equal(np.concatenate([p.flux for p in parts]), beam.flux)
    assert sum(p.total for p in parts) == pytest.approx(beam.total, rel=1e-14)


# ---- profiles ----

PROFILES = [
    Profile(),
    Profile("round"),
    Profile("gaussian"),
    Profile("gaussian", (0.2, 1.5)),
    Profile("round_gaussian", (0.5, 1.5)),
    Profile("round_gaussian", (0.95, 0.95)),
]


@pytest.mark.parametrize("profile", PROFILES, ids=str)
def test_densities_have_a_mean_of_one(profile):
    """The midpoint rule on 400 x 300 cells; the rim of the ellipse cuts cells, which costs 1e-3."""
    s, t = ((2 * np.arange(n) + 1) / n - 1 for n in (400, 300))
    density = profile(s[:, None], t[None, :])
    assert density.shape == (400, 300)
    assert density.min() >= 0
    assert density.mean() == pytest.approx(1.0, abs=1e-3 if profile.round else 1e-5)


@pytest.mark.parametrize("profile", PROFILES[1:], ids=str)
def test_all_light_is_carried_or_missed(profile):
    beam = collimated_beam((14.0, 9.0), 3.0, (10.0, 10.0), (50, 40), profile=profile)
    assert beam.total + beam.missed == pytest.approx(3.0, rel=1e-14)
    assert beam.flux.shape == (50, 40)
    x, y = beam.x[17] / 14.0, beam.y[31] / 9.0
    wanted = profile(x, y) * 3.0 * (20 / 28) / 2000
    assert beam.flux[17, 31] == pytest.approx(wanted, rel=1e-13)


def test_gaussian_follows_its_formula():
    profile = Profile("gaussian", (0.5, 0.25))
    density = profile(np.array([[0.0], [0.5]]), np.array([[0.0, 0.25]]))
    np.testing.assert_allclose(
        density / density[0, 0], [[1, np.exp(-0.5)], [np.exp(-0.5), np.exp(-1)]], rtol=1e-14
    )


@pytest.mark.parametrize("shift", [(0.0, 0.0), (0.5, -0.3)])
@pytest.mark.parametrize("aperture", [10.0, 4.0])
def test_a_lit_pixel_between_the_rays_is_carried_by_the_ray_of_its_cell(shift, aperture):
    """One pixel of 101 x 101, 0.18 mm wide, between rays that are 1.1 mm apart."""
    light = np.zeros((101, 101))
    light[45, 58] = 7.0
    beam = collimated_beam(
        (9.0, 9.0), 3.0, (aperture, aperture), (16, 16), shift, Profile("image", light=light)
    )
    assert beam.total == pytest.approx(3.0, rel=1e-14)
    x, y = np.average(np.meshgrid(beam.x, beam.y, indexing="ij"), axis=(1, 2), weights=[beam.flux] * 2)
    step = 2 * min(9.0, aperture) / 16
    assert abs(x - 9.0 * (117 / 101 - 1)) < step
    assert abs(y + 9.0 * (91 / 101 - 1)) < step


def test_rays_of_a_picture_carry_the_light_of_their_cells():
    """Cells of 5 x 4 whole pixels each, and the outer ones beside the aperture: block sums."""
    light = np.random.default_rng(3).uniform(0, 1, (32, 50))
    beam = collimated_beam((10.0, 8.0), 3.0, (8.0, 6.0), (8, 6), profile=Profile("image", light=light))
    inner = light[4:28, 5:45].reshape(6, 4, 8, 5).sum(axis=(1, 3))[::-1].T
    np.testing.assert_allclose(beam.flux, 3.0 * inner / light.sum(), rtol=1e-13)
    assert beam.missed == pytest.approx(3.0 - beam.flux.sum(), rel=1e-14)


def test_a_picture_that_is_dark_before_the_aperture_misses_the_lens():
    light = np.zeros((8, 8))
    light[0] = 1.0
    beam = collimated_beam((10.0, 10.0), 3.0, (5.0, 5.0), (4, 4), profile=Profile("image", light=light))
    assert beam.missed == 3.0
    assert not beam.flux.any()
