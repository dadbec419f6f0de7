"""Derivatives of conics of any order, and the bounds of derivatives and rounding, against exact
arithmetic."""

from decimal import Decimal, localcontext
from fractions import Fraction
from math import factorial

import numpy as np
import pytest
from hypothesis import example, given, strategies as st

from oracles.spline_definitions import gamma
from tests.thbcad.cases import seeds
from tests.thbcad.sags.cases import conics
from thbcad.sags.conic import Conic

EPS = np.finfo(float).eps
# (radius, 1 + K, x, y) with a rational root sqrt(1 - (1 + K) r^2 / R^2)
RATIONAL = [
    (13, 1, 3, 4),
    (-26, 4, 3, -4),
    (12, -1, -4, 3),
    (24, -4, 3, 4),
    (-12, -1, 0, 5),
    (7, 0, 2, 3),
    (13, 1, 5, 0),
]


def taylor(radius, kappa, x, y, order):
    """Return the exact Taylor coefficients {(i, j): z_ij} up to a total order, from kappa c z^2 - 2 z + c r^2
    = 0."""
    c, x, y = Fraction(1, radius), Fraction(x), Fraction(y)
    square = 1 - kappa * c * c * (x * x + y * y)
    root = Fraction(Decimal(square.numerator).sqrt()) / Fraction(Decimal(square.denominator).sqrt())
    assert root * root == square
    r2 = {(0, 0): x * x + y * y, (1, 0): 2 * x, (0, 1): 2 * y, (2, 0): 1, (0, 2): 1}
    z = {(0, 0): c * r2[0, 0] / (1 + root)}
    for total in range(1, order + 1):
        for i in range(total + 1):
            j = total - i
            pairs = [(a, b) for a in range(i + 1) for b in range(j + 1) if 0 < a + b < total]
            products = sum((z[a, b] * z[i - a, j - b] for a, b in pairs), Fraction(0))
            z[i, j] = c * (r2.get((i, j), 0) + kappa * products) / (2 * root)
    return z


def samples(conic, x, y, derivative, n=5):
    """Return the greatest size of a derivative at n x n points of every cell of a grid."""
    fine = [(b[:-1, None] + np.diff(b)[:, None] * np.linspace(0, 1, n)).ravel() for b in (x, y)]
    return abs(conic.grid(*fine, derivative)).reshape(len(x) - 1, n, len(y) - 1, n).max(axis=(1, 3))


def breaks(half, n):
    return [np.linspace(-h, h, n + 1) for h in half]


@pytest.mark.parametrize(("radius", "kappa", "x", "y"), RATIONAL)
def test_derivatives_are_those_of_exact_series(radius, kappa, x, y):
    """Fewer than 50 roundings per step of the recurrence, those of w included, relative to the greatest
    coefficient of the same order."""
    exact = taylor(radius, kappa, x, y, 8)
    conic = Conic(radius, kappa - 1)
    for (i, j), want in exact.items():
        size = max(abs(exact[k, i + j - k]) for k in range(i + j + 1))
        got = Fraction(float(conic(float(x), float(y), (i, j)))) / (factorial(i) * factorial(j))
        assert abs(got - want) <= gamma(50 * (i + j + 1)) * size


@given(conics(), st.integers(0, 5), st.integers(0, 5), seeds())
def test_each_order_is_the_complex_step_of_the_one_before(case, a, b, rng):
    conic, half = case
    x, y = (h * rng.uniform(-1, 1, 20) for h in half)
    h = 1e-30
    # both sides cancel by up to 1 / w^2 <= 100 against the terms of their sums, which the derivatives in the
    # corner bound
    scale = (
        abs(conic(*half, (a + b + 1, 0)))
        + abs(conic(*half, (0, a + b + 1)))
        + 1 / abs(conic.radius) / min(half) ** (a + b)
    )
    by_x, by_y = conic.formula(x + 1j * h, y, (a, b)), conic.formula(x, y + 1j * h, (a, b))
    assert abs(conic(x, y, (a + 1, b)) - by_x.imag / h).max() <= 1e4 * EPS * scale
    assert abs(conic(x, y, (a, b + 1)) - by_y.imag / h).max() <= 1e4 * EPS * scale


def test_third_derivatives_of_a_paraboloid_vanish():
    x = np.linspace(-3, 3, 7)
    assert (Conic(5.0, -1.0).grid(x, x, (2, 0)) == 0.2).all()
    assert all((Conic(5.0, -1.0).grid(x, x, d) == 0).all() for d in ((3, 0), (1, 1), (2, 2)))


@given(conics(), st.integers(2, 11), st.sampled_from([0, 1]), st.integers(1, 7))
def test_derivative_bounds_contain_samples(case, order, axis, cells):
    conic, half = case
    x, y = breaks(half, cells)
    derivative = (order, 0) if axis == 0 else (0, order)
    bound = conic.derivative_bound(order, axis, x, y)
    assert bound.shape == (cells, cells)
    # the recurrence for derivatives cancels where K < -1: its rounding is relative to the greatest values on
    # the axis
    assert (samples(conic, x, y, derivative) <= bound + 1e3 * EPS * bound.max()).all()


