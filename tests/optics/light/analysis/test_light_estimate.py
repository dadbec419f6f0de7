"""The mean of replicates, its error, and what that does to rel_l2."""

import numpy as np
import pytest

from optics.light.analysis.light_estimate import LightEstimate
from optics.light.analysis.metrics import rel_l2
from optics.scene.receivers import Plane, Screen, with_mirror_images

RNG = np.random.default_rng(5)


def test_replicates_give_their_mean_and_its_standard_error():
    images = RNG.normal(3, 1, (5, 4, 6))
    onto, beside = RNG.uniform(size=(2, 5))
    light = LightEstimate.of_replicates(zip(images, onto, beside))
    np.testing.assert_allclose(light.irradiance, images.mean(axis=0), rtol=1e-14)
    np.testing.assert_allclose(light.error, images.std(axis=0, ddof=1) / np.sqrt(5), rtol=1e-13)
    assert (light.on_target, light.off_target) == pytest.approx((onto.mean(), beside.mean()))


def test_errors_of_a_sum_are_independent():
    one, other = (LightEstimate(*RNG.uniform(1, 2, (2, 3, 3)), 0.5, 0.25) for _ in range(2))
    both = one + other
    np.testing.assert_allclose(both.error**2, one.error**2 + other.error**2, rtol=1e-14)
    assert (both.on_target, both.off_target) == (1.0, 0.5)


@pytest.mark.parametrize("axes", [(), (0,), (0, 1)], ids=str)
@pytest.mark.parametrize("noise", [0.02, 0.1, 0.4])
def test_noise_is_taken_off_and_what_remains_is_known(noise, axes):
    """Of 300 noisy images with known errors, against the image without noise; noise 0.4 exceeds the residual.

    The debiased value is right on average, and its spread is what rel_l2_error says, within 20 %; so is that
    of the light on a fifth of the pixels across their middle.
    """
    images = 2 ** len(axes)

    def mirrored(of_pixels):
        return with_mirror_images(of_pixels, axes) / images

    target = mirrored(1 + RNG.uniform(size=(40, 50)))
    light = target * mirrored(1 + RNG.normal(0, 0.2 * np.sqrt(images), target.shape))
    norm = np.linalg.norm(target / target.mean())
    truth = np.linalg.norm(light / light.mean() - target / target.mean()) / norm
    error = noise * np.sqrt(light)
    lit = np.abs(np.linspace(-1, 1, 50)) * np.ones((40, 1)) < 0.2
    found, on_lit = [], []
    for _ in range(300):
        errors = error * mirrored(RNG.normal(0, np.sqrt(images), light.shape))
        estimate = LightEstimate(light + errors, error, 1, 0, axes=axes)
        found.append(estimate.error_of_rel_l2(target))
        on_lit.append((estimate.irradiance[lit].sum(), estimate.error_of_sum(lit)))
    assert np.std(on_lit, axis=0)[0] == pytest.approx(np.mean(on_lit, axis=0)[1], rel=0.2)
    debiased, told, floor = (
        np.array([f[k] for f in found]) for k in ("rel_l2_debiased", "rel_l2_error", "rel_l2_floor")
    )
    assert debiased.mean() == pytest.approx(truth, abs=4 * debiased.std() / np.sqrt(300) + noise**2 / 100)
    assert told.mean() == pytest.approx(debiased.std(), rel=0.2)
    assert floor.mean() == pytest.approx(np.linalg.norm(error) / light.mean() / norm, rel=1e-2)


def drifting(toward, independent, noise=0.0):
    """Return a target, light, a drift that is a part of the way from one to the other and of no connection
    besides, and what is told of light with them and with noise."""
    target = 1 + RNG.uniform(size=(40, 50))
    shown = target * (1 + RNG.normal(0, 0.05, target.shape))
    drift = toward * (target - shown) + independent * RNG.normal(0, 0.05, target.shape)
    estimate = LightEstimate(shown, np.full(target.shape, noise), 1, 0, drift=drift)
    return target, shown, drift, estimate.error_of_rel_l2(target)


@pytest.mark.parametrize("toward", [0.1, 0.4, -0.1, -0.4, 0.0])
@pytest.mark.parametrize("independent", [0.0, 0.1, 0.5, 1.5])
def test_a_drift_is_not_taken_off_but_told(toward, independent):
    """rel_l2 stays as it is, and what all of the drift would make of it, or its opposite, is about what is
    told, at most: an optimiser fits what its own cells show, so that a drift goes with the residual."""
    target, shown, drift, found = drifting(toward, independent)
    own, *others = (rel_l2(light, target) for light in (shown, shown + drift, shown - drift))
    assert found["rel_l2_debiased"] == pytest.approx(own, rel=1e-12)
    away = max(abs(other**2 - own**2) for other in others) / (2 * own)
    assert away <= 1.05 * found["rel_l2_error"] or found["rel_l2_error"] == found["rel_l2_floor"]
    assert found["rel_l2_error"] <= found["rel_l2_floor"]
    if toward > 0.0 or independent:
        assert found["rel_l2_error"] < 2 * away


def test_beside_a_drift_noise_is_taken_off_as_if_there_were_none():
    noise = 0.02
    target, shown, _, found = drifting(0.1, 0.1, noise)
    alone = LightEstimate(shown, np.full(shown.shape, noise), 1, 0).error_of_rel_l2(target)
    assert found["rel_l2_debiased"] == pytest.approx(alone["rel_l2_debiased"], rel=1e-12)
    assert found["rel_l2_error"] > alone["rel_l2_error"]


def test_drifts_add_up_with_their_signs_on_any_pixels():
    one, other = (RNG.normal(size=(2, 3)) for _ in range(2))
    light = [LightEstimate(np.ones((2, 3)), np.zeros((2, 3)), 1, 0, drift=drift) for drift in (one, other)]
    np.testing.assert_allclose((light[0] + light[1]).drift, one + other)
    np.testing.assert_allclose(light[0].over(np.full((2, 3), 4.0)).drift, one / 4)
    screen = Screen((3.0, 2.0), (6, 4), 0, Plane())
    finer = light[0].finer(screen)
    np.testing.assert_allclose(abs(finer.drift), finer.error)
    # of light without one, which is added to light with one and without
    rays = LightEstimate(np.ones((2, 3)), np.ones((2, 3)), 1, 0).finer(screen)
    shown = np.full((4, 6), 2.0)
    np.testing.assert_allclose((finer + rays).over(shown).drift, finer.drift / 2)
    assert not (rays + rays).over(shown).drift.any()


def test_a_dark_screen_has_no_error():
    dark = LightEstimate(np.zeros((3, 3)), np.zeros((3, 3)), 0.0, 0.0)
    found = dark.error_of_rel_l2(np.ones((3, 3)))
    assert found == {"rel_l2_floor": 0.0, "rel_l2_debiased": 1.0, "rel_l2_error": 0.0}
