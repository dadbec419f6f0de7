"""Proven bounds against dense samples, rates of convergence, and splines to a tolerance."""

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, strategies as st

from tests.cases import examples
from tests.thbcad.cases import random_knot_vector, seeds
from tests.thbcad.sags.cases import conics, greatest_errors
from thbcad import interpolate
from thbcad.lens import FreeformSurface
from thbcad.sags.conic import Conic
from thbcad.sags.graphs import CONIC_TOLERANCE, conic_graph
from thbcad.sags.polynomial_sag import PolynomialSag
from thbcad.sags.proven_approximation import (
    approximated,
    cell_maxima,
    error_bounds,
    lebesgue_bound,
    lobatto_nodes,
)
from thbcad.splines import BSplineSurface, KnotVector

EPS = np.finfo(float).eps


def interpolated(function, kv_x, kv_y):
    return interpolate(kv_x, kv_y, function.grid(kv_x.greville(), kv_y.greville()))


@dataclass(frozen=True)
class Ripple:
    """a cos(k x) sin(l y): a user's own function; its derivatives are bounded by a k^n and a l^n."""

    height: float
    k: float
    l: float

    def grid(self, x, y):
        return self.height * np.cos(self.k * x)[:, None] * np.sin(self.l * y)

    def derivative_bound(self, order, axis, x, y):
        return np.full((len(x) - 1, len(y) - 1), self.height * (self.k, self.l)[axis] ** order)

    def rounding(self, x, y):
        reach = self.k * abs(np.asarray(x)).max() + self.l * abs(np.asarray(y)).max()
        return self.height * (4 + reach) * EPS


def square(degree, spans, half=(5.0, 4.0)):
    return [KnotVector.uniform(degree, spans, -h, h) for h in half]


# ---- nodes and constants ----


@pytest.mark.parametrize("degree", range(1, 16))
def test_lebesgue_constants(degree):
    """The greatest sum of |Lagrange polynomials| on dense points: never above the bound, equal to it for odd
    degrees."""
    nodes = lobatto_nodes([-1.0, 1.0], degree)
    t = np.linspace(-1, 1, 4001)
    lagrange = [
        np.prod([(t - o) / (n - o) for o in np.delete(nodes, k)], axis=0) for k, n in enumerate(nodes)
    ]
    found = abs(np.array(lagrange)).sum(axis=0).max()
    assert found <= lebesgue_bound(degree) * (1 + 1e-12)
    # the sum is parabolic at its maximum: samples 1/2000 apart miss less than (degree^2 / 2000)^2 of it; even
    # degrees are 1/degree^2 lower
    assert found >= lebesgue_bound(degree) * (1 - (degree**2 / 2000) ** 2) - (degree % 2 == 0) / degree**2


@pytest.mark.parametrize("degree", range(1, 11))
def test_nodes_are_extrema_of_the_chebyshev_polynomial(degree):
    breaks = np.array([-3.0, 1.0, 1.5, 7.25])
    nodes = lobatto_nodes(breaks, degree)
    assert len(nodes) == 3 * degree + 1
    assert (nodes[::degree] == breaks).all()
    local = 2 * (nodes[: degree + 1] + 3) / 4 - 1
    values = np.polynomial.Chebyshev.basis(degree)(np.clip(local, -1, 1))
    assert values == pytest.approx((-1.0) ** (degree - np.arange(degree + 1)), abs=1e-13)


def test_cell_maxima_count_shared_nodes_to_both_cells():
    values = np.zeros((7, 5))
    values[3, 2] = -2.0
    values[0, 4] = 1.0
    assert cell_maxima(values, (3, 2)).tolist() == [[2, 2], [2, 2]]
    assert cell_maxima(values, (1, 4)).ravel().tolist() == [1, 0, 2, 2, 0, 0]


# ---- bounds ----


