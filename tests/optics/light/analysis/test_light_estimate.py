"""The mean of replicates, its error, and what that does to rel_l2 and other numbers."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from optics.light.analysis.light_estimate import REPLICATES, Light, LightEstimate
from optics.light.analysis.metrics import rel_l2
from optics.scene.receivers import Plane, Screen

RNG = np.random.default_rng(5)


def estimate_of(images, on=1.0, off=0.0):
    return LightEstimate.of_replicates(Light.of([image], on, off) for image in images)


def drawn(light, noise, width=0.0):
    """Replicates of light whose mean has a relative noise that neighbours share over a width, pixels."""
    noises = RNG.normal(size=(REPLICATES, *light.shape))
    if width:
        noises = gaussian_filter(noises, (0, width, width))
        noises /= noises.std()
    return light * (1 + np.sqrt(REPLICATES) * noise * noises)


def test_replicates_give_their_mean_and_its_standard_error():
    images = RNG.normal(3, 1, (5, 4, 6))
    onto, outside = RNG.uniform(size=(2, 5))
    light = LightEstimate.of_replicates(Light.of([i], a, b) for i, a, b in zip(images, onto, outside))
    np.testing.assert_allclose(light.irradiance, images.mean(axis=0), rtol=1e-14)
    np.testing.assert_allclose(light.error, images.std(axis=0, ddof=1) / np.sqrt(5), rtol=1e-13)
    assert (light.on_target, light.off_target) == pytest.approx((onto.mean(), outside.mean()))
    errors = light.error_of_on_target, light.error_of_off_target
    assert errors == pytest.approx([v.std(ddof=1) / np.sqrt(5) for v in (onto, outside)])


def test_light_that_is_the_same_every_time_adds_no_error():
    noisy = estimate_of(RNG.normal(3, 1, (8, 3, 3)), 0.5, 0.25)
    both = noisy + LightEstimate.exact(Light.of([np.ones((3, 3))], 0.5, 0.25))
    np.testing.assert_allclose(both.error, noisy.error, rtol=1e-14)
    np.testing.assert_allclose(both.irradiance, noisy.irradiance + 1, rtol=1e-14)
    assert (both.on_target, both.off_target) == (1.0, 0.5)


def test_what_the_same_rays_measure_errs_together():
    """The same draws twice have twice their error, and a draw less itself has none."""
    light = estimate_of(RNG.normal(3, 1, (8, 3, 3)))
    np.testing.assert_allclose((light + light).error, 2 * light.error, rtol=1e-13)
    assert (light + light * -1.0).error.max() < 1e-15


def test_groups_of_replicates_have_the_same_mean():
    light = estimate_of(RNG.normal(3, 1, (24, 4, 5)), 1.0, 2.0)
    grouped = light.grouped(8)
    assert grouped.count == 8
    np.testing.assert_allclose(grouped.irradiance, light.irradiance, rtol=1e-13)
    assert (grouped.on_target, grouped.off_target) == (1.0, 2.0)


@pytest.mark.parametrize("width", [0.0, 3.0], ids=["independent pixels", "pixels that share their noise"])
@pytest.mark.parametrize("noise", [0.005, 0.02, 0.1])
def test_noise_is_taken_off_and_what_remains_spreads_as_is_said(noise, width):
    """Of 300 noisy images of light that is 0.05 off, and of the light on a fifth of the pixels."""
    target = 1 + RNG.uniform(size=(40, 50))
    light = target * (1 + gaussian_filter(RNG.normal(0, 0.4, target.shape), 2.0))
    truth = rel_l2(light, target)
    lit = np.abs(np.linspace(-1, 1, 50)) * np.ones((40, 1)) < 0.2
    found, on_lit = [], []
    for _ in range(300):
        estimate = estimate_of(drawn(light, noise, width))
        found.append(estimate.error_of_rel_l2(target))
        on_lit.append((estimate.irradiance[lit].sum(), estimate.error_of_sum(lit)))
    values, told = np.transpose(on_lit)
    assert values.std() == pytest.approx(np.sqrt(np.mean(told**2)), rel=0.2)
    debiased, told = (np.array([f[k] for f in found]) for k in ("rel_l2_debiased", "rel_l2_error"))
    assert debiased.mean() == pytest.approx(truth, abs=4 * debiased.std() / np.sqrt(300) + noise**2)
    if noise < truth:
        assert debiased.std() == pytest.approx(np.sqrt(np.mean(told**2)), rel=0.25)


def test_the_error_of_any_function_is_its_spread():
    """Of the greatest light of a column's mean."""
    light = 1 + np.linspace(0, 1, 20) * np.ones((10, 1))

    def brightest(image):
        return float(image.mean(axis=0).max())

    found = []
    for _ in range(300):
        estimate = estimate_of(drawn(light, 0.01))
        found.append((brightest(estimate.irradiance), estimate.error_of(brightest)))
    values, told = np.transpose(found)
    assert values.std() == pytest.approx(np.sqrt(np.mean(told**2)), rel=0.2)


