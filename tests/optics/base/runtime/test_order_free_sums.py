"""Sums of scattered numbers: the same bits in any order and on any number of threads, and how exact."""

from fractions import Fraction
from math import frexp

import numpy as np
import pytest
from hypothesis import given, strategies as st

from optics.base.runtime import OrderFreeSums, load_backend
from optics.base.runtime.order_free_sums import DIGITS, FEW, LEAST_EXPONENT
from tests.optics.cases import THREADS, on_threads

LEAST = 2.0 ** (LEAST_EXPONENT + DIGITS)  # smaller sums have the least quantum
positive = st.floats(1e-9, 1e3).filter(lambda x: frexp(x)[0] < 1 - 2.0**-53)  # without 2^63 - 2^10 quanta
numbers = st.floats(-1e3, 1e3).filter(lambda x: not 0 < abs(x) < LEAST)


def summed(backend, values, places, size, most, once=False):
    """Return OrderFreeSums of values, (n, k), added to the packets of k sums at places, (n,)."""
    sums = OrderFreeSums(backend, size, most)
    columns = [backend.array(column) for column in np.transpose(values)]
    sums.add(columns, backend.Index(np.asarray(places, dtype=np.uint32)), once=once)
    return sums


@given(st.lists(st.tuples(st.integers(0, 3), numbers), min_size=1), st.randoms(use_true_random=False))
def test_no_order_changes_a_bit_and_the_error_is_half_a_quantum_a_summand(given_pairs, rng):
    backend = load_backend("double", None)
    most = sum(abs(x) for _, x in given_pairs)
    shuffled = given_pairs[:]
    rng.shuffle(shuffled)
    one, other = (
        summed(backend, [[x] for _, x in pairs], [k for k, _ in pairs], 4, most)
        for pairs in (given_pairs, shuffled)
    )
    assert one.whole.numpy().tobytes() == other.whole.numpy().tobytes()
    assert most == 0 or most / 2 < one.quantum * 2.0**61 <= most
    for k in range(4):
        summands = [Fraction(x) for place, x in given_pairs if place == k]
        error = abs(int(one.whole.numpy()[k]) * Fraction(one.quantum) - sum(summands))
        assert error <= len(summands) * Fraction(one.quantum) / 2


@pytest.mark.parametrize("once", [False, True])
@pytest.mark.parametrize("width", [1, 2, 4])
def test_no_number_of_threads_changes_a_bit(backend, width, once):
    """2^17 summands are shared by several threads, which add to the sums themselves where they are few."""
    size = 1 << 20 if once else 50
    assert once == (FEW * size * width > 1 << 17)
    rng = np.random.default_rng(width)
    values = rng.normal(size=(1 << 17, width)) * 10.0 ** rng.uniform(-9, 0, (1 << 17, 1))
    places = rng.integers(0, 50, len(values))
    most = float(np.abs(values).sum())
    found = [
        on_threads(
            threads, lambda: summed(backend, values, places, size * width, most, once).values().numpy()
        )
        for threads in THREADS
    ]
    assert len({f.tobytes() for f in found}) == 1
    expected = np.zeros((size, width))
    np.add.at(expected, places, values)
    # half a quantum, at most 2^-61 of the sum of moduli, for each of 2^17 summands; numpy rounds 2^-53 of it
    np.testing.assert_allclose(found[0].reshape(size, width), expected, rtol=0, atol=2**17 * 2**-53 * most)


@pytest.mark.parametrize("scale", [1e-290, 1e-30, 1.0, 1e30, 1e290])
def test_a_sum_may_leave_the_range_on_the_way(backend, scale):
    """A hundred times the bound up and down again, with a quarter left; of 1e-290 quanta are 1e-11."""
    values = scale * np.concatenate([np.ones(100), [0.25], -np.ones(100)])
    found = summed(backend, values[:, None], np.zeros(201), 1, scale)
    assert float(found.values().numpy()[0]) == pytest.approx(
        0.25 * scale, rel=1e-12 if scale > 1e-289 else 1e-9
    )


@given(
    st.lists(st.tuples(positive, st.integers(0, 90), st.booleans()), min_size=1, max_size=20),
    st.floats(1e-9, 1e3),
)
def test_summands_may_leave_the_range_where_they_cancel(backend, pairs, rest):
    """Up to 2^90 times what is left: the sum is as exact as if they had not been there."""
    large = [(-x if negative else x) * 2.0**power for x, power, negative in pairs]
    every = [*large, rest, *(-x for x in large)]
    found = summed(backend, [[x] for x in every], [0] * len(every), 1, rest)
    assert abs(float(found.values().numpy()[0]) - rest) <= found.quantum  # halves cancel, and one is left


def test_a_number_of_quanta_becomes_an_integer_modulo_2_to_64(backend):
    """About the ends of the range, and far beyond it; quanta are 1."""
    ends = [2**63 - 2**11, 2**63, 2**63 + 2**11, 3 * 2**63 - 2**12, 3 * 2**63, 2**64 + 2**12, 2**100 + 2**60]
    values = [*ends, *(-x for x in ends)]
    found = summed(backend, [[float(x)] for x in values], list(range(len(values))), len(values), 2.0**61)
    assert found.quantum == 1
    assert found.whole.numpy().tolist() == [(x + 2**63) % 2**64 - 2**63 for x in values]


def test_masked_numbers_do_not_count(backend):
    sums = OrderFreeSums(backend, 1, 4.0)
    values = backend.array([1.0, np.nan, 3.0, np.inf])
    sums.add((values,), backend.Index(0, 0, 0, 0), backend.dr.isfinite(values))
    assert sums.values().numpy().tolist() == [4.0]


@pytest.mark.parametrize("most", [np.nan, np.inf])
def test_without_a_bound_there_is_no_number(backend, most):
    assert np.isnan(summed(backend, [[1.0]], [0], 3, most).values().numpy()).all()


def test_no_light_is_zero(backend):
    assert summed(backend, [[0.0]], [0], 2, 0.0).values().numpy().tolist() == [0.0, 0.0]


def test_sums_of_single_precision_are_rounded_once():
    """A million times 0.1 in float32, which float32 alone sums to 100 958 in order."""
    single = load_backend("single", None)
    value = np.float32(0.1)
    found = summed(single, np.full((1 << 20, 1), value), np.zeros(1 << 20), 1, 2.0**20)
    assert found.values().numpy()[0] == np.float32(float(value) * 2**20)


@pytest.mark.parametrize("copies", [1, 2, 4])
def test_copies_that_begin_with_later_sums_add_up(backend, copies):
    rng = np.random.default_rng(copies)
    values = rng.integers(-8, 9, (copies, 7)).astype(float)
    found = summed(backend, values.reshape(-1, 1), np.arange(values.size), values.size, 1e3).folded(copies)
    wanted = sum(np.concatenate([np.zeros(k), row[: len(row) - k]]) for k, row in enumerate(values))
    np.testing.assert_array_equal(found.numpy(), wanted)
