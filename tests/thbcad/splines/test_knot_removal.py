"""Knot removal against insertion, dense least squares, linear programming and scipy's values."""

import numpy as np
import pytest
from hypothesis import assume, given, strategies as st
from scipy.interpolate import BSpline, make_interp_spline
from scipy.optimize import linprog

from tests.cases import examples
from tests.thbcad.cases import insertions, knot_vectors, seeds
from thbcad import BSplineCurve, BSplineSurface, KnotVector, NURBSCurve, circular_arc, revolved
from thbcad.splines.knot_removal import removal_errors
from thbcad.splines.sparse_operators import tensor_apply

EPS = np.finfo(float).eps
UNIFORM = KnotVector.uniform(3, 4)


def condition(degree):
    """Bound k 2^k, k = p + 1, on |c| / |s| in the maximum norm, hence on the inverse of a refinement matrix
    (Scherer and Shadrin 1999)."""
    return (degree + 1) * 2 ** (degree + 1)


def without(kv, z, copies=1):
    """Return the knot vector without some copies of the knot z."""
    first = np.searchsorted(kv.knots, z)
    return KnotVector(kv.degree, np.delete(kv.knots, np.arange(first, first + copies)))


def multiplicity(kv, z):
    return int((kv.knots == z).sum())


def errors_of(kv, c):
    return removal_errors(kv, c.reshape(kv.dim, 1, -1))[:, 0]


def norms(rows):
    return np.linalg.norm(rows.reshape(len(rows), -1), axis=1)


def bound(before, after):
    """The greatest distance of coefficients on equal knots, of curves or surfaces."""
    operators = [kv.prolongation(old) for kv, old in zip(after.knot_vectors, before.knot_vectors)]
    if len(operators) == 1:
        return norms(before.coefficients - operators[0] @ after.coefficients).max()
    error = before.coefficients - tensor_apply(*operators, after.coefficients)
    return norms(error.reshape(error.shape[0] * error.shape[1], -1)).max()


def sampled(kv, count=400):
    return np.clip(np.r_[np.linspace(kv.start, kv.stop, count), kv.breaks], kv.start, kv.stop)


@st.composite
def curves(draw, **options):
    """(kv, coefficients): scalar or with 1 to 3 components; half of them smooth, so that knots can go."""
    kv = draw(knot_vectors(max_spans=8, **options))
    rng, d = draw(seeds()), draw(st.integers(0, 3))
    c = rng.uniform(-1, 1, (kv.dim, max(d, 1)))
    if draw(st.booleans()):
        c = np.sin(kv.greville()[:, None] / (kv.stop - kv.start) + c[0])
    return kv, c if d else c[:, 0]


@pytest.mark.slow
@examples(150)
@given(st.data())
def test_what_was_inserted_is_removed_again(data):
    """Exactly the old knots stay, where the tolerance lets no old one go.

    An old knot cannot go if its removal alone, from the old knots and all others that were inserted,
    costs more than the tolerance; the error on the finer knots is less by the condition at most.
    """
    kv = data.draw(knot_vectors())
    finer = kv.insert(data.draw(insertions(kv)))
    c = data.draw(seeds()).uniform(-1, 1, kv.dim)
    tolerance = 1e-12
    for k, z in enumerate(kv.breaks[1:-1]):
        others = without(finer, z, multiplicity(finer, z) - multiplicity(kv, z))
        error = errors_of(others, kv.prolongation(others) @ c)[
            np.searchsorted(others.breaks, kv.breaks[k + 1]) - 1
        ]
        assume(error > 2 * condition(kv.degree) * tolerance)
    found = BSplineCurve(finer, kv.prolongation(finer) @ c).remove_knots(tolerance)
    assert found.kv.knots.tolist() == kv.knots.tolist()
    assert abs(found.coefficients - c).max() <= 2 * condition(kv.degree) * tolerance


