"""Certified ranges of graphs and their derivatives against exact arithmetic, closed forms and convergence
rates."""

from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from hypothesis import given, strategies as st

from oracles.spline_definitions import cox_de_boor
from tests.cases import examples
from tests.thbcad.cases import SCALES, coefficients, parameters, spaces, unclamped
from tests.thbcad.certified.cases import assert_it_falls_with_the_square_of_the_cell_size, graphs
from thbcad.certified.extreme_values import minimum, value_range
from thbcad.outlines import Outline
from thbcad.sags import square_coefficients
from thbcad.splines import BSplineSurface, KnotVector, interpolate
from thbcad.surfaces import THBSurface

EPS = np.finfo(float).eps
ORDERS = [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)]


@pytest.mark.parametrize("derivative", ORDERS)
@given(kv=unclamped(4), height=st.floats(-1, 1))
def test_bounds_over_unclamped_knots_hold_a_constant(derivative, kv, height):
    """To clamp them rounds, which short spans multiply in derivatives."""
    sheet = BSplineSurface(kv, KnotVector.uniform(2, 2), np.full((kv.dim, 4), height))
    true = 0.0 if any(derivative) else height
    for bounds in value_range(sheet, derivative):
        assert bounds.lower <= true <= bounds.upper


@pytest.mark.parametrize("outline", [Outline((1, 2)), Outline((1, 2), (0.2, 0.3)), Outline.ellipse((1, 2))])
def test_bounds_within_an_outline_are_those_of_the_graph_that_ends_there(outline):
    kv = KnotVector.uniform(2, 4, -3, 3)
    slope = BSplineSurface(kv, kv, np.add.outer(kv.greville(), 0 * kv.greville()))
    with pytest.raises(ValueError, match=r"beyond its outline, to 3 and 3 mm; .*\(-1, 1\), \(-2, 2\)"):
        value_range(slope, outline=outline)
    _, most = value_range(slope.segment((-1, 1), (-2, 2)), outline=outline)
    assert most.lower <= 1 <= most.upper <= 1 + 1e-9


def exactly(graph, u, v, derivative):
    """Return a derivative at one point as a Fraction, its value on the right where it jumps."""
    if derivative[0] > graph.kv_u.degree or derivative[1] > graph.kv_v.degree:
        return Fraction(0)
    a, b = (
        cox_de_boor(kv.knots, kv.degree, x, r)[0]
        for kv, x, r in zip((graph.kv_u, graph.kv_v), (u, v), derivative)
    )
    return sum(
        a[i] * b[j] * Fraction(float(c)) for (i, j), c in np.ndenumerate(graph.coefficients) if a[i] and b[j]
    )


def is_continuous(kv, derivative):
    """Whether no interior knot has a multiplicity above p - r."""
    return kv.spans == 1 or np.unique(kv.knots, return_counts=True)[1][1:-1].max() <= kv.degree - derivative


def paraboloid(x0, y0, height, kv):
    """(x - x0)^2 + (y - y0)^2 + height."""
    x, square = kv.greville(), square_coefficients(kv)
    return BSplineSurface(
        kv, kv, (square - 2 * x0 * x)[:, None] + (square - 2 * y0 * x) + (x0**2 + y0**2 + height)
    )


@pytest.mark.slow
@examples(80)
@given(st.data(), st.sampled_from(ORDERS))
def test_the_range_holds_exact_values(data, derivative):
    """No slack: the samples and the bounds are compared as Fractions.  The corners of the cells are among the
    samples, so that extremes which are taken there leave nothing but the allowance for rounding between
    sample and bound."""
    graph = data.draw(graphs(max_degree=4, max_spans=3, scales=SCALES))
    least, greatest = value_range(graph, derivative)
    assert least.lower <= least.value <= least.upper
    assert greatest.lower <= greatest.value <= greatest.upper
    u, v = (np.r_[kv.breaks, data.draw(parameters(kv, size=2))] for kv in (graph.kv_u, graph.kv_v))
    samples = [exactly(graph, *place, derivative) for place in product(u, v)]
    assert Fraction(least.lower) <= min(samples)
    assert max(samples) <= Fraction(greatest.upper)


@given(graphs(max_degree=4, max_spans=3, scales=(1.0,)), st.sampled_from(ORDERS))
def test_the_place_takes_the_value(graph, derivative):
    """Halves of integers are exact, so that the exact value at the place lies between the bounds where it is
    continuous."""
    for found in value_range(graph, derivative):
        if all(is_continuous(kv, r) for kv, r in zip((graph.kv_u, graph.kv_v), derivative)):
            assert (
                Fraction(found.lower) <= exactly(graph, found.u, found.v, derivative) <= Fraction(found.upper)
            )
        assert graph.kv_u.start <= found.u <= graph.kv_u.stop
        assert graph.kv_v.start <= found.v <= graph.kv_v.stop


