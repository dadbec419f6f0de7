"""What is told of made lenses: quantiles, yields, and intervals that hold what they promise."""

import numpy as np
import pytest

from optics.tolerancing.monte_carlo_samples import SampleBatch


def batch(rel_l2, good=0.15):
    values = np.asarray(rel_l2, dtype=float)
    return SampleBatch(values, np.full(values.shape, 0.9), values <= good)


def test_the_interval_of_a_yield_holds_it_as_often_as_it_says():
    """400 batches of 8 x 64 independent lenses; 0.95 of them hold the truth, within three deviations."""
    rng = np.random.default_rng(4)
    held = 0
    for _ in range(400):
        found = batch(rng.normal(1.0, 0.3, (8, 64))).passing(1.0)
        held += found.low <= 0.5 <= found.high
    assert held / 400 == pytest.approx(0.95, abs=3 * np.sqrt(0.95 * 0.05 / 400))


@pytest.mark.parametrize(("limit", "value"), [(0.5, 0.0), (2.0, 1.0)])
def test_sets_that_agree_leave_room_for_what_was_not_drawn(limit, value):
    found = batch(np.ones((8, 64))).passing(limit)
    assert found.value == value
    assert found.low <= value <= found.high
    # of 512 lenses without one: 3.84 / (512 + 3.84) by Wilson
    assert found.high - found.low == pytest.approx(0.00745, rel=0.01)


def test_quantiles_are_lenses():
    values = np.arange(512.0).reshape(8, 64)
    made = batch(values)
    assert made.quantile(0.5).value == 256
    assert values[made.nearest(0.95)] == made.quantile(0.95).value
    assert made.mean_square().value == pytest.approx(np.mean(np.arange(512.0) ** 2))


def test_lenses_that_cannot_be_traced_fail():
    values = np.full((8, 4), 0.1)
    values[2, 1] = np.inf
    data = batch(values).data(0.2)
    assert data["not_traced"] == 1
    assert data["within_limit"]["value"] == pytest.approx(31 / 32)
    assert data["yield"]["value"] == pytest.approx(31 / 32)
    assert batch(values, good=0.05).data(0.2)["yield"]["value"] == 0
    assert data["rel_l2"]["95%"]["value"] == pytest.approx(0.1)