@pytest.mark.parametrize("degree", range(1, 11))
def test_bisection_is_undone(degree):
    breaks = np.array([-1.0, -0.25, 0.5, 0.75, 2.0, 3.5])
    kv = KnotVector(degree, np.repeat(breaks, [degree + 1, 1, degree, min(2, degree), 1, degree + 1]))
    c = np.random.default_rng(degree).normal(size=(kv.dim, 3))
    finer = kv.bisect()
    found = BSplineCurve(finer, kv.prolongation(finer) @ c).remove_knots(1e-12)
    assert found.kv.knots.tolist() == kv.knots.tolist()
    assert abs(found.coefficients - c).max() <= 1e-12 * condition(degree)


@given(curves(), st.sampled_from([1e-9, 1e-4, 1e-2, 0.3]))
def test_the_tolerance_holds_for_coefficients_and_for_values(curve, tolerance):
    kv, c = curve
    found = BSplineCurve(kv, c).remove_knots(tolerance)
    assert found.coefficients.shape == (found.kv.dim, *c.shape[1:])
    # prolongation refuses knots that are not those of kv
    assert bound(BSplineCurve(kv, c), found) <= tolerance + 20 * kv.degree * EPS
    u = sampled(kv)
    error = BSpline(kv.knots, c, kv.degree)(u) - BSpline(found.kv.knots, found.coefficients, kv.degree)(u)
    # values: 5 roundings per degree and a sum, of convex combinations of the coefficients, for both splines
    scale = 1 + abs(found.coefficients).max()
    assert norms(error).max() <= tolerance + 2 * (6 * kv.degree + 1) * EPS * scale


def dense_error(kv, c, own):
    """Return max_i |c - P d|_i of least squares by the singular value decomposition."""
    p = own.prolongation(kv).toarray()
    return norms(c - p @ np.linalg.lstsq(p, c)[0]).max()


def one_by_one(kv, c, tolerance):
    """Return the knots left by the slow twin: always one knot, the one of least error that can go."""
    own = kv
    while True:
        d = np.linalg.lstsq(own.prolongation(kv).toarray(), c)[0]
        for k in np.argsort(errors_of(own, d)):
            fewer = without(own, own.breaks[k + 1])
            if dense_error(kv, c, fewer) <= tolerance:
                own = fewer
                break
        else:
            return own


@given(curves(), st.sampled_from([1e-4, 1e-2, 0.3]))
def test_no_single_knot_more_can_go(curve, tolerance):
    kv, c = curve
    found = BSplineCurve(kv, c).remove_knots(tolerance)
    for z in found.kv.breaks[1:-1]:
        assert dense_error(kv, c, without(found.kv, z)) > tolerance * (1 - 1e-9)  # both solve to about 1e-13


@pytest.mark.every(4)
@pytest.mark.parametrize(
    ("degree", "tolerance", "function"),
    [
        (3, 1e-5, lambda u: abs(u - 0.37) ** 1.5),
        (5, 1e-5, lambda u: abs(u - 0.37) ** 1.5),
        (3, 1e-3, lambda u: 1 / (1 + 25 * (2 * u - 1) ** 2)),
        (2, 1e-3, lambda u: np.sin(20 * u**2)),
    ],
)
def test_as_few_knots_stay_as_with_the_slow_twin(degree, tolerance, function):
    """Within a tenth: neither search is optimal.  And no single knot more can go."""
    kv = KnotVector.uniform(degree, 90)
    c = make_interp_spline(kv.greville(), function(kv.greville()), degree, kv.knots).c
    found = BSplineCurve(kv, c).remove_knots(tolerance)
    assert found.kv.spans <= 1.1 * one_by_one(kv, c, tolerance).spans + 1
    assert all(dense_error(kv, c, without(found.kv, z)) > tolerance for z in found.kv.breaks[1:-1])


@given(knot_vectors(max_degree=6), seeds())
def test_the_error_of_one_knot_is_the_optimum_of_linear_programming(kv, rng):
    """min e with -e <= c - P d <= e."""
    c = rng.uniform(-1, 1, kv.dim)
    errors = errors_of(kv, c)
    assert errors.shape == (kv.spans - 1,)
    for z, error in zip(kv.breaks[1:-1], errors):
        p = without(kv, z).prolongation(kv).toarray()
        n, one = p.shape[1], np.ones((kv.dim, 1))
        limits = [(None, None)] * n + [(0, None)]
        optimum = linprog(
            np.r_[np.zeros(n), 1], np.block([[p, -one], [-p, -one]]), np.r_[c, -c], bounds=limits
        )
        # the simplex method stops at 1e-7 of feasibility and optimality
        assert error == pytest.approx(optimum.fun, abs=1e-6)


