"""Outliers, and what is noise."""

import numpy as np
import pytest
from scipy import stats

from tests.thbcad.fitting.cases import everywhere, smooth, tensor
from thbcad.fitting.least_squares_fit import Samples, least_squares, robust_weights
from thbcad.fitting.residual_statistics import are_noise, kept_share, neighbours, tukey_weights
from thbcad.surfaces import THBSurface

FINE = np.linspace(0, 1, 41)
SIGMA = 0.01


def rms(surface):
    return np.sqrt(np.mean((surface.grid(FINE, FINE) - smooth(FINE[:, None], FINE)) ** 2))


@pytest.fixture(scope="module")
def spiked():
    """Samples with noise, and the same with 0.5 % outliers of a hundred standard deviations."""
    rng = np.random.default_rng(0)
    u, v = everywhere(rng, 3000)
    clean = Samples(u, v, smooth(u, v) + rng.normal(scale=SIGMA, size=3000))
    values = clean.values.copy()
    values[::200] += rng.choice([-1, 1], 15)
    return clean, Samples(u, v, values)


@pytest.mark.every(3)
@pytest.mark.parametrize("smoothing", [0.0, 1e-4, "auto"])
def test_outliers_leave_the_error_as_it_is_without_them(spiked, smoothing):
    clean, bad = spiked
    space = tensor(3, 12)
    good = rms(least_squares(space, clean, smoothing))
    found = least_squares(space, bad, smoothing, robust=True)
    assert rms(found) <= 1.1 * good  # 95 % efficiency, and 15 samples less
    assert rms(least_squares(space, bad, smoothing)) > 5 * good
    outliers = np.flatnonzero(robust_weights(found, bad) == 0)
    assert set(range(0, 3000, 200)) <= set(outliers)
    assert len(outliers) <= 15 + 3


def test_an_outlier_alone_at_the_border_is_seen():
    """A fit with equal weights passes through it."""
    u, v = everywhere(np.random.default_rng(0), 1200)
    u, v = np.r_[u[v < 0.98], 0.583], np.r_[v[v < 0.98], 1.0]
    values = smooth(u, v)
    values[-1] += 2
    samples = Samples(u, v, values)
    space = tensor(3, 12)
    plain = least_squares(space, samples, 1e-8)
    assert abs(plain(0.583, 1.0) - values[-1]) < 0.5
    found = least_squares(space, samples, 1e-8, robust=True)
    assert abs(found(0.583, 1.0) - smooth(0.583, 1.0)) < 0.05


def test_components_of_a_sample_are_outliers_together(spiked):
    clean, bad = spiked
    both = Samples(bad.u, bad.v, np.stack([clean.values, bad.values, clean.values], axis=1))
    found = least_squares(tensor(3, 8), both, robust=True)
    weights = robust_weights(found, both)
    assert (weights[::200] == 0).all()
    assert np.count_nonzero(weights == 0) <= 15 + 3


def test_samples_without_weight_stay_without():
    clean = Samples.grid(FINE, FINE, smooth(FINE[:, None], FINE))
    weights = np.ones(len(clean))
    weights[:400] = 0
    half = Samples(clean.u, clean.v, np.where(weights > 0, clean.values, 99.0), weights)
    found = least_squares(tensor(3, 6), half, 1e-9, robust=True)
    assert abs(found(half.u[400:], half.v[400:]) - clean.values[400:]).max() < 1e-3
    assert (robust_weights(found, half)[:400] == 0).all()


def test_a_peak_of_a_few_samples_is_no_outlier():
    """A peak whose standard deviation is one step of the grid, and no noise at all."""
    r = np.hypot(FINE[:, None] - 0.5, FINE - 0.5) / 0.025
    samples = Samples.grid(FINE, FINE, np.exp(-(r**2) / 2))
    flat = least_squares(tensor(1, 1), samples)
    assert robust_weights(flat, samples).min() > 0
    one = samples.values.copy()
    one[20 * 41 + 7] += 1
    spike = Samples(samples.u, samples.v, one)
    assert np.flatnonzero(robust_weights(flat, spike) == 0).tolist() == [20 * 41 + 7]


def test_the_weights_by_hand():
    """The neighbours' median is 0 and their median distance from it 1; 4.685 / 0.6745 of it is the cut."""
    residuals = np.array([[3.0], [-1], [-1], [0], [0], [0], [0], [1], [1], [1]])
    near = np.array([[1, 2, 3, 4, 7, 8, 9]] * 10)
    x = 3 / (4.685 / 0.6745)
    assert tukey_weights(residuals, near, 0.0)[0] == pytest.approx((1 - x**2) ** 2, rel=1e-12)
    assert tukey_weights(10 * residuals, near, 0.0)[0] == pytest.approx((1 - x**2) ** 2, rel=1e-12)
    assert tukey_weights(residuals, near, 2.0)[0] == pytest.approx((1 - (x / 2) ** 2) ** 2, rel=1e-12)


@pytest.mark.parametrize("d", [1, 2, 3])
def test_the_share_that_biweights_keep_of_normal_residuals(d):
    cut = (4.685 / 0.6745) ** 2 * stats.chi2.median(d)
    mean = stats.chi2(d).expect(lambda s: s * np.maximum(1 - s / cut, 0) ** 2)
    assert kept_share(d) == pytest.approx(mean / d, rel=1e-4)  # the moments run beyond the cut


def test_neighbours_are_the_nearest_others_in_units_of_the_extent():
    u, v = np.meshgrid(np.arange(4.0), 100 * np.arange(4.0), indexing="ij")
    near = neighbours(u.ravel(), v.ravel(), 2)
    assert near.shape == (16, 2)
    assert sorted(near[0]) == [1, 4]
    assert neighbours(np.zeros(2), np.arange(2.0), 4).tolist() == [[1], [0]]


def test_noise_is_called_noise_in_all_but_one_of_700_cases():
    u, v = everywhere(np.random.default_rng(0), 400)
    near = neighbours(u, v, 4)
    rng = np.random.default_rng(1)
    calls = [are_noise(rng.normal(size=(400, 1 + k % 2)), near) for k in range(700)]
    assert calls.count(False) <= 7  # the bound of the variance is generous


def test_detail_below_the_noise_is_not_called_noise():
    u, v = everywhere(np.random.default_rng(0), 2000)
    detail = 0.5 * np.sin(20 * u) + np.random.default_rng(1).normal(size=2000)
    assert not are_noise(detail[:, None], neighbours(u, v, 4))


@pytest.mark.parametrize("n", [1, 2, 3])
def test_hardly_any_samples_hold_no_outlier(n):
    space = tensor(1, 1)
    u, v = everywhere(np.random.default_rng(0), n)
    surface = THBSurface(space, np.zeros(space.dim))
    assert robust_weights(surface, Samples(u, v, np.zeros(n))).tolist() == [1.0] * n
