"""Splines on knots that are not clamped, and closed ones, against scipy and the clamped form."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.interpolate import BSpline, NdBSpline, make_interp_spline

from tests.cases import examples
from tests.thbcad.cases import SCALES, knot_vectors, parameters, seeds
from thbcad import BSplineCurve, BSplineSurface, KnotVector, interpolate

EPS = np.finfo(float).eps


@st.composite
def periodic_vectors(draw, max_degree=6, max_spans=6, scales=SCALES):
    """Spans of ratio up to 9, inner knots of any multiplicity; often fewer spans than degrees."""
    kv = draw(knot_vectors(max_degree=max_degree, max_spans=max_spans, scales=scales))
    return KnotVector.periodic(kv.degree, kv.knots[kv.degree : -kv.degree])


def rounding(kv, derivative=0):
    """20 roundings per degree of a derivative's terms, and knots that err by 8 of the greatest."""
    shortest = np.diff(kv.breaks).min()
    knots = 8 * EPS * abs(kv.knots).max() / shortest
    return (20 * EPS + knots) * kv.degree * (2 * kv.degree / shortest) ** derivative


def seam(curve, derivative):
    before, after = curve([curve.kv.stop, curve.kv.start], derivative)
    return abs(before - after).max()


@given(periodic_vectors(), st.data())
def test_values_are_those_of_scipys_periodic_spline(kv, data):
    u, c = data.draw(parameters(kv)), data.draw(seeds()).uniform(-1, 1, (kv.wrapping().shape[1], 2))
    wrapped = kv.wrapping() @ c
    assert (wrapped[: len(c)] == c).all()
    plain, periodic = (BSpline(kv.knots, wrapped, kv.degree, rule) for rule in (False, "periodic"))
    curve, middles = BSplineCurve(kv, wrapped), (kv.breaks[1:] + kv.breaks[:-1]) / 2
    later = middles + 2 * (kv.stop - kv.start)  # no break, where scipy's modulo may end on the other side
    for derivative in range(kv.degree):
        assert abs(curve(u, derivative) - plain(u, derivative)).max() <= rounding(kv, derivative)
        assert abs(curve(middles, derivative) - periodic(later, derivative)).max() <= 4 * rounding(
            kv, derivative + 1
        )
        assert seam(curve, derivative) <= rounding(kv, derivative)


@given(periodic_vectors(max_degree=5), seeds())
def test_every_verb_keeps_a_closed_curve(kv, rng):
    """Insertion, clamping, bisection, elevation: the same values, as smooth at the seam as before."""
    curve = BSplineCurve(kv, kv.wrapping() @ rng.uniform(-1, 1, (kv.wrapping().shape[1], 2)))
    u = kv.start + (kv.stop - kv.start) * rng.random(20)
    middles = kv.breaks[:-1] + np.diff(kv.breaks) / 2
    finer = kv.bisect()
    others = [
        curve.insert(middles),
        curve.clamp(),
        curve.elevate(kv.degree + 1),
        BSplineCurve(finer, kv.prolongation(finer) @ curve.coefficients),
    ]
    for other in others:
        assert abs(other(u) - curve(u)).max() <= 4 * rounding(other.kv)
        for derivative in range(kv.degree):
            assert seam(other, derivative) <= 8 * rounding(other.kv, derivative)
    assert others[1].kv.is_clamped
    assert curve.integral() == pytest.approx(others[1].integral(), abs=rounding(kv) * (kv.stop - kv.start))


@given(periodic_vectors(), seeds())
def test_finer_and_higher_periodic_knots_wrap_again(kv, rng):
    """The coefficients there are periodic themselves."""
    c = kv.wrapping() @ rng.uniform(-1, 1, kv.wrapping().shape[1])
    for other, operator in ((kv.bisect(), None), (kv.elevate(), kv.elevation())):
        found = (kv.prolongation(other) if operator is None else operator) @ c
        n = other.wrapping().shape[1]
        assert abs(found - other.wrapping() @ found[:n]).max() <= 4 * rounding(other)


def test_knots_and_coefficients_of_an_interpolant_are_scipys():
    u = np.array([0, 0.1, 0.25, 0.4, 0.55, 0.8, 1])
    points = np.column_stack([np.cos(2 * np.pi * u), np.sin(2 * np.pi * u)])
    points[-1] = points[0]
    kv = KnotVector.periodic(3, u)
    c = np.linalg.solve((kv.collocation(u[:-1]) @ kv.wrapping()).toarray(), points[:-1])
    scipys = make_interp_spline(u, points, 3, bc_type="periodic")
    assert np.allclose(kv.knots, scipys.t, rtol=0, atol=1e-15)
    assert np.allclose(kv.wrapping() @ c, scipys.c, rtol=0, atol=1e-14)


@examples(20)
@given(periodic_vectors(max_degree=4), seeds())
def test_a_tube_is_a_surface_with_wrapped_rows(kv, rng):
    """Values and derivatives agree at the seam, after insertion too, and are scipy's."""
    other = KnotVector.uniform(2, 3)
    net = np.tensordot(kv.wrapping().toarray(), rng.uniform(-1, 1, (kv.wrapping().shape[1], 5, 3)), axes=1)
    tube = BSplineSurface(kv, other, net)
    v = np.linspace(0, 1, 7)
    scipys = NdBSpline((kv.knots, other.knots), net, (kv.degree, 2))
    inside = kv.start + (kv.stop - kv.start) * rng.random(7)
    finer = tube.insert(kv.breaks[:-1] + np.diff(kv.breaks) / 3, [0.5])
    for surface in (tube, finer, tube.clamp()):
        assert abs(surface(inside, v) - scipys(np.column_stack([inside, v]))).max() <= 4 * rounding(
            surface.kv_u
        )
        for derivative in range(kv.degree):
            ends = surface.grid([kv.start, kv.stop], v, (derivative, 1))
            assert abs(ends[0] - ends[1]).max() <= 20 * rounding(surface.kv_u, derivative)


def test_interpolation_clamps_knots():
    kv = KnotVector.periodic(3, np.arange(6.0))
    surface = interpolate(kv, kv, lambda u, v: u**3 * v)
    assert surface.kv_u.is_clamped
    assert surface([4.5], [0.3]) == pytest.approx([4.5**3 * 0.3], rel=1e-13)


@pytest.mark.parametrize(
    ("breaks", "message"),
    [
        ([0.0], "at least 2 numbers"),
        ([0, 0, 1, 2], "must end with spans"),
        ([0, 1, 1, 1, 2], "more than degree"),
    ],
)
def test_periods_are_refused(breaks, message):
    with pytest.raises(ValueError, match=message):
        KnotVector.periodic(2, breaks)


def test_other_knots_do_not_wrap():
    moved = KnotVector.periodic(3, np.arange(6.0)).insert([0.5])
    for kv in (KnotVector.uniform(3, 4), moved):
        with pytest.raises(ValueError, match="periodic knots have"):
            kv.wrapping()