def test_errors_of_curves_are_norms_over_the_components():
    c = np.random.default_rng(2).normal(size=UNIFORM.dim)
    direction = np.array([2.0, -1.0, 2.0])
    assert errors_of(UNIFORM, c[:, None] * direction) == pytest.approx(3 * errors_of(UNIFORM, c), rel=1e-13)


@given(knot_vectors(), st.data())
def test_restriction_is_the_least_squares_left_inverse(kv, data):
    finer = kv.insert(data.draw(insertions(kv)))
    p, q = kv.prolongation(finer).toarray(), finer.restriction(kv).toarray()
    assert q.shape == (kv.dim, finer.dim)
    # backward stable: a few roundings per entry, magnified by the condition, not by its square
    error = 20 * EPS * np.linalg.cond(p)
    assert abs(q @ p - np.eye(kv.dim)).max() <= error
    assert abs(q - np.linalg.pinv(p)).max() <= error * finer.dim * abs(q).max()


def test_restriction_is_accurate_where_the_condition_is_worst():
    """Degree 10, spans of ratio 300; plain normal equations err by the square of the condition, about 1e-11
    here."""
    kv = KnotVector(10, [0] * 11 + [1, 1, 1, 2, 300] + [301] * 11)
    finer = kv.insert(np.linspace(0, 301, 40)[1:-1])
    p = kv.prolongation(finer).toarray()
    assert abs(finer.restriction(kv) @ p - np.eye(kv.dim)).max() <= 20 * EPS * np.linalg.cond(p)


def test_restriction_to_knots_that_the_finer_vector_lacks_is_refused():
    with pytest.raises(ValueError, match=r"lacks the knot 0\.25"):
        KnotVector.uniform(3, 2).restriction(UNIFORM)


@pytest.mark.slow
@pytest.mark.parametrize("degree", range(1, 5))
def test_the_error_falls_with_the_power_degree_plus_one_of_the_knots(degree):
    """A circle by 200 spans: knots go evenly, and the spans that stay are as few as approximation theory
    allows."""
    kv, u = KnotVector.uniform(degree, 200), np.linspace(0, 1, 1501)
    circle = BSpline(*make_interp_spline(kv.greville(), turned(kv.greville()), degree, kv.knots).tck)
    spans, errors = [], []
    for tolerance in 10.0 ** -np.arange(1, 9):
        found = BSplineCurve(kv, circle.c).remove_knots(tolerance)
        if 4 <= found.kv.spans <= 100:
            spans.append(found.kv.spans)
            errors.append(norms(BSpline(found.kv.knots, found.coefficients, degree)(u) - circle(u)).max())
    rate = -np.polyfit(np.log(spans), np.log(errors), 1)[0]
    assert spans == sorted(spans)
    assert abs(rate - (degree + 1)) <= 0.5


def turned(u):
    return np.column_stack([np.cos(2 * np.pi * u), np.sin(2 * np.pi * u)])


def test_a_sine_of_two_hundred_knots_needs_few():
    kv = KnotVector.uniform(3, 200)
    c = make_interp_spline(kv.greville(), np.sin(2 * np.pi * kv.greville()), 3, kv.knots).c
    assert (
        BSplineCurve(kv, c).remove_knots(1e-3).kv.spans <= 10
    )  # the error 0.008 h^4 |f''''| of cubic splines gives 11 equal spans


def test_a_polynomial_keeps_no_interior_knot():
    kv = KnotVector(4, [0, 0, 0, 0, 0, 1, 2, 2, 2, 2, 3, 5, 5, 5, 5, 5])
    bezier = KnotVector(4, [0] * 5 + [5] * 5)
    c = np.array([1.0, -3.0, 0.5, 2.0, -1.0])
    found = BSplineCurve(kv, bezier.prolongation(kv) @ c).remove_knots(1e-12)
    assert found.kv.knots.tolist() == bezier.knots.tolist()
    assert np.allclose(found.coefficients, c, rtol=0, atol=1e-11)


