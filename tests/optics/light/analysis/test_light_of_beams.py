"""Samples of diverging light: where they lie on the disk of directions."""

import numpy as np
from scipy.stats import kstest

from optics.light.analysis.light_of_beams import SUNFLOWER, _disk_points


def test_rings_of_different_sets_lie_anywhere():
    """Over many sets the share of the area within is even from 0 to 1: so sets differ by what each leaves."""
    rng = np.random.default_rng(5)
    within = np.array([_disk_points(1, rng)[:SUNFLOWER, 0, 0] for _ in range(400)])
    assert (np.floor(SUNFLOWER * within) == np.arange(SUNFLOWER)).all()  # one in each ring
    for ring, share in enumerate(within.T):
        assert kstest(SUNFLOWER * share - ring, "uniform").pvalue > 1e-3


def test_samples_are_turned_by_quarters():
    points = _disk_points(1, np.random.default_rng(6))[:, 0]
    of_quarters = points.reshape(4, SUNFLOWER, 2)
    assert (of_quarters[..., 0] == of_quarters[0, :, 0]).all()
    np.testing.assert_allclose(np.diff(of_quarters[..., 1], axis=0), np.pi / 2, rtol=0, atol=1e-14)
