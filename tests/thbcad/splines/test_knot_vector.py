"""Univariate B-splines against exact arithmetic, scipy and their defining properties."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.interpolate import BSpline

from oracles.spline_definitions import boehm, cox_de_boor, gamma
from tests.cases import examples
from tests.thbcad.cases import SCALES, insertions, knot_vectors, parameters, unclamped
from thbcad.splines.knot_vector import KnotVector

EPS = np.finfo(float).eps
UNIFORM = KnotVector.uniform(3, 4)


def exactly(matrix):
    """Return a sparse matrix as rows of Fractions."""
    return [[Fraction(x) for x in row] for row in matrix.toarray().tolist()]


def slope_scale(kv, derivative):
    """Bound on the size of the terms of a derivative: (2 p / shortest span)^r."""
    return (2 * kv.degree / np.diff(kv.breaks).min()) ** derivative


@st.composite
def knots_and_parameters(draw, **options):
    kv = draw(knot_vectors(**options))
    return kv, draw(parameters(kv))


@st.composite
def knots_and_insertions(draw, **options):
    kv = draw(knot_vectors(**options))
    return kv, draw(insertions(kv))


@given(knots_and_parameters())
def test_partition_of_unity_and_non_negative(case):
    kv, u = case
    a = kv.collocation(u)
    assert a.data.min() >= 0
    # 5 roundings per degree in each entry (two differences, quotient, product, sum), then the sum of p + 1
    # entries
    assert abs(a.sum(axis=1) - 1).max() <= float(gamma(6 * kv.degree + 1))


@given(knots_and_parameters(), st.integers(0, 4))
def test_local_support(case, derivative):
    kv, u = case
    a = kv.collocation(u, derivative).toarray()
    outside = (u[:, None] < kv.knots[: kv.dim]) | (u[:, None] > kv.knots[kv.degree + 1 :])
    assert (a[outside] == 0).all()
    assert a.shape == (len(u), kv.dim)


@examples(30)
@given(st.data())
def test_values_and_derivatives_are_those_of_exact_arithmetic(data):
    """Every entry within 5 roundings per degree of the exact Cox-de Boor value of the same float64 knots."""
    kv, u = data.draw(knots_and_parameters(max_spans=4))
    u = u[:4]
    derivative = data.draw(st.integers(0, kv.degree + 1))
    a = exactly(kv.collocation(u, derivative))
    for row, x in zip(a, u):
        if derivative > kv.degree:
            assert not any(row)
            continue
        values, sizes = cox_de_boor(kv.knots, kv.degree, x, derivative)
        assert all(
            abs(got - want) <= gamma(5 * kv.degree) * size for got, want, size in zip(row, values, sizes)
        )


@pytest.mark.parametrize("degree", range(1, 11))
def test_every_degree_and_derivative_against_scipy(degree):
    breaks = np.array([-1.0, -0.25, 0.5, 0.75, 2.0, 3.5])
    kv = KnotVector(degree, np.repeat(breaks, [degree + 1, 1, degree, min(2, degree), 1, degree + 1]))
    u = np.r_[np.linspace(-1, 3.5, 101), breaks]
    spline = BSpline(kv.knots, np.eye(kv.dim), degree, extrapolate=False)
    for derivative in range(degree + 1):
        error = abs(kv.collocation(u, derivative).toarray() - spline(u, nu=derivative)).max()
        assert error <= 10 * degree * EPS * slope_scale(kv, derivative)


@given(knots_and_parameters(), st.integers(0, 10))
def test_random_knots_against_scipy(case, derivative):
    kv, u = case
    want = BSpline(kv.knots, np.eye(kv.dim), kv.degree, extrapolate=False)(u, nu=derivative)
    error = abs(kv.collocation(u, derivative).toarray() - want).max()
    assert error <= 10 * kv.degree * EPS * slope_scale(kv, derivative)


def test_the_end_of_the_domain_belongs_to_the_last_span():
    kv = KnotVector(2, [0, 0, 0, 1, 1, 2, 2, 2])
    assert kv.collocation([2.0]).toarray().tolist() == [[0, 0, 0, 0, 1]]
    assert kv.collocation([0.0]).toarray().tolist() == [[1, 0, 0, 0, 0]]
    assert kv.span_of([0.0, 1.0, 2.0]).tolist() == [2, 4, 4]


def test_no_parameters_give_an_empty_matrix():
    assert UNIFORM.collocation([]).shape == (0, 7)


@given(knot_vectors())
def test_counts(kv):
    p = kv.degree
    assert len(kv.knots) == kv.dim + p + 1
    assert kv.spans == len(kv.breaks) - 1 == len(np.unique(kv.knots)) - 1
    assert (kv.start, kv.stop) == (kv.breaks[0], kv.breaks[-1])


@given(knots_and_parameters())
def test_greville_coefficients_reproduce_the_identity(case):
    kv, u = case
    reach = abs(kv.knots).max()
    assert (np.diff(kv.greville()) >= 0).all()
    assert abs(kv.collocation(u) @ kv.greville() - u).max() <= float(gamma(7 * kv.degree + 2)) * reach


@given(knot_vectors())
def test_greville_abscissae_do_not_leave_the_domain(kv):
    """They are parameters: the first and last are the ends, all can be handed to `collocation`."""
    g = kv.greville()
    assert (g[0], g[-1]) == (kv.start, kv.stop)
    assert (g >= kv.start).all()
    assert (g <= kv.stop).all()
    assert kv.collocation(g).shape == (kv.dim, kv.dim)


@given(knot_vectors())
def test_integrals_against_scipy(kv):
    want = [BSpline(kv.knots, c, kv.degree).integrate(kv.start, kv.stop) for c in np.eye(kv.dim)]
    width = kv.stop - kv.start
    # scipy evaluates the antiderivative at both ends and subtracts
    assert np.allclose(kv.integrals(), want, rtol=0, atol=20 * kv.degree * EPS * width)
    assert kv.integrals().sum() == pytest.approx(width, rel=float(gamma(kv.dim + 3)))


@examples(30)
@given(knots_and_insertions(max_spans=4))
def test_prolongation_is_exact_knot_insertion(case):
    """The Oslo rows against Boehm's insertion in exact arithmetic, to 5 roundings per degree, zeros
    included."""
    kv, new = case
    got = exactly(kv.prolongation(kv.insert(new)))
    want = boehm(kv.knots, kv.degree, new)
    assert len(got) == len(want)
    for row, exact in zip(got, want):
        assert all(abs(a - b) <= gamma(5 * kv.degree) * b for a, b in zip(row, exact))


@given(st.data())
def test_prolongation_keeps_the_spline(data):
    kv, new = data.draw(knots_and_insertions())
    u = data.draw(parameters(kv))
    finer = kv.insert(new)
    p = kv.prolongation(finer)
    assert p.shape == (kv.dim + len(new), kv.dim) == (finer.dim, kv.dim)
    assert p.data.min() >= 0
    assert abs(p.sum(axis=1) - 1).max() <= float(gamma(6 * kv.degree + 1))
    # values of both sides are convex combinations: 5 p roundings each, and those of the matrix, and of two
    # sums
    error = abs((finer.collocation(u) @ p - kv.collocation(u)).toarray()).max()
    assert error <= float(gamma(17 * kv.degree + 2))


@given(unclamped(), st.data())
def test_operators_between_unclamped_knots_are_convex_combinations(kv, data):
    """However short the first span is beside those outside the domain."""
    u = data.draw(parameters(kv))
    for finer, operator in (
        *((f, kv.prolongation(f)) for f in (kv.bisect(), kv.insert(data.draw(insertions(kv))))),
        (kv.elevate(), kv.elevation()),
    ):
        assert operator.min() >= 0
        rounding = float(gamma(17 * finer.degree + 2))
        assert abs(operator.sum(axis=1) - 1).max() <= rounding
        assert abs((finer.collocation(u) @ operator - kv.collocation(u)).toarray()).max() <= rounding


@given(st.data())
def test_prolongations_compose(data):
    kv, new = data.draw(knots_and_insertions(scales=SCALES))
    middle = kv.insert(new)
    finest = middle.insert(data.draw(insertions(middle)))
    two_steps = (middle.prolongation(finest) @ kv.prolongation(middle)).toarray()
    total = kv.prolongation(finest).toarray()
    # all entries are sums of non-negative terms: relative accuracy
    assert (abs(two_steps - total) <= float(gamma(16 * kv.degree + 1)) * total).all()


@given(knot_vectors())
def test_bisection_halves_every_span_and_no_other(kv):
    finer = kv.bisect()
    assert finer.spans == 2 * kv.spans
    assert finer.dim == kv.dim + kv.spans
    assert (finer.breaks[::2] == kv.breaks).all()
    widths, halves = np.diff(kv.breaks), np.diff(finer.breaks)
    assert abs(halves - np.repeat(widths / 2, 2)).max() <= 2 * EPS * abs(kv.breaks).max()
    assert (np.unique(finer.knots, return_counts=True)[1][1::2] == 1).all()


@given(knot_vectors())
def test_prolongation_to_itself_is_the_identity(kv):
    p = kv.prolongation(kv).toarray()
    assert (p[~np.eye(kv.dim, dtype=bool)] == 0).all()
    assert abs(np.diag(p) - 1).max() <= float(gamma(5 * kv.degree))


def test_inserting_nothing_and_scalars():
    assert (UNIFORM.insert([]).knots == UNIFORM.knots).all()
    assert UNIFORM.insert(0.5).knots.tolist().count(0.5) == 2


def test_thesis_bisection_3_34():
    """Degree 2 with an interior knot: the first and last rows of the matrix of (3.30), with 1/4 last (the
    thesis prints 1/2)."""
    kv = KnotVector.uniform(2, 4)
    p = kv.prolongation(kv.bisect()).toarray()
    assert p.shape == (10, 6)
    assert p[:4, :3].tolist() == [[1, 0, 0], [0.5, 0.5, 0], [0, 0.75, 0.25], [0, 0.25, 0.75]]
    assert (p == p[::-1, ::-1]).all()


@given(st.integers(1, 10), st.integers(1, 30), st.floats(-1e3, 1e3), st.floats(1e-3, 1e3))
def test_uniform(degree, spans, start, width):
    kv = KnotVector.uniform(degree, spans, start, start + width)
    assert (kv.dim, kv.spans, kv.start, kv.stop) == (spans + degree, spans, start, start + width)
    assert abs(np.diff(kv.breaks) - width / spans).max() <= 4 * EPS * (abs(start) + width)


@given(knot_vectors())
def test_clamped_puts_the_ends_around_the_inner_knots(kv):
    p = kv.degree
    assert (KnotVector.clamped(p, kv.knots[p + 1 : -p - 1], kv.start, kv.stop).knots == kv.knots).all()


@given(knot_vectors())
def test_greville_abscissae_are_means_of_the_inner_knots(kv):
    assert kv.inner_knots().shape == (kv.dim, kv.degree)
    reach = max(abs(kv.start), abs(kv.stop))
    assert abs(kv.inner_knots().mean(axis=1) - kv.greville()).max() <= float(gamma(3 * kv.degree + 2)) * reach


@given(st.floats(-1e3, 1e3), st.floats(1e-3, 1e4), st.integers(1, 7))
def test_rescaled(start, width, spans):
    stop = start + width
    kv = KnotVector.uniform(2, spans, -0.3, 1.9).rescale(start, stop)
    assert (kv.start, kv.stop, kv.spans) == (start, stop, spans)
    # positions err by 3 roundings of the size of the ends and 3 of the width
    assert abs(np.diff(kv.breaks) - (stop - start) / spans).max() <= 8 * EPS * (
        abs(start) + abs(stop) + width
    )
    assert kv.rescale(start, stop) is kv


def test_merged_keeps_the_larger_multiplicities():
    one, two = KnotVector(2, [0, 0, 0, 1, 1, 2, 4, 4, 4]), KnotVector(2, [0, 0, 0, 1, 3, 3, 4, 4, 4])
    assert one.merge(two).knots.tolist() == two.merge(one).knots.tolist() == [0, 0, 0, 1, 1, 2, 3, 3, 4, 4, 4]


@pytest.mark.parametrize(
    "other",
    [KnotVector.uniform(2, 4), KnotVector.uniform(3, 4, -1.0, 1.0), KnotVector.uniform(3, 4, 0.0, 2.0)],
)
def test_knots_of_other_degree_or_ends_are_not_merged(other):
    with pytest.raises(ValueError, match="must agree in degree and ends"):
        UNIFORM.merge(other)


def test_arrays_are_read_only_copies():
    knots = np.array([0.0, 0, 1, 1])
    kv = KnotVector(1, knots)
    knots[2:] = 5
    assert kv.knots.tolist() == [0, 0, 1, 1]
    for array in (kv.knots, kv.breaks):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1


@pytest.mark.parametrize("degree", [True, 0, 11, -1, 2.0, 2.5, "3", None, np.float64(2), 10**9])
def test_degree_is_refused_before_knots_are_made(degree):
    for make in (
        lambda p: KnotVector(p, [0, 0, 0, 1, 1, 1]),
        lambda p: KnotVector.uniform(p, 2),
        lambda p: KnotVector.clamped(p, [], 0, 1),
    ):
        with pytest.raises(ValueError, match="degree must be an integer from 1 to 10"):
            make(degree)


@pytest.mark.parametrize(
    ("degree", "knots", "message"),
    [
        (3, [0, 0, 0, 0, 1, 1, 1], r"at least 2 \* degree \+ 2 = 8 numbers, got shape \(7,\)"),
        (1, [[0, 0, 1, 1]], r"got shape \(1, 4\)"),
        (1, 1.0, r"got shape \(\)"),
        (1, [0, 0, np.nan, 1, 1], r"knots\[2\] is not finite"),
        (1, [0, 0, 1, np.inf, np.inf], r"knots\[3\] is not finite"),
        (1, [0, 0, 2, 1, 3, 3], r"must not decrease, got knots\[2\] = 2.0 > knots\[3\] = 1.0"),
        (
            2,
            [0, 1, 2, 2, 3, 4, 5],
            r"domain \[t_p, t_\(m-p\)\] = \[2.0, 3.0\] must end with spans that are not",
        ),
        (2, [0, 1, 2, 3, 3, 4, 5], "must end with spans that are not empty"),
        (1, [2, 2, 2, 2], "occurs more than degree = 1 times"),
        (2, [0, 0, 0, 1, 1, 1, 2, 2, 2], r"knot 1.0 occurs more than degree = 2 times"),
        (1, [0, 0, 0, 1, 1], r"knot 0.0 occurs more than degree = 1 times"),
        (1, [0, 0, 1, 1, 1], r"knot 1.0 occurs more than degree = 1 times"),
        (1, ["a", 0, 1, 1], "could not convert"),
        (
            1,
            [-1.7e308, -1.7e308, 1.7e308, 1.7e308],
            r"knots must lie between -1e\+300 and 1e\+300, got -1.7e\+308 to 1.7e\+308",
        ),
    ],
)
def test_knots_are_refused(degree, knots, message):
    with pytest.raises(ValueError, match=message):
        KnotVector(degree, knots)


@pytest.mark.parametrize(("start", "stop"), [(1, 1), (2, 1), (np.nan, 1), (0, np.nan), (None, 1), (0, "a")])
def test_uniform_interval_is_refused(start, stop):
    with pytest.raises(
        ValueError, match=r"start must be less than stop|(start|stop) must be a finite number"
    ):
        KnotVector.uniform(3, 4, start, stop)


@pytest.mark.parametrize(
    ("call", "values", "words"),
    [
        (
            lambda u: UNIFORM.collocation([0.5, u]),
            [-1e-9, np.nextafter(1.0, 2), np.nan, np.inf, -np.inf],
            r"lies outside the domain \[0.0, 1.0\]",
        ),
        (UNIFORM.collocation, [[[0.1, 0.2]]], r"u must be one row of numbers, got shape \(1, 2\)"),
        (
            lambda order: UNIFORM.collocation([0.5], order),
            [-1, True, 1.0, None, "1"],
            "derivative must be a non-negative integer",
        ),
        (
            lambda knot: UNIFORM.insert([0.3, knot]),
            [0.0, 1.0, -0.5, 1.5, np.nan, np.inf],
            r"lies outside the open domain \(0.0, 1.0\)",
        ),
        (UNIFORM.insert, [[0.5] * 3], r"knot 0\.5 occurs more than degree = 3 times"),
        (
            lambda n: KnotVector.uniform(3, n),
            [0, -3, True, 2.5, "4", 10**11],
            "spans must be an integer from 1",
        ),
    ],
    ids=["parameters", "shapes", "orders", "knots", "multiplicities", "spans"],
)
def test_bad_arguments_are_refused(call, values, words):
    for value in values:
        with pytest.raises(ValueError, match=words):
            call(value)


@pytest.mark.parametrize(
    ("finer", "message"),
    [
        (KnotVector.uniform(2, 4), "degrees differ: 3 and 2"),
        (KnotVector.uniform(3, 2), "lacks the knot 0.25"),
        (KnotVector.uniform(3, 3), "lacks the knot 0.25"),
        (KnotVector.uniform(3, 8, 0, 2), "must have the same domain"),
    ],
)
def test_prolongation_to_other_knots_is_refused(finer, message):
    with pytest.raises(ValueError, match=message):
        UNIFORM.prolongation(finer)


def test_prolongation_counts_multiplicities():
    with pytest.raises(ValueError, match=r"lacks the knot 0\.5"):
        UNIFORM.insert(0.5).prolongation(UNIFORM.bisect())