def test_zero_tolerance_keeps_the_curve():
    c = np.random.default_rng(4).normal(size=(UNIFORM.dim, 2))
    found = BSplineCurve(UNIFORM, c).remove_knots(0)
    assert found.kv.knots.tolist() == UNIFORM.knots.tolist()
    assert (found.coefficients == c).all()
    assert BSplineCurve(UNIFORM, np.zeros(7)).remove_knots(0).kv.dim == 4


def test_infinite_tolerance_removes_every_interior_knot():
    kv = KnotVector(2, [0, 0, 0, 1, 1, 2, 3, 3, 3])
    found = BSplineCurve(kv, [1.0, -1, 1, -1, 1, -1]).remove_knots(np.inf)
    assert found.kv.knots.tolist() == [0, 0, 0, 3, 3, 3]
    assert found.coefficients.shape == (3,)


def test_no_interior_knots_leave_nothing_to_remove():
    found = BSplineCurve(KnotVector.uniform(2, 1), [1.0, 2, 3]).remove_knots(10)
    assert found.coefficients.tolist() == [1, 2, 3]


@pytest.mark.parametrize("shape", [(6,), (), (7, 2, 2), (2, 7)])
def test_coefficients_of_other_shapes_are_refused(shape):
    with pytest.raises(ValueError, match=r"coefficients must have shape \(7,\) or \(7, 'd'\), got"):
        BSplineCurve(UNIFORM, np.zeros(shape))


def test_coefficients_that_are_not_finite_are_refused():
    with pytest.raises(ValueError, match="coefficients must be finite"):
        BSplineCurve(UNIFORM, [0, 0, np.nan, 0, 0, 0, 0])


@examples(30)
@given(st.data(), st.integers(0, 3), st.sampled_from([0.0, 1e-9, 1e-3, 0.2]))
def test_surfaces_keep_bound_and_tolerance(data, d, tolerance):
    kv_u, kv_v = (data.draw(knot_vectors(max_degree=5)) for _ in range(2))
    rng = data.draw(seeds())
    phase, rough = rng.uniform(-1, 1, d or 1), data.draw(st.sampled_from([0, 0.2]))
    share_u, share_v = ((kv.greville() - kv.start) / (kv.stop - kv.start) for kv in (kv_u, kv_v))
    c = np.sin(share_u[:, None, None] + 2 * share_v[None, :, None] + phase)
    c = c + rough * rng.uniform(-1, 1, c.shape)
    surface = BSplineSurface(kv_u, kv_v, c if d else c[..., 0])
    found = surface.remove_knots(tolerance)
    error = surface.grid(sampled(kv_u, 30), sampled(kv_v, 30)) - found.grid(
        sampled(kv_u, 30), sampled(kv_v, 30)
    )
    # two rows of 6 roundings per degree for each surface; |c| <= 2
    rounding = 4 * (6 * max(kv_u.degree, kv_v.degree) + 1) * EPS * (2 + abs(found.coefficients).max())
    assert norms(error.reshape(-1, d or 1)).max() <= tolerance + rounding


def test_a_refined_surface_gets_its_knots_back():
    kv_u, kv_v = KnotVector(3, [0, 0, 0, 0, 1, 2, 2, 4, 4, 4, 4]), KnotVector.uniform(2, 5)
    c = np.random.default_rng(7).normal(size=(kv_u.dim, kv_v.dim, 3))
    surface = BSplineSurface(kv_u, kv_v, c)
    found = surface.insert([0.5, 1.0, 3.0, 3.5], [0.1, 0.55, 0.6]).remove_knots(1e-12)
    assert found.kv_u.knots.tolist() == kv_u.knots.tolist()
    assert found.kv_v.knots.tolist() == kv_v.knots.tolist()
    assert abs(found.coefficients - c).max() <= 1e-12 * condition(3) * condition(2)