@given(graphs(), st.integers(0, 2**32 - 1), st.sampled_from([1e-4, 1e-9, 1e-12]))
def test_the_minimum_is_as_close_as_asked(graph, seed, tolerance):
    rng = np.random.default_rng(seed)
    found = minimum(graph, tolerance=tolerance)
    u, v = (
        np.minimum(kv.start + rng.random(40) * (kv.stop - kv.start), kv.stop)
        for kv in (graph.kv_u, graph.kv_v)
    )
    scale = np.abs(graph.coefficients).max()
    # 8 (p + q + 2) roundings of the coefficients and p + q + 2 of each of fewer than 50 bisections; two
    # bounds with twice the error each
    allowance = 4 * 58 * (graph.kv_u.degree + graph.kv_v.degree + 2) * EPS * scale
    assert found.lower <= graph.grid(u, v).min() + allowance
    assert found.upper - found.lower <= tolerance * scale + allowance
    assert graph([found.u], [found.v])[0] == pytest.approx(found.value, abs=1e-9 * scale)


def test_minimum_of_a_paraboloid_between_the_knots():
    found = minimum(paraboloid(0.1, -0.2, 0.5, KnotVector.uniform(2, 3, -1, 1)), tolerance=1e-12)
    assert found.lower <= 0.5 <= found.upper
    assert found.upper - found.lower < 1e-11
    assert (found.u, found.v) == pytest.approx((0.1, -0.2), abs=1e-5)


@pytest.mark.slow
def test_a_valley_along_a_line_stays_certified():
    """The least value is taken on a whole line between the knots: the search keeps every cell that the line
    crosses."""
    kv = KnotVector.uniform(2, 64, -1, 1)
    line = square_coefficients(kv) - 2 * kv.greville() / 3 + 1 / 9
    found = minimum(BSplineSurface(kv, kv, line[:, None] + np.zeros(kv.dim)), tolerance=1e-12)
    assert -1e-6 < found.lower <= 1e-16
    assert -1e-16 <= found.value < 1e-6


def test_a_plateau_ends_with_wider_bounds():
    """On the circle r = 1 (r^2 - 1)^2 is least between all knots: the search ends when it has 2^24
    coefficients, and its bounds hold."""
    kv = KnotVector.uniform(4, 16, -1.5, 1.5)
    found = minimum(interpolate(kv, kv, lambda x, y: (x**2 + y**2 - 1) ** 2), tolerance=1e-14)
    assert found.lower <= 1e-13  # rounding of the interpolation
    assert found.upper - found.lower < 1e-8


def test_derivatives_of_a_paraboloid():
    graph = paraboloid(0.25, -0.5, 3.0, KnotVector.uniform(3, 4, -1, 1))
    wanted = {
        (1, 0): (-2.5, 1.5),
        (0, 1): (-1, 3),
        (2, 0): (2, 2),
        (1, 1): (0, 0),
        (0, 2): (2, 2),
        (3, 0): (0, 0),
    }
    for derivative, (low, high) in wanted.items():
        least, greatest = value_range(graph, derivative)
        assert least.lower <= low <= least.upper
        assert greatest.lower <= high <= greatest.upper
        assert greatest.upper - least.lower <= high - low + 1e-11


def test_a_derivative_that_jumps_counts_with_both_values():
    """z = max(x, 0)^2: z_xx is 0 on the left of x = 0 and 2 on the right; z = |x|: z_x is -1 and 1."""
    square = BSplineSurface(
        KnotVector(2, [-1, -1, -1, 0, 1, 1, 1]), KnotVector.uniform(2, 1), np.outer([0, 0, 0, 1], np.ones(3))
    )
    least, greatest = value_range(square, (2, 0))
    assert (least.value, greatest.value) == (0, 2)
    kink = BSplineSurface(
        KnotVector(1, [-1, -1, 0, 1, 1]), KnotVector.uniform(1, 1), np.outer([1, 0, 1], np.ones(2))
    )
    least, greatest = value_range(kink, (1, 0))
    assert (least.value, greatest.value) == (-1, 1)


@pytest.mark.parametrize("derivative", [(3, 0), (0, 4), (5, 1), (1, 5)])
def test_derivatives_above_the_degree_are_zero(derivative):
    kv = KnotVector.uniform(2, 3)
    least, greatest = value_range(
        BSplineSurface(kv, KnotVector.uniform(3, 2), np.random.default_rng(0).normal(size=(5, 5))), derivative
    )
    assert (least.lower, least.upper, greatest.lower, greatest.upper) == (0, 0, 0, 0)


