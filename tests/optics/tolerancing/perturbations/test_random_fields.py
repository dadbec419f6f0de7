"""Random height errors: rms, band of periods, and the same field for the same seed."""

import numpy as np
import pytest

from optics.base.runtime import UserError
from optics.tolerancing.perturbations import random_field, shortest_period
from thbcad.outlines import Outline

HALF = (30.0, 20.0)


def samples(field, n=400):
    x, y = (h * (2 * np.arange(n) + 1 - n) / n for h in HALF)
    return field.jet(*(a.ravel() for a in np.meshgrid(x, y, indexing="ij")))[0].reshape(n, n)


@pytest.mark.parametrize("band", [(1.0, 2.0), (2.0, 5.0), (5.0, 60.0)])
def test_the_rms_over_the_aperture_is_the_one_asked_for(band):
    assert samples(random_field(band, 3e-5, HALF, 4)).std() == pytest.approx(3e-5, rel=5e-3)


def test_the_rms_of_an_outline_is_that_inside_about_its_own_mean():
    """Long waves have another mean and another rms over the ellipse than over the rectangle."""
    x, y = (h * (2 * np.arange(400) + 1 - 400) / 400 for h in HALF)
    inside = Outline(HALF, HALF).contains(x[:, None], y)
    field = samples(random_field((20.0, 60.0), 3e-5, HALF, 4, corners=HALF))
    assert field[inside].std() == pytest.approx(3e-5, rel=3e-2)  # whole spans count at the rim
    assert abs(field[inside].mean()) < 3e-2 * 3e-5
    assert field.std() != pytest.approx(3e-5, rel=6e-2)


def test_the_power_lies_in_the_band():
    field = samples(random_field((2.0, 5.0), 1.0, HALF, 0))
    window = np.hanning(400)
    power = np.abs(np.fft.fft2(field * np.outer(window, window))) ** 2
    k = np.hypot(*np.meshgrid(np.fft.fftfreq(400, 60 / 400), np.fft.fftfreq(400, 40 / 400), indexing="ij"))
    slack = 0.05  # cycles per mm: the aperture's own width
    within = (k > 1 / 5 - slack) & (k < 1 / 2 + slack)
    assert power[within].sum() > 0.98 * power.sum()


def test_octaves_carry_the_same_power():
    field = samples(random_field((1.0, 16.0), 1.0, HALF, 2), 800)
    power = np.abs(np.fft.fft2(field * np.outer(np.hanning(800), np.hanning(800)))) ** 2
    k = np.hypot(*np.meshgrid(np.fft.fftfreq(800, 60 / 800), np.fft.fftfreq(800, 40 / 800), indexing="ij"))
    octaves = [power[(k > low) & (k < 2 * low)].sum() for low in (1 / 8, 1 / 4, 1 / 2)]
    assert max(octaves) < 1.3 * min(octaves)


def test_a_seed_means_one_field():
    one, same, other = (random_field((2.0, 5.0), 1e-5, HALF, seed) for seed in (7, 7, 8))
    assert one.net.tobytes() == same.net.tobytes()
    assert abs(np.corrcoef(one.net.ravel(), other.net.ravel())[0, 1]) < 0.2


def test_the_shortest_period_is_held_and_a_shorter_one_is_refused():
    thin = (30.0, 0.01)
    shortest = shortest_period(thin)
    random_field((shortest, 2 * shortest), 1.0, thin, 0)
    with pytest.raises(UserError, match="take at least"):
        random_field((0.999 * shortest, 2 * shortest), 1.0, thin, 0)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (((5.0, 2.0), 1.0, HALF, 0), "must rise to at most 120 mm"),
        (((5.0, 500.0), 1.0, HALF, 0), "must rise to at most 120 mm"),
        (((0.0, 2.0), 1.0, HALF, 0), "shortest period must be a positive finite number"),
        (((1e-3, 2.0), 1.0, HALF, 0), "too short for 60 mm; take at least"),
        (((1.0, 2.0), np.nan, HALF, 0), "rms must be a finite number"),
        (((1.0, 2.0), 1.0, HALF, -1), "seed must be a non-negative integer"),
        ((3.0, 1.0, HALF, 0), "a random height error's numbers"),
        (((119.0, 119.5), 1.0, HALF, 0), "no period from 119 to 119.5 mm fits"),
    ],
)
def test_bad_numbers_are_refused_in_a_sentence(arguments, sentence):
    with pytest.raises(UserError, match=sentence):
        random_field(*arguments)