def test_each_direction_gets_its_share_of_the_tolerance():
    """S = f(u) + g(v): half of the tolerance for f, for g what f has left, and the knots are those of the two
    curves."""
    kv_u, kv_v = KnotVector.uniform(3, 40), KnotVector.uniform(4, 30)
    f, g = np.sin(9 * kv_u.greville()), np.cos(11 * kv_v.greville())
    surface = BSplineSurface(kv_u, kv_v, f[:, None] + g[None, :])
    found = surface.remove_knots(1e-3)
    by_u = BSplineCurve(kv_u, f).remove_knots(0.5e-3)
    by_v = BSplineCurve(kv_v, g).remove_knots(1e-3 - bound(BSplineCurve(kv_u, f), by_u))
    assert found.kv_u.knots.tolist() == by_u.kv.knots.tolist()
    assert found.kv_v.knots.tolist() == by_v.kv.knots.tolist()
    assert by_u.kv.spans < kv_u.spans
    assert by_v.kv.spans < kv_v.spans
    assert max(bound(BSplineCurve(kv_u, f), by_u), bound(BSplineCurve(kv_v, g), by_v)) < bound(surface, found)


def test_a_ruled_surface_needs_no_knots_along_its_rulings():
    kv = KnotVector.uniform(3, 12)
    profile = np.sin(5 * kv.greville())
    c = profile[:, None] * (1 + kv.greville()[None, :])
    found = BSplineSurface(kv, kv, c).remove_knots(1e-6)
    assert found.kv_v.spans == 1
    assert found.kv_u.spans > 4


@pytest.mark.parametrize("exponent", [-1000, -566, 566, 1021])
def test_sizes_whose_squares_underflow_or_overflow(exponent):
    """A power of two changes nothing but the size."""
    kv, rng = KnotVector.uniform(3, 4), np.random.default_rng(0)
    c, net = rng.uniform(-1, 1, size=7), rng.uniform(-1, 1, size=(7, 7, 2))
    for tolerance in (0.0, 0.6):
        plain, scaled = (
            BSplineCurve(kv, c).remove_knots(tolerance),
            BSplineCurve(kv, np.ldexp(c, exponent)).remove_knots(np.ldexp(tolerance, exponent)),
        )
        assert np.array_equal(scaled.kv.knots, plain.kv.knots)
        assert np.array_equal(scaled.coefficients, np.ldexp(plain.coefficients, exponent))
    surface = BSplineSurface(kv, kv, net)
    plain = surface.remove_knots(4.0)
    scaled = BSplineSurface(kv, kv, np.ldexp(net, exponent)).remove_knots(np.ldexp(4.0, exponent))
    assert plain.kv_u.spans < kv.spans
    assert np.array_equal(scaled.coefficients, np.ldexp(plain.coefficients, exponent))


@given(curves(), seeds(), st.sampled_from([1e-9, 1e-3, 0.1, 10.0]))
def test_rational_curves_keep_the_tolerance(curve, rng, tolerance):
    """Also far from the origin; weights of ratio up to 100 stay positive."""
    kv, c = curve
    rational = NURBSCurve(kv, 7 + c.reshape(kv.dim, -1), 10 ** rng.uniform(-1, 1, kv.dim))
    found = rational.remove_knots(tolerance)
    u = sampled(kv)
    assert found.weights.min() > 0
    # two quotients with some 8 roundings per degree, and the way to the middle and back
    assert norms(rational(u) - found(u)).max() <= tolerance + 100 * (kv.degree + 1) * EPS * 10


def test_inserted_knots_of_a_circle_and_a_sphere_go_again():
    circle = circular_arc(2.0, centre=(30.0, 0.0))
    found = circle.insert([0.1, 0.4, 0.5]).remove_knots(1e-10)
    assert found.kv.knots.tolist() == circle.kv.knots.tolist()
    assert np.allclose(found.coefficients, circle.coefficients, rtol=0, atol=1e-12)
    ball = revolved(circular_arc(5.0, angle=np.pi, start=-np.pi / 2))
    again = ball.insert([0.2, 0.3], [0.7]).remove_knots(1e-9)
    assert [kv.knots.tolist() for kv in again.knot_vectors] == [kv.knots.tolist() for kv in ball.knot_vectors]