@pytest.mark.slow
@examples(100)
@given(conics(), st.integers(2, 10), st.integers(2, 10), seeds())
def test_bounds_contain_the_error_of_any_spline(case, p, q, rng):
    """Interpolants on random knots, as they are and with a random net added."""
    conic, half = case
    kvs = [random_knot_vector(rng, degree, 5).rescale(-h, h) for degree, h in zip((p, q), half)]
    spline = interpolated(conic, *kvs)
    other = BSplineSurface(
        *kvs,
        spline.coefficients
        + abs(conic(*half)) * rng.choice([1e-12, 1e-3, 1]) * rng.uniform(-1, 1, spline.coefficients.shape),
    )
    for surface in (spline, other):
        bounds = error_bounds(conic, surface)
        # what is sampled has the same rounding errors as the nodes
        assert (greatest_errors(conic, surface) <= bounds.total + bounds.rounding).all()
        assert bounds.rounding <= 1e3 * EPS * abs(surface.coefficients).max()


@pytest.mark.parametrize("degree", range(1, 11))
@pytest.mark.parametrize("axis", [0, 1])
def test_the_remainders_alone_bound_what_interpolates_at_the_nodes(axis, degree):
    """T_(p+1) less its interpolant is the node polynomial, of size 0.77 to 1 of what r assumes; that in y
    counts Lambda_p times."""
    top = np.eye(degree + 2)[-1:]
    sag = PolynomialSag((5.0, 4.0), top.T if axis == 0 else top)
    kvs = square(degree, 1)
    solve = [np.linalg.inv(kv.collocation(lobatto_nodes(kv.breaks, degree)).toarray()) for kv in kvs]
    surface = BSplineSurface(
        *kvs, solve[0] @ sag.grid(*(lobatto_nodes(kv.breaks, degree) for kv in kvs)) @ solve[1].T
    )
    bounds, found = error_bounds(sag, surface), greatest_errors(sag, surface, 101).max()
    bound = bounds.total[0, 0]
    assert found <= bound / (lebesgue_bound(degree) if axis else 1) <= 1.31 * found


@pytest.mark.parametrize("degree", range(2, 9))
@pytest.mark.parametrize(
    "conic", [Conic(20.0), Conic(-9.0, 0.2), Conic(15.0, -3.0), Conic(-40.0, -20.0)], ids=str
)
def test_bounds_are_not_far_above_the_error(conic, degree):
    """At most Lambda_p Lambda_q = 5 times the error at the nodes, plus remainders that are a part of it."""
    surface = interpolated(conic, *square(degree, 8))
    bounds = error_bounds(conic, surface)
    assert bounds.total.max() - bounds.rounding <= 12 * greatest_errors(conic, surface).max()


@pytest.mark.parametrize("degree", range(2, 7))
@pytest.mark.parametrize("conic", [Conic(20.0), Conic(15.0, -3.0)], ids=str)
def test_bounds_converge_with_order_degree_plus_one(conic, degree):
    n = {2: 64, 3: 32, 4: 32, 5: 16, 6: 16}[degree]
    bounds = [error_bounds(conic, interpolated(conic, *square(degree, spans))) for spans in (n, 2 * n)]
    coarse, fine = ((b.total - b.rounding).max() for b in bounds)
    assert np.log2(coarse / fine) == pytest.approx(degree + 1, abs=0.35)


def test_a_function_in_the_space_leaves_only_rounding():
    surface = interpolated(Conic(30.0, -1.0), *square(3, 4))
    bounds = error_bounds(Conic(30.0, -1.0), surface)
    assert (bounds.remainder_x == 0).all()
    assert bounds.total.max() <= 2.1 * bounds.rounding <= 500 * EPS * abs(surface.coefficients).max()


@given(st.floats(0.1, 3), st.floats(0.1, 3), st.integers(2, 6), st.integers(1, 12))
def test_bounds_of_a_function_of_ones_own(k, l, degree, spans):
    ripple = Ripple(0.3, k, l)
    surface = interpolated(ripple, *square(degree, spans))
    bounds = error_bounds(ripple, surface)
    assert (greatest_errors(ripple, surface) <= bounds.total + bounds.rounding).all()


# ---- splines to a tolerance ----