@given(conics(constants=(-1.0, 4.0)), st.integers(2, 11))
def test_derivative_bounds_are_attained_in_the_farthest_corner(case, order):
    conic, half = case
    x, y = breaks(half, 4)
    bound = conic.derivative_bound(order, 0, x, y)
    corner = abs(
        conic.grid(np.maximum(abs(x[:-1]), abs(x[1:])), np.maximum(abs(y[:-1]), abs(y[1:])), (order, 0))
    )
    assert (bound >= corner).all()
    # 1 - (1 + K) r^2 / R^2 >= 0.1
    assert (bound <= corner * (1 + 16 * order * EPS / 0.09)).all()


@pytest.mark.parametrize("order", range(2, 12))
@pytest.mark.parametrize("radius", [10.0, -40.0])
def test_bounds_of_hyperboloids_are_sharp_on_small_cells(order, radius):
    """The factors vary by less than 10 % on cells of 1/200 of the size: only near zeros of a factor is more
    lost."""
    conic = Conic(radius, -3.0)
    x, y = breaks((10.0, 7.0), 200)
    bound, found = conic.derivative_bound(order, 0, x, y), samples(conic, x, y, (order, 0), 3)
    assert np.median(bound / found) <= 1.1
    assert bound.max() <= 1.1 * found.max()


@pytest.mark.parametrize("order", range(2, 12))
def test_bounds_of_hyperboloids_hold_inside_long_cells(order):
    """The greatest derivative lies between the ends of the cell: B w^(-(n+1)/2) rises and falls along y."""
    conic, x, y = Conic(1.0, -2.0), np.array([9.0, 9.1]), np.array([0.0, 20.0])
    bound, found = conic.derivative_bound(order, 0, x, y), samples(conic, x, y, (order, 0), 401)
    assert found <= bound
    # each factor is at its greatest value; that of P', up to n (n - 1) / 2, may be reached elsewhere
    assert bound <= found * order * (order - 1)


def test_bounds_of_planes_and_paraboloids():
    x, y = breaks((5, 4), 3)
    for conic in (Conic(), Conic(np.inf, -4.0), Conic(9.0, -1.0)):
        assert (conic.derivative_bound(3, 0, x, y) == 0).all()
    assert Conic(10.0, -1.0).derivative_bound(2, 1, x, y) == pytest.approx(np.full((3, 3), 0.1), rel=64 * EPS)


@pytest.mark.parametrize("order", [0, 1])
def test_low_orders_are_refused(order):
    with pytest.raises(ValueError, match=f"order must be at least 2, got {order}"):
        Conic(9.0).derivative_bound(order, 0, [0, 1], [0, 1])


HALVES = st.floats(0.1, 50.0)


@example(6.2, 30.0, 0.0)
@given(HALVES, HALVES, st.floats(-0.99, 3.0))
def test_what_is_accepted_next_to_the_end_is_finite(hx, hy, constant):
    """Radii to the last bits round that at which the conic ends in the corner."""
    radius = np.hypot(hx, hy) * np.sqrt(1 + constant)
    for conic in (Conic(radius + k * np.spacing(radius), constant) for k in range(-4, 5)):
        left = (
            1
            - (1 + Fraction(constant)) * (Fraction(hx) ** 2 + Fraction(hy) ** 2) / Fraction(conic.radius) ** 2
        )
        try:
            conic.require((hx, hy))
        except ValueError:
            assert left <= 8 * EPS
            continue
        for order in np.ndindex(3, 3):
            assert np.isfinite(conic(hx, hy, order))
        x, y = breaks((hx, hy), 2)
        assert np.isfinite(conic.rounding(x, y))
        bound = conic.derivative_bound(3, 0, x, y)
        assert (abs(conic(hx, hy, (3, 0))) <= bound).all()
        assert np.isfinite(bound).all()


@given(conics(constants=(-1000.0, 4.0)), seeds())
def test_rounding_is_bounded(case, rng):
    """Values against 50 decimal digits."""
    conic, half = case
    bound = conic.rounding(*([-h, h] for h in half))
    with localcontext(prec=50):
        radius, kappa = Decimal(conic.radius), 1 + Decimal(conic.constant)
        for x, y in [half, *(rng.uniform(-1, 1, (10, 2)) * half).tolist()]:
            r2 = Decimal(x) ** 2 + Decimal(y) ** 2
            want = r2 / radius / (1 + (1 - kappa * r2 / radius**2).sqrt())
            assert abs(Decimal(float(conic(x, y))) - want) <= Decimal(bound)
    assert bound <= 40 * EPS * abs(conic(*half))