def test_a_constant_has_no_derivative_and_no_negative_zero():
    kv = KnotVector.uniform(3, 4, -0.7, 0.7)
    graph = BSplineSurface(kv, kv, np.full((7, 7), 0.1))
    for derivative in ORDERS[1:]:
        least, greatest = value_range(graph, derivative)
        assert (least.lower, least.upper, greatest.lower, greatest.upper) == (0, 0, 0, 0)
    assert "-" not in repr(minimum(BSplineSurface(kv, kv, np.zeros((7, 7)))).value)


def test_subnormal_coefficients():
    """Exact arithmetic with 5e-324 over wide spans: the derivative underflows, the bounds do not."""
    kv = KnotVector.uniform(3, 3, 0, 1000)
    net = np.zeros((6, 6))
    net[2, 3] = 5e-324
    graph = BSplineSurface(kv, kv, net)
    for derivative in ORDERS:
        least, greatest = value_range(graph, derivative)
        samples = [exactly(graph, *place, derivative) for place in product(np.linspace(0, 1000, 7), repeat=2)]
        assert Fraction(least.lower) <= min(samples)
        assert max(samples) <= Fraction(greatest.upper)
        assert greatest.upper - least.lower < 1e-300


@pytest.mark.parametrize("derivative", [(0, 0), (1, 0), (1, 1)])
def test_bounds_tighten_with_the_square_of_the_cell_size(derivative):
    """With a huge tolerance the search ends at the given cells: their bounds err by O(h^2)."""
    kv = KnotVector.uniform(4, 8, -2, 2)
    # z and these derivatives have their least values inside, between the knots of all levels
    wave = interpolate(kv, kv, lambda x, y: np.sin(1.7 * x + 0.3) * np.cos(1.3 * y - 0.2))
    true = minimum(wave, derivative, tolerance=1e-13).value
    assert_it_falls_with_the_square_of_the_cell_size(
        lambda graph: true - minimum(graph, derivative, tolerance=1e9).lower, wave
    )


@examples(30)
@given(st.data())
def test_thb_surfaces_and_their_patches_have_the_same_range(data):
    space = data.draw(spaces(max_steps=3))
    surface = THBSurface(space, data.draw(coefficients(space.dim)))
    u, v = (np.linspace(kv.start, kv.stop, 23) for kv in (space.kv_u, space.kv_v))
    # not at knots: there derivatives may jump
    u, v = u[1:-1] + 1e-3, v[1:-1] + 1e-3
    for derivative in ((0, 0), (1, 0), (0, 1)):
        values = surface.grid(u, v, derivative)
        by_tensor, by_patches = (
            value_range(surface, derivative),
            value_range(surface.to_patches(), derivative),
        )
        for a, b in zip(by_tensor, by_patches):
            assert (
                max(a.lower, b.lower) <= min(a.upper, b.upper) + 1e-12
            )  # the patches' own coefficients are rounded
        assert by_tensor[0].lower <= values.min() + 1e-12
        assert values.max() - 1e-12 <= by_tensor[1].upper


def test_refusals():
    kv = KnotVector.uniform(2, 2)
    flat = BSplineSurface(kv, kv, np.zeros((4, 4)))
    with pytest.raises(ValueError, match=r"bounds need scalar coefficients, got a net of shape \(4, 4, 3\)"):
        minimum(BSplineSurface(kv, kv, np.zeros((4, 4, 3))))
    with pytest.raises(ValueError, match="derivative must be a non-negative integer, got -1"):
        minimum(flat, (0, -1))
    with pytest.raises(ValueError, match=r"one or more patches of equal degrees, got degrees \[\]"):
        minimum([])
    with pytest.raises(
        ValueError, match=r"one or more patches of equal degrees, got degrees \[\(2, 1\), \(2, 2\)\]"
    ):
        minimum([flat, BSplineSurface(kv, KnotVector.uniform(1, 1), np.zeros((4, 2)))])


@pytest.mark.parametrize("height", [1e41, 1e308, -1e308])
def test_numbers_that_could_overflow_are_refused(height):
    kv = KnotVector.uniform(2, 2)
    with pytest.raises(
        ValueError, match=r"bounds need derivatives \(\(1, 1\),\) with coefficients below 1e\+40, got"
    ):
        value_range(BSplineSurface(kv, kv, np.where(np.eye(4, dtype=bool), height, -height)), (1, 1))
