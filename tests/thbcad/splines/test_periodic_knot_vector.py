"""Periodic B-splines against exact arithmetic, scipy's periodic splines and the clamped conversion."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.interpolate import BSpline, make_interp_spline

from oracles.spline_definitions import cox_de_boor, gamma
from tests.cases import examples
from tests.thbcad.cases import SCALES, seeds
from thbcad import KnotVector, PeriodicKnotVector

EPS = np.finfo(float).eps
UNIFORM = PeriodicKnotVector.uniform(3, 5)


@st.composite
def periodic_vectors(draw, max_degree=10, max_spans=6, scales=SCALES):
    """One period with spans of ratio up to 9 and multiplicities up to the degree, at the seam too; often dim
    <= degree."""
    p = draw(st.integers(1, max_degree))
    gaps = draw(st.lists(st.integers(1, 9), min_size=1, max_size=max_spans))
    counts = draw(st.lists(st.integers(1, p), min_size=len(gaps), max_size=len(gaps)))
    breaks = draw(st.integers(-9, 9)) + np.r_[0, np.cumsum(gaps)]
    return PeriodicKnotVector(p, np.repeat(draw(st.sampled_from(scales)) * breaks, [*counts, 1]))


@st.composite
def parameters(draw, kv, turns=3):
    """Parameters in several periods, the breaks, and the float64 neighbours of breaks."""
    shares = np.array(draw(st.lists(st.integers(-turns * 1024, turns * 1024), min_size=1, max_size=6))) / 1024
    marks = np.array(draw(st.lists(st.sampled_from(kv.breaks.tolist()), max_size=4)))
    return np.r_[
        kv.start + kv.period * shares, marks, np.nextafter(marks, np.inf), np.nextafter(marks, -np.inf)
    ]


@st.composite
def insertions(draw, kv):
    """New knots, on old ones and on the seam too, such that no knot occurs more than degree times."""
    wanted = kv.start + kv.period * np.array(draw(st.lists(st.integers(0, 63), max_size=6))) / 64
    marks = draw(st.lists(st.sampled_from(kv.breaks[:-1].tolist()), max_size=4))
    held, new = kv.knots[:-1].tolist(), []
    for z in [*wanted.tolist(), *marks]:
        if held.count(z) < kv.degree:
            held.append(z)
            new.append(z)
    return new


def wrapped(kv, c):
    """Return the coefficients as scipy wants them: the first p repeated at the end."""
    return np.take(c, np.arange(kv.dim + kv.degree) % kv.dim, axis=0)


def multiplicities(kv):
    return np.unique(kv.knots[:-1], return_counts=True)[1]


def slope_scale(kv, derivative):
    """Bound on the size of the terms of a derivative: (2 p / shortest span)^r."""
    return (2 * kv.degree / np.diff(kv.breaks).min()) ** derivative


def knot_rounding(kv):
    """Relative error of the shortest span from translation by a period: 2 roundings of numbers up to 2 (p +
    2) periods away."""
    return 4 * EPS * (abs(kv.knots).max() + (kv.degree + 2) * kv.period) / np.diff(kv.breaks).min()


@given(periodic_vectors(), st.data())
def test_partition_of_unity_and_non_negative(kv, data):
    u = data.draw(parameters(kv))
    a = kv.collocation(u)
    assert a.shape == (len(u), kv.dim)
    assert a.has_canonical_format
    assert a.data.min() >= 0
    assert abs(a.sum(axis=1) - 1).max() <= float(gamma(6 * kv.degree + 1))


@examples(40)
@given(periodic_vectors(max_spans=4, scales=(1.0,)), st.data())
def test_values_and_derivatives_are_those_of_exact_arithmetic(kv, data):
    """Sums of Cox-de Boor values over the translated knots, whole numbers here; 5 roundings per degree and
    those of the sum."""
    u = data.draw(
        st.lists(st.integers(0, 63), min_size=1, max_size=3).map(
            lambda k: kv.start + kv.period * np.array(k) / 64
        )
    )
    derivative = data.draw(st.integers(0, kv.degree + 1))
    a = kv.collocation(u, derivative).toarray()
    for row, x in zip(a, u):
        if derivative > kv.degree:
            assert not row.any()
            continue
        values, sizes = cox_de_boor(kv.extended, kv.degree, x, derivative)
        for i, got in enumerate(row):
            want, size = sum(values[i :: kv.dim]), sum(sizes[i :: kv.dim])
            assert abs(float(got) - want) <= gamma(6 * kv.degree + 1) * size


@given(periodic_vectors(), st.data())
def test_values_and_derivatives_against_scipy(kv, data):
    """The extended knots and the repeated coefficients are those of a spline in scipy; within the period,
    next to the breaks too."""
    u, derivative = kv.reduced(data.draw(parameters(kv))), data.draw(st.integers(0, kv.degree))
    c = data.draw(seeds()).uniform(-1, 1, (kv.dim, 2))
    want = BSpline(kv.extended, wrapped(kv, c), kv.degree, extrapolate=False)(u, nu=derivative)
    assert abs(kv.collocation(u, derivative) @ c - want).max() <= 10 * kv.degree * EPS * slope_scale(
        kv, derivative
    )


@given(periodic_vectors(), seeds())
def test_values_outside_the_period_against_scipy(kv, rng):
    """scipy reduces parameters by a modulo of its own: they differ by roundings, and the values by the slope
    times that.

    Not right before the seam, where its reduced parameter can round to more than `stop`, and its values are
    NaN.
    """
    u, c = kv.start + kv.period * rng.uniform(-3, 3, 20), rng.uniform(-1, 1, (kv.dim, 2))
    want = BSpline(kv.extended, wrapped(kv, c), kv.degree, extrapolate="periodic")(u)
    moved = 4 * EPS * (abs(u).max() + abs(kv.knots).max())
    assert abs(kv.collocation(u) @ c - want).max() <= 10 * kv.degree * EPS + moved * slope_scale(kv, 1)


@given(periodic_vectors(scales=(1.0,)), st.integers(-3, 3), st.integers(0, 3), seeds())
def test_values_repeat_after_every_period(kv, turns, derivative, rng):
    """Whole periods and parameters of 12 bits: the reduction is exact, and the values are the same
    numbers."""
    u = kv.start + kv.period * rng.integers(0, 4096, 8) / 4096
    assert (kv.collocation(u + turns * kv.period, derivative) != kv.collocation(u, derivative)).nnz == 0


@given(periodic_vectors(), seeds())
def test_clamping_keeps_the_spline_and_its_derivatives(kv, rng):
    own, operator = kv.clamp()
    assert isinstance(own, KnotVector)
    assert (own.start, own.stop, own.degree) == (kv.start, kv.stop, kv.degree)
    assert own.breaks.tolist() == kv.breaks.tolist()
    assert operator.shape == (own.dim, kv.dim)
    assert operator.data.min() >= 0
    assert abs(operator.sum(axis=1) - 1).max() <= float(gamma(6 * kv.degree + 1))
    u = kv.reduced(np.r_[kv.start + kv.period * rng.random(20), kv.breaks])
    for derivative in range(min(kv.degree, 3) + 1):
        error = abs(
            (own.collocation(u, derivative) @ operator - kv.collocation(u, derivative)).toarray()
        ).max()
        assert error <= (17 * kv.degree * EPS + kv.degree * knot_rounding(kv)) * slope_scale(kv, derivative)


@given(periodic_vectors(max_degree=6), seeds())
def test_the_seam_is_as_smooth_as_its_multiplicity_says(kv, rng):
    """C^(p - m) and no more: the derivative of order p - m + 1 jumps."""
    own, operator = kv.clamp()
    c = operator @ rng.uniform(-1, 1, kv.dim)
    smooth = kv.degree - multiplicities(kv)[0]
    for derivative in range(smooth + 1):
        after, before = own.collocation([own.start, own.stop], derivative) @ c
        assert abs(after - before) <= (40 * kv.degree * EPS + kv.degree * knot_rounding(kv)) * slope_scale(
            kv, derivative
        )
    if kv.dim > 1:
        after, before = own.collocation([own.start, own.stop], smooth + 1) @ c
        assert abs(after - before) > 1e-9 * (kv.degree / kv.period) ** (smooth + 1)


@pytest.mark.parametrize("degree", range(1, 11))
def test_uniform_collocation_is_circulant(degree):
    """At the Greville abscissae every row is the one above, turned by one; all rows are values of one
    cardinal B-spline."""
    kv = PeriodicKnotVector.uniform(degree, 16, -2.0, 2.0)
    a = kv.collocation(kv.greville()).toarray()
    cardinal = BSpline.basis_element(np.arange(degree + 2.0), extrapolate=False)
    want = np.nan_to_num(cardinal((degree + 1) / 2 + np.arange(-8, 8)))
    for k in range(16):
        assert (a[k] == np.roll(a[0], k)).all()
    assert np.allclose(a[0], np.roll(want, -8), rtol=0, atol=10 * degree * EPS)
    assert np.linalg.matrix_rank(a) == 16


@pytest.mark.parametrize("degree", range(1, 11))
@pytest.mark.parametrize("spans", [1, 2, 3, 8])
def test_a_turned_row_of_coefficients_is_the_shifted_spline(degree, spans):
    kv = PeriodicKnotVector.uniform(degree, spans, 0.0, float(spans))
    c, u = np.random.default_rng(spans).normal(size=kv.dim), np.arange(0, 64) / 8
    assert (kv.collocation(u + 1) @ c).tolist() == pytest.approx(
        (kv.collocation(u) @ np.roll(c, -1)).tolist(), abs=1e-14 * degree
    )


@given(periodic_vectors(max_degree=9))
def test_the_functions_are_independent(kv):
    """As many polar forms as functions, however short the period: the clamped conversion has full column
    rank."""
    _, operator = kv.clamp()
    assert np.linalg.matrix_rank(operator.toarray(), tol=1e-11) == kv.dim


@given(periodic_vectors(), st.data())
def test_prolongation_keeps_the_spline(kv, data):
    new, u = data.draw(insertions(kv)), data.draw(parameters(kv, turns=1))
    finer = kv.insert(new)
    p = kv.prolongation(finer)
    assert p.shape == (kv.dim + len(new), kv.dim) == (finer.dim, kv.dim)
    assert p.data.min() >= 0
    assert abs(p.sum(axis=1) - 1).max() <= float(gamma(6 * kv.degree + 1))
    error = abs((finer.collocation(u) @ p - kv.collocation(u)).toarray()).max()
    assert error <= 17 * kv.degree * EPS + kv.degree * (knot_rounding(kv) + knot_rounding(finer))


@given(periodic_vectors(scales=(1.0,)), st.data())
def test_prolongation_agrees_with_the_clamped_one(kv, data):
    """Two ways to the clamped fine coefficients: refine and clamp, clamp and refine."""
    finer = kv.insert(data.draw(insertions(kv)))
    (own, clamp), (fine, clamp_fine) = kv.clamp(), finer.clamp()
    first, second = clamp_fine @ kv.prolongation(finer), own.prolongation(fine) @ clamp
    assert fine.dim - own.dim >= finer.dim - kv.dim - kv.degree
    # whole numbers and their 64ths: the translated knots are exact
    assert abs((first - second).toarray()).max() <= float(gamma(22 * kv.degree + 2))


@given(periodic_vectors(), st.data())
def test_prolongations_compose(kv, data):
    middle = kv.insert(data.draw(insertions(kv)))
    finest = middle.insert(data.draw(insertions(middle)))
    error = abs(
        (middle.prolongation(finest) @ kv.prolongation(middle) - kv.prolongation(finest)).toarray()
    ).max()
    assert error <= 17 * kv.degree * EPS + kv.degree * (knot_rounding(middle) + knot_rounding(kv))


@given(periodic_vectors())
def test_prolongation_to_itself_is_the_identity(kv):
    p = kv.prolongation(kv).toarray()
    assert abs(p - np.eye(kv.dim)).max() <= float(gamma(5 * kv.degree))


@given(periodic_vectors(max_degree=9), seeds())
def test_elevation_keeps_the_spline(kv, rng):
    finer, operator = kv.elevate(), kv.elevation()
    assert finer.degree == kv.degree + 1
    assert operator.shape == (finer.dim, kv.dim)
    assert (multiplicities(finer) == multiplicities(kv) + 1).all()
    u = kv.start + kv.period * rng.uniform(-2, 2, 30)
    error = abs((finer.collocation(u) @ operator - kv.collocation(u)).toarray()).max()
    assert error <= 30 * finer.degree * EPS + finer.degree * knot_rounding(kv)


@given(periodic_vectors())
def test_integrals(kv):
    """Against the clamped conversion, whose integrals are known; their sum is the period."""
    own, operator = kv.clamp()
    width = kv.period + abs(kv.knots).max()
    assert np.allclose(
        kv.integrals(), operator.T @ own.integrals(), rtol=0, atol=40 * (kv.degree + kv.dim) * EPS * width
    )
    assert kv.integrals().sum() == pytest.approx(kv.period, abs=10 * (kv.degree + kv.dim) * EPS * width)


@given(periodic_vectors(scales=(1.0,)), seeds())
def test_greville_coefficients_are_the_parameter_plus_whole_periods(kv, rng):
    """g_i + k_i T with the whole numbers k_i of the functions in force at u is the identity: the p + 1
    translates there."""
    g = kv.greville()
    assert (np.diff(g) >= 0).all()
    assert g[-1] - g[0] <= kv.period
    u = kv.reduced(kv.start + kv.period * rng.random(8))
    rows = np.concatenate([g + k * kv.period for k in range(kv.degree // kv.dim + 2)])[: kv.dim + kv.degree]
    identity = BSpline(kv.extended, rows, kv.degree)
    assert abs(identity(u) - u).max() <= 50 * kv.degree * EPS * (abs(kv.extended).max())


@given(periodic_vectors())
def test_counts_and_bisection(kv):
    finer = kv.bisect()
    assert kv.dim == multiplicities(kv).sum()
    assert (kv.start, kv.stop, kv.spans) == (kv.breaks[0], kv.breaks[-1], len(kv.breaks) - 1)
    assert (finer.dim, finer.spans) == (kv.dim + kv.spans, 2 * kv.spans)
    assert (finer.breaks[::2] == kv.breaks).all()


@given(periodic_vectors())
def test_extended_knots_go_on_by_periods(kv):
    p, n, t = kv.degree, kv.dim, kv.extended
    assert t.shape == (n + 2 * p + 1,)
    assert (t[p : p + n + 1] == kv.knots).all()
    assert (np.diff(t) >= 0).all()
    assert abs(t[n:] - t[:-n] - kv.period).max() <= 4 * EPS * (abs(kv.knots).max() + (p + 1) * kv.period)


def test_interpolation_against_scipy():
    """The periodic cubic interpolant of a closed curve, coefficient by coefficient."""
    u = np.array([0, 0.1, 0.25, 0.4, 0.55, 0.8, 1])
    points = np.column_stack([np.cos(2 * np.pi * u), np.sin(2 * np.pi * u)])
    points[-1] = points[0]
    kv = PeriodicKnotVector(3, u)
    c = np.linalg.solve(kv.collocation(u[:-1]).toarray(), points[:-1])
    scipys = make_interp_spline(u, points, 3, bc_type="periodic")
    assert np.allclose(kv.extended, scipys.t, rtol=0, atol=1e-15)
    assert np.allclose(wrapped(kv, c), scipys.c, rtol=0, atol=1e-14)


def test_a_period_of_one_span_holds_the_constants_only():
    kv = PeriodicKnotVector(4, [2.0, 5.0])
    assert kv.dim == 1
    assert np.allclose(kv.collocation([-7.3, 2.0, 4.9, 5.0]).toarray(), 1, rtol=0, atol=1e-15)
    assert abs(kv.collocation([3.0], 1).toarray()).max() <= 1e-15


def test_knots_are_inserted_in_every_period_and_at_the_seam():
    kv = PeriodicKnotVector.uniform(3, 4).insert([1.0, 0.0, -0.25, 7.5])
    assert kv.knots.tolist() == [0, 0, 0, 0.25, 0.5, 0.5, 0.75, 0.75, 1]
    own, operator = kv.clamp()
    assert own.dim == kv.dim + 1
    # at a seam of multiplicity p the spline interpolates one of its coefficients
    assert operator.toarray()[0].tolist() == operator.toarray()[-1].tolist() == np.eye(8)[2].tolist()


def test_reduction_at_the_ends():
    kv = PeriodicKnotVector.uniform(2, 3, -1.0, 2.0)
    assert kv.reduced([-1.0, 2.0, 5.0, np.nextafter(2.0, 0), -1.0 - 1e-20, -1.5]).tolist() == [
        -1,
        -1,
        -1,
        np.nextafter(2.0, 0),
        -1,
        1.5,
    ]
    assert kv.collocation([2.0]).toarray().tolist() == kv.collocation([-1.0]).toarray().tolist()
    assert kv.collocation([]).shape == (0, 3)


def test_arrays_are_read_only():
    for array in (UNIFORM.knots, UNIFORM.breaks, UNIFORM.extended):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1


@pytest.mark.parametrize("degree", [True, 0, 11, 2.0, None])
def test_degree_is_refused(degree):
    with pytest.raises(ValueError, match="degree must be an integer from 1 to 10"):
        PeriodicKnotVector(degree, [0, 1, 2])


@pytest.mark.parametrize(
    ("degree", "knots", "message"),
    [
        (3, [0], r"knots must be one row of at least 2 numbers, got shape \(1,\)"),
        (3, [[0, 1]], r"got shape \(1, 2\)"),
        (1, [0, np.nan, 1], r"knots\[1\] is not finite"),
        (1, [0, 2, 1], r"must not decrease, got knots\[1\] = 2.0 > knots\[2\] = 1.0"),
        (2, [0, 1, 2, 2], r"the last knot 2.0 must be greater than the one before"),
        (2, [1, 1], "must be greater than the one before"),
        (2, [0, 1, 1, 1, 2], r"knot 1.0 occurs more than degree = 2 times"),
        (2, [0, 0, 0, 1], r"knot 0.0 occurs more than degree = 2 times"),
    ],
)
def test_knots_are_refused(degree, knots, message):
    with pytest.raises(ValueError, match=message):
        PeriodicKnotVector(degree, knots)


@pytest.mark.parametrize("u", [np.nan, np.inf, -np.inf])
def test_parameters_that_are_not_finite_are_refused(u):
    for method in (UNIFORM.collocation, UNIFORM.insert, UNIFORM.reduced):
        with pytest.raises(ValueError, match="is not finite"):
            method([0.5, u])


def test_other_arguments_are_refused():
    with pytest.raises(ValueError, match=r"u must be one row of numbers, got shape \(1, 2\)"):
        UNIFORM.collocation([[0.1, 0.2]])
    with pytest.raises(ValueError, match="derivative must be a non-negative integer"):
        UNIFORM.collocation([0.1], -1)
    with pytest.raises(ValueError, match="spans must be an integer from 1 to 10000000"):
        PeriodicKnotVector.uniform(3, 0)
    with pytest.raises(ValueError, match="start must be less than stop"):
        PeriodicKnotVector.uniform(3, 2, 1.0, 1.0)
    with pytest.raises(ValueError, match="degree must be an integer from 1 to 10"):
        PeriodicKnotVector.uniform(10, 4).elevate()


@pytest.mark.parametrize(
    ("finer", "message"),
    [
        (PeriodicKnotVector.uniform(2, 5), "degrees differ: 3 and 2"),
        (PeriodicKnotVector.uniform(3, 10, 0, 2), r"periods differ: \[0.0, 1.0\) and \[0.0, 2.0\)"),
        (PeriodicKnotVector.uniform(3, 4), "lacks the knot 0.2"),
    ],
)
def test_prolongation_to_other_knots_is_refused(finer, message):
    with pytest.raises(ValueError, match=message):
        UNIFORM.prolongation(finer)


def test_prolongation_counts_multiplicities_at_the_seam():
    with pytest.raises(ValueError, match=r"lacks the knot 0\.0"):
        UNIFORM.insert(0.0).prolongation(UNIFORM.bisect())
