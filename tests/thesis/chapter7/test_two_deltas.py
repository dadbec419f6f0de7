"""Two sources: the exact solution, against rational arithmetic, bounded least squares and the general
solver."""

from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from hypothesis import given, strategies as st
from numpy.testing import assert_allclose

from examples.thesis.chapter7 import two_deltas as chains
from examples.thesis.chapter7.two_deltas import approximate_two_deltas, chains_of
from optics.designing.etendue import Kernel, approximate
from tests.optics.designing.etendue.cases import matrix, optimum

EXACT = 1e-12  # condition number of these chains, below 400, times rounding


def solved(a, b):
    """Return the solution of a x = b in fractions (Gauss-Jordan)."""
    rows = [[*row, value] for row, value in zip(a, b)]
    for i in range(len(rows)):
        rows[i] = [x / rows[i][i] for x in rows[i]]
        rows = [
            row if j == i else [x - row[i] * y for x, y in zip(row, rows[i])] for j, row in enumerate(rows)
        ]
    return [row[-1] for row in rows]


def rational_optimum(weights, target):
    """Return the f >= 0 of least ||w0 f[k] + w1 f[k - 1] - g[k]||^2 by trying every set of free pixels, in
    fractions."""
    w0, w1 = weights
    n = len(target) - 1
    right = [w0 * target[k] + w1 * target[k + 1] for k in range(n)]
    entry = {0: w0 * w0 + w1 * w1, 1: w0 * w1}
    for choice in product([False, True], repeat=n):
        free = [k for k in range(n) if choice[k]]
        f = [Fraction(0)] * n
        for k, value in zip(
            free, solved([[entry.get(abs(i - j), 0) for j in free] for i in free], [right[k] for k in free])
        ):
            f[k] = value
        slope = [sum(entry.get(abs(i - j), 0) * f[j] for j in range(n)) - right[i] for i in range(n)]
        if all(x >= 0 for x in f) and all(s >= 0 for s, c in zip(slope, choice) if not c):
            return f
    raise AssertionError("a strictly convex problem has a solution")


@given(
    st.lists(st.integers(0, 9), min_size=1, max_size=6).filter(any),
    st.tuples(st.integers(1, 5), st.integers(1, 5)),
    st.sampled_from([(0, 1), (1, 0), (0, -1)]),
)
def test_a_chain_in_fractions(values, weights, shift):
    row = np.array([0, *values, 0], dtype=float)
    part = [Fraction(w, sum(weights)) for w in weights]
    chain = row if sum(shift) > 0 else row[::-1]
    expected = rational_optimum(part, [Fraction(int(g)) for g in chain])
    target = row[None] if shift[0] == 0 else row[:, None]
    result = approximate_two_deltas(shift, weights, target)
    light = result.light.ravel() if sum(shift) > 0 else result.light.ravel()[::-1]
    assert_allclose(light[:-1], np.array(expected, dtype=float), atol=9 * EXACT)
    assert result.kkt <= EXACT


@st.composite
def framed(draw):
    """A shift, weights, and a target that is dark near its border."""
    shift = draw(st.tuples(st.integers(-3, 3), st.integers(-3, 3)))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    inside = rng.random((7, 6)) * (rng.random((7, 6)) < draw(st.floats(0.3, 1)))
    inside[3, 3] = 1
    target = np.pad(inside, [(abs(s), abs(s)) for s in shift])
    return shift, tuple(rng.random(2) + 0.05), target


@given(framed())
def test_two_sources_reach_the_optimum(case):
    shift, weights, target = case
    result = approximate_two_deltas(*case)
    kernel = Kernel.points([(0, 0), shift], weights)
    assert_allclose(result.residual, optimum(matrix(kernel, target.shape), target), atol=EXACT)
    assert result.kkt <= EXACT
    assert result.residual - result.lower_bound <= 1e-10
    assert (result.solution >= 0).all()
    assert_allclose(result.image, kernel.apply(result.solution))


@given(framed())
def test_the_general_solver_agrees(case):
    shift, weights, target = case
    exact = approximate_two_deltas(*case)
    general = approximate(Kernel.points([(0, 0), shift], weights), target, 1e-7, 20_000)
    assert general.lower_bound - 1e-10 <= exact.residual <= general.residual + EXACT
    # the optimal image is the projection on a convex set: the squares of the distances differ by at least
    # this much
    apart = np.sum((general.image - exact.image) ** 2) / np.sum(target**2)
    assert apart <= general.residual**2 - exact.residual**2 + EXACT
    assert apart <= 1e-8


@given(framed())
def test_the_chains_cover_the_light_once(case):
    shift, _, target = case
    if shift == (0, 0):
        return
    found = chains_of(shift, target)
    assert len(np.unique(found.pixels)) == len(found.pixels)
    assert set(np.flatnonzero(target)) <= set(found.pixels)
    at = np.stack(np.unravel_index(found.pixels, target.shape), axis=1)
    same = np.diff(found.chain) == 0
    assert (np.diff(at, axis=0)[same] == shift).all()
    assert (found.lit[:-1] == same).all()


@given(framed())
def test_the_rule_that_always_ends_gives_the_same(case):
    """One pixel at a time, the last infeasible one of each chain (Murty), as where the faster rule should
    cycle."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(chains, "PATIENCE", -1)
        slow = approximate_two_deltas(*case)
    fast = approximate_two_deltas(*case)
    assert_allclose(slow.solution, fast.solution, atol=EXACT)  # the number of steps may differ either way


def test_the_rule_that_always_ends_changes_one_pixel_of_a_chain():
    target = np.array([[0, 4, 4, 4, 9, 1, 4, 0, 4, 0]], dtype=float)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(chains, "PATIENCE", -1)
        slow = approximate_two_deltas((0, 1), (1, 1), target)
    assert approximate_two_deltas((0, 1), (1, 1), target).iterations == 3
    assert slow.iterations == 6


def test_one_source_is_a_shift():
    target = np.pad(np.random.default_rng(0).random((5, 5)), 3)
    for weights, shift in (((1, 0), (0, 0)), ((1, 0), (2, 3)), ((0, 1), (2, -3))):
        result = approximate_two_deltas(shift, weights, target)
        assert result.residual == 0
        assert_allclose(result.solution.sum(), target.sum())


def test_a_long_chain():
    rng = np.random.default_rng(4)
    target = np.zeros((1, 4002))
    target[0, 1:-1] = rng.random(4000)
    result = approximate_two_deltas((0, 1), (1, 1), target)
    assert result.kkt <= 1e-9  # the condition number of the longest chain is 6e6
    assert result.residual - result.lower_bound <= 1e-8


def test_a_lit_border_is_refused():
    with pytest.raises(ValueError, match="dark within 2 rows and 1 columns"):
        approximate_two_deltas((2, 1), (1, 1), np.ones((9, 9)))
    with pytest.raises(ValueError, match="not negative"):
        approximate_two_deltas((2, 1), (1, -1), np.ones((9, 9)))
    with pytest.raises(ValueError, match="smaller than the kernel"):
        approximate_two_deltas((5, 1), (1, 1), np.ones((9, 9)))
