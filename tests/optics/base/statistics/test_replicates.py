"""Errors from replicates, against closed forms and against the spread of many repetitions."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from optics.base.statistics import (
    crossed_choice,
    crossed_error,
    drift_error,
    drift_signs,
    jackknife_error,
    root_error,
    standard_error,
    unbiased_square,
)

COUNT, REPEATED = 8, 2000


def correlated(rng, size):
    """Noise of variance 1 that neighbours share over 5 places, (REPEATED, COUNT, size)."""
    apart = np.abs(np.subtract.outer(np.arange(size), np.arange(size)))
    root = np.linalg.cholesky(np.exp(-apart / 5) + 1e-9 * np.eye(size))
    return rng.normal(size=(REPEATED, COUNT, size)) @ root.T


@given(st.integers(2, 12), st.integers(0, 10**6))
def test_the_jackknife_of_a_mean_is_its_standard_error(count, seed):
    draws = np.random.default_rng(seed).normal(size=count)
    found = jackknife_error(count, lambda r: (draws.sum() - draws[r]) / (count - 1))
    assert found == pytest.approx(float(standard_error(draws)), rel=1e-9)


def test_one_measurement_has_no_spread():
    draws = np.ones((1, 5))
    assert not standard_error(draws).any()
    assert jackknife_error(1, lambda r: 1.0) == 0.0
    assert unbiased_square(draws) == (5.0, 0.0)
    assert crossed_error(draws[:, 0], crossed_choice(draws, np.argmin)) == 0.0


@pytest.mark.parametrize(("size_of", "within"), [(0.3, 0.15), (2.0, 0.1)])
def test_a_square_is_right_on_average_and_spreads_as_its_variance_says(size_of, within):
    """Noise of variance 1 in each replicate, which neighbours share."""
    rng, true = np.random.default_rng(2), np.full(50, size_of)
    found = np.array([unbiased_square(true + noise) for noise in correlated(rng, 50)])
    values, variances = found.T
    assert values.mean() == pytest.approx(true @ true, abs=4 * values.std() / np.sqrt(REPEATED))
    assert np.sqrt(variances.mean()) == pytest.approx(values.std(), rel=within)


def test_the_variance_of_noise_alone_is_not_underestimated():
    """Where there is nothing but noise it is too large by less than a half, as a standard deviation."""
    found = np.array([unbiased_square(noise) for noise in correlated(np.random.default_rng(3), 50)])
    values, variances = found.T
    assert 1.0 < np.sqrt(variances.mean()) / values.std() < 1.5


@pytest.mark.parametrize("noise", [0.003, 0.03])
@pytest.mark.parametrize(
    ("light", "least"),
    [
        (np.ones(300), 1.0),
        (np.where(np.arange(300) < 100, 0.99, 1.0), 0.99),
        (np.where(np.arange(300) == 5, 0.7, 1.0), 0.7),
    ],
    ids=["even", "two levels", "one dark box"],
)
def test_the_least_of_noisy_light_is_right_within_its_error(light, least, noise):
    """The least value of the mean lies below by 2.9 errors where all are alike."""
    rng, found = np.random.default_rng(4), []
    for _ in range(REPEATED // 4):
        draws = light + np.sqrt(COUNT) * noise * rng.normal(size=(COUNT, 300))
        chosen = crossed_choice(draws, np.argmin)
        values = draws[np.arange(COUNT), chosen]
        found.append((values.mean(), crossed_error(values, chosen)))
    values, errors = np.transpose(found)
    told = np.sqrt(np.mean(errors**2))
    assert abs(values.mean() - least) < 0.4 * told
    assert values.std() == pytest.approx(told, rel=0.2)


def test_a_drift_counts_whole_where_all_of_it_is_alike():
    drift = np.full((3, 4), 0.1)
    shifted = [float(np.sum(signs * drift)) for signs in drift_signs(drift.shape)]
    # 1.2 with equal signs, 0.4 with rows that alternate, 0 with columns or both
    assert drift_error(0.0, shifted) == pytest.approx(np.sqrt(1.2**2 + 0.4**2 / 3))


def test_the_error_of_a_root_is_that_of_its_square_over_twice_the_root():
    assert root_error(4.0, 1e-6) == pytest.approx(1e-3 / 4, rel=1e-3)
    assert root_error(0.0, 1e-6) == pytest.approx(np.sqrt(1e-3))
    assert root_error(-1.0, 1e-6) == root_error(0.0, 1e-6)