@examples(40)
@given(conics(), st.integers(2, 7), st.integers(2, 7), st.integers(2, 7), seeds())
def test_the_tolerance_is_kept_and_so_are_the_knots(case, p, q, digits, rng):
    conic, half = case
    tolerance = 10.0**-digits * abs(conic(*half))
    kvs = [random_knot_vector(rng, degree, 4).rescale(-h, h) for degree, h in zip((p, q), half)]
    found = approximated(conic, *kvs, tolerance)
    assert found.bound <= tolerance
    assert greatest_errors(conic, found.surface, 5).max() <= found.bound
    for kv, finer in zip(kvs, (found.surface.kv_u, found.surface.kv_v)):
        assert kv.prolongation(finer).shape == (finer.dim, kv.dim)  # refuses knots that are lacking


def test_spans_are_bisected_where_the_conic_is_steep_only():
    conic = Conic(100.0)
    found = approximated(conic, *square(3, 1, (50, 50)), 1e-9)
    widths = np.diff(found.surface.kv_u.breaks)
    assert widths[0] == widths[-1] == widths[len(widths) // 2] / 2
    assert (found.surface.kv_u.knots == found.surface.kv_v.knots).all()
    uniform = interpolated(conic, *square(3, found.surface.kv_u.spans, (50, 50)))
    assert error_bounds(conic, uniform).total.max() > 1e-9 >= found.bound


def test_a_direction_without_error_keeps_its_knots():
    kv_x, kv_y = square(3, 2)
    found = approximated(Ripple(0.1, 2.0, 1e-6), kv_x, kv_y, 1e-8)
    assert found.surface.kv_v.dim == kv_y.dim
    assert found.surface.kv_u.dim > 20


def test_a_spline_that_is_good_enough_is_not_refined():
    kv_x, kv_y = square(5, 3)
    assert approximated(Conic(300.0), kv_x, kv_y, 1e-6).surface.coefficients.shape == (kv_x.dim, kv_y.dim)


def test_tolerances_below_rounding_are_refused_with_the_amount():
    with pytest.raises(
        ValueError,
        match=r"1e-16 mm cannot be proven for the conic with radius 30.0 and K 0.5: rounding errors may "
        r"reach .*e-1[34] mm",
    ):
        approximated(Conic(30.0, 0.5), *square(3, 2), 1e-16)


def test_functions_without_finite_bounds_are_refused():
    class Steep(Ripple):
        def derivative_bound(self, order, axis, x, y):
            return np.full((len(x) - 1, len(y) - 1), np.inf)

    with pytest.raises(ValueError, match=r"Steep.* has no finite bounds on the whole rectangle"):
        approximated(Steep(1.0, 1.0, 1.0), *square(3, 2), 1e-6)


def test_tolerances_that_need_too_many_control_points_are_refused():
    with pytest.raises(
        ValueError,
        match=r"Ripple.* cannot be written as a spline to 1e-09 mm with 2000 control points per direction",
    ):
        approximated(Ripple(1.0, 30.0, 1.0), *square(2, 1), 1e-9)


# ---- graphs of conics ----


@pytest.mark.parametrize("conic", [Conic(20.0), Conic(-9.0, 0.2), Conic(15.0, -3.0)], ids=str)
def test_graphs_of_conics_are_proven(conic):
    kvs = square(5, 1)
    graph = FreeformSurface((5.0, 4.0), conic).graph((5, 5))
    assert error_bounds(conic, graph).total.max() <= CONIC_TOLERANCE
    assert (graph.coefficients == approximated(conic, *kvs, CONIC_TOLERANCE).surface.coefficients).all()
    assert (conic_graph(conic, *kvs).coefficients == graph.coefficients).all()


def test_paraboloids_are_proven_exact_but_for_rounding():
    kvs = square(4, 3)
    graph = conic_graph(Conic(-8.0, -1.0), *kvs)
    assert (graph.kv_u, graph.kv_v) == tuple(kvs)
    assert (
        greatest_errors(Conic(-8.0, -1.0), graph).max()
        <= error_bounds(Conic(-8.0, -1.0), graph).total.max()
        <= 1e-12
    )
    assert error_bounds(Conic(), conic_graph(Conic(), *kvs)).total.max() == 0
    with pytest.raises(ValueError, match="degree 2 or more"):
        conic_graph(Conic(9.0), *square(1, 3))