def drifting(toward, independent):
    """Return a target, light, and a drift: a part of the way from one to the other, and other errors."""
    target = 1 + RNG.uniform(size=(40, 50))
    shown = target * (1 + RNG.normal(0, 0.05, target.shape))
    drift = toward * (target - shown) + independent * RNG.normal(0, 0.05, target.shape)
    return target, shown, drift


@pytest.mark.parametrize("toward", [0.1, 0.4, -0.1, -0.4, 0.0])
@pytest.mark.parametrize("independent", [0.0, 0.1, 0.5, 1.5])
def test_a_drift_is_not_taken_off_but_told(toward, independent):
    """rel_l2 stays as it is, and the error says what the drift would make of it."""
    target, shown, drift = drifting(toward, independent)
    found = LightEstimate.exact(Light.of([shown], 1, 0), Light.of([drift], 0, 0)).error_of_rel_l2(target)
    own, moved = (rel_l2(light, target) for light in (shown, shown + drift))
    assert found["rel_l2_debiased"] == pytest.approx(own, rel=1e-12)
    assert abs(moved - own) <= found["rel_l2_error"]
    if abs(toward) > independent:
        assert found["rel_l2_error"] < 1.7 * abs(moved - own)


def test_drifts_add_up_with_their_signs_on_any_pixels():
    one, other = (RNG.normal(size=(2, 3)) for _ in range(2))
    even = Light.of([np.ones((2, 3))], 1, 0)
    light = [LightEstimate.exact(even, Light.of([drift], 0, 0)) for drift in (one, other)]
    np.testing.assert_allclose((light[0] + light[1]).drift.pixels, one + other)
    np.testing.assert_allclose(light[0].over(np.full((2, 3), 4.0)).drift.pixels, one / 4)
    finer = light[0].finer(Screen((3.0, 2.0), (6, 4), 0, Plane()))
    np.testing.assert_allclose(abs(finer.drift.pixels), finer.error)


def test_light_on_finer_pixels_has_the_error_of_the_wide_ones():
    light = estimate_of(RNG.uniform(size=(8, 2, 3)))
    fine = light.finer(Screen((1.0, 1.0), (3, 2)).finer(4))
    first = np.zeros((8, 12))
    first[:4, :4] = 1 / 16
    assert fine.error_of_sum(first) == pytest.approx(light.error[0, 0], rel=1e-13)


def test_a_dark_screen_has_no_error():
    dark = LightEstimate.exact(Light.of([np.zeros((3, 3))], 0.0, 0.0))
    found = dark.error_of_rel_l2(np.ones((3, 3)))
    assert found == {"rel_l2_floor": 0.0, "rel_l2_debiased": 1.0, "rel_l2_error": 0.0}
