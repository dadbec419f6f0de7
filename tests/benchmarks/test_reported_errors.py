"""Reported errors against the spread over seeds: the bench's arithmetic, and a third of its seeds."""

import numpy as np
import pytest
from scipy import stats

from benchmarks.tracing.repeated_scenes import BY_CELLS, SCENES, Sample, coarser, reported
from benchmarks.tracing.reported_errors import (
    FINER,
    GRID,
    HIGH,
    LOW,
    MOST_MARGIN,
    SEEDS,
    grid_errors,
    measured,
    spreads_of,
)

THIRD = SEEDS // 3
REPLICATES = 4  # behind a reported error, at least
CHANCE = 1e-3 / 50  # of a right number to be outside: 1e-3 for all of about 50


def drawn(error, spread=0.3, seeds=400):
    """Return samples of a number 7 with a spread, and an error that is reported."""
    fresh = np.random.default_rng(1)
    return [Sample({"a": (7 + spread * fresh.standard_normal(), error)}, None) for _ in range(seeds)]


@pytest.mark.parametrize("error", [0.1, 0.3, 1.2])
def test_the_ratio_is_the_spread_over_the_reported_error(error):
    """The spread of 400 values errs by 1 / sqrt(2 x 400) = 3.5 %; four times that are allowed."""
    (spread,) = spreads_of(drawn(error)).values()
    assert spread.ratio == pytest.approx(0.3 / error, rel=0.14)
    assert spread.outside == (error != 0.3)


def test_a_spread_without_any_error_is_outside():
    (spread,) = spreads_of(drawn(0.0)).values()
    assert spread.outside


def test_a_number_that_is_the_same_every_time_and_has_no_error_is_left_out():
    assert spreads_of(drawn(0.0, spread=0.0)) == {}


def test_a_number_that_most_seeds_do_not_know_is_left_out():
    unknown = [Sample({"a": (None, 0.3)}, None) for _ in range(401)]
    assert spreads_of([*drawn(0.3), *unknown]) == {}


def test_numbers_come_with_their_errors_from_all_tables():
    metrics = {
        "rel_l2": 0.2,
        "rel_l2_debiased": 0.1,
        "rel_l2_error": 0.01,
        "contrast_error": 0.3,
        "contrast_error_std": 0.02,
        "efficiency": 0.9,
        "uniformity": {"rsd": 0.5, "rsd_error": 0.04},
        "zones": [{"name": "middle", "value": 3.0, "error": 0.5}],
    }
    assert dict(reported(metrics)) == {
        "rel_l2_debiased": (0.1, 0.01),
        "contrast_error": (0.3, 0.02),
        "uniformity.rsd": (0.5, 0.04),
        "zone middle": (3.0, 0.5),
    }


def test_light_on_larger_pixels_has_the_flux_of_the_smaller_ones():
    image, shown = np.random.default_rng(2).uniform(1, 2, (2, 12, 8))
    larger = coarser(image, shown, (3, 2))
    flux = (image * shown).reshape(3, 4, 2, 4).sum(axis=(1, 3))
    np.testing.assert_allclose(larger * shown.reshape(3, 4, 2, 4).sum(axis=(1, 3)), flux, rtol=1e-14)


@pytest.mark.slow
@pytest.mark.parametrize("scene", SCENES, ids=lambda scene: scene.name)
def test_the_spread_over_seeds_is_the_reported_error(scene):
    """The squared ratio of a right number is that of two variances, of THIRD values and of as many reported
    errors, which is distributed as F.  The limits of the bench are wider by its quantiles."""
    freedom = THIRD - 1, THIRD * (REPLICATES - 1)
    low, high = np.sqrt(stats.f.ppf([CHANCE / 2, 1 - CHANCE / 2], *freedom))
    found = spreads_of([measured(scene, (seed, 1)) for seed in range(THIRD)])
    outside = {name: s.ratio for name, s in found.items() if not LOW * low <= s.ratio <= HIGH * high}
    assert found
    assert outside == {}


@pytest.mark.slow
@pytest.mark.parametrize("scene", BY_CELLS, ids=lambda scene: scene.name)
def test_the_error_of_light_by_cells_is_its_difference_from_a_finer_grid(scene):
    usual, fine = (measured(scene, (0, finer)) for finer in (1, FINER))
    off = {found.name: found.ratio for found in grid_errors(scene, usual, fine) if found.ratio > GRID}
    assert off == {}
    assert usual.margin <= MOST_MARGIN
