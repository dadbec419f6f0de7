"""Polynomial sags against numpy, exact sums and quadrature; their bounds and their splines."""

from fractions import Fraction
from math import factorial

import numpy as np
import pytest
from hypothesis import given, strategies as st
from numpy.polynomial import chebyshev, legendre
from scipy.special import roots_jacobi

from tests.thbcad.cases import seeds
from tests.thbcad.sags.cases import greatest_errors
from thbcad import interpolate
from thbcad.sags.polynomial_sag import PolynomialSag, osa_orders, zernike
from thbcad.sags.proven_approximation import approximated, error_bounds
from thbcad.splines import KnotVector

EPS = np.finfo(float).eps
TERMS = [osa_orders(j) for j in range(66)]  # to degree 10


def interpolated(function, kv_x, kv_y):
    return interpolate(kv_x, kv_y, function.grid(kv_x.greville(), kv_y.greville()))


def exact_zernike(n, m, x, y):
    """Return R_n^|m| cos or sin of |m| theta, without the factor sqrt(...), by the factorial sum."""
    k = abs(m)
    radial = sum(
        Fraction(
            (-1) ** s * factorial(n - s),
            factorial(s) * factorial((n + k) // 2 - s) * factorial((n - k) // 2 - s),
        )
        * (x * x + y * y) ** ((n - k) // 2 - s)
        for s in range((n - k) // 2 + 1)
    )
    real, imaginary = Fraction(1), Fraction(0)
    for _ in range(k):
        real, imaginary = real * x - imaginary * y, real * y + imaginary * x
    return radial * (real if m >= 0 else imaginary)


def exact_chebyshev(m, t):
    row = [Fraction(1), t]
    while len(row) <= m:
        row.append(2 * t * row[-1] - row[-2])
    return row[m]


@st.composite
def sags(draw, max_degree=10):
    """Random sags, coefficients of sizes that fall with the degree."""
    half = draw(st.floats(0.1, 50)), draw(st.floats(0.1, 50))
    shape = draw(st.integers(1, max_degree + 1)), draw(st.integers(1, max_degree + 1))
    decay = draw(st.sampled_from([1.0, 0.3])) ** np.add.outer(*(np.arange(n) for n in shape))
    return PolynomialSag(half, draw(seeds()).uniform(-1, 1, shape) * decay)


def knots(sag, p, q, spans=3):
    return [KnotVector.uniform(degree, spans, -h, h) for degree, h in zip((p, q), sag.half_width)]


# ---- Zernike polynomials ----


def test_osa_indices():
    assert [osa_orders(j) for j in range(10)] == [
        (0, 0),
        (1, -1),
        (1, 1),
        (2, -2),
        (2, 0),
        (2, 2),
        (3, -3),
        (3, -1),
        (3, 1),
        (3, 3),
    ]
    assert all((n * (n + 2) + m) // 2 == j for j, (n, m) in enumerate(osa_orders(j) for j in range(2000)))


@pytest.mark.parametrize(("n", "m"), TERMS)
def test_zernike_against_the_factorial_sum(n, m):
    """Inside and outside the disk; rounding relative to (1 + sqrt 2)^n, the size of the sum with all signs
    made plus."""
    norm = np.sqrt((n + 1) * (2 if m else 1))
    for x, y in [
        (0, 0),
        (1, 0),
        (Fraction(3, 8), Fraction(-5, 8)),
        (Fraction(-1, 4), Fraction(7, 8)),
        (Fraction(5, 4), Fraction(-3, 4)),
    ]:
        want = norm * float(exact_zernike(n, m, Fraction(x), Fraction(y)))
        size = norm * max(1.0, float(np.hypot(float(x), float(y)))) ** n * 2.5**n
        assert abs(float(zernike(n, m, float(x), float(y))) - want) <= 8 * (n + 1) * EPS * size


def test_zernike_polynomials_are_orthonormal_on_the_disk():
    """The mean of products is 1 or 0, by Gauss quadrature in rho^2 and equal angles, exact to degree 20."""
    nodes, weights = roots_jacobi(12, 0, 0)
    rho, angles = np.sqrt((1 + nodes) / 2), 2 * np.pi * np.arange(24) / 24
    x, y = np.outer(rho, np.cos(angles)), np.outer(rho, np.sin(angles))
    rows = np.array([zernike(n, m, x, y) for n, m in TERMS])
    means = np.einsum("arp,brp,r->ab", rows, rows, weights / 2 / len(angles))
    assert abs(means - np.eye(len(TERMS))).max() <= 1e-13


@pytest.mark.parametrize(("n", "m"), TERMS[:28])
def test_symmetries_of_zernike_polynomials(n, m):
    x, y = np.random.default_rng(0).uniform(-1, 1, (2, 30))
    z = zernike(n, m, x, y)
    assert zernike(n, m, x, -y) == pytest.approx(z if m >= 0 else -z, abs=0)
    assert zernike(n, m, -x, -y) == pytest.approx((-1) ** n * z, abs=0)
    # a turn by 90 degrees / m takes the sine term to the cosine term
    turned = (x + 1j * y) * np.exp(0.5j * np.pi / max(abs(m), 1))
    if m < 0:
        assert zernike(n, m, turned.real, turned.imag) == pytest.approx(zernike(n, -m, x, y), abs=1e4 * EPS)
    else:
        assert zernike(n, m, 1.0, 0.0) == pytest.approx(np.sqrt((n + 1) * (2 if m else 1)), rel=8 * EPS)


@pytest.mark.parametrize(("n", "m"), [(1, 0), (2, 3), (3, -5), (0, 1), (-2, 0)])
def test_terms_that_do_not_exist_are_refused(n, m):
    with pytest.raises(ValueError, match=f"needs .* got n = {n}, m = {m}"):
        zernike(n, m, 0.0, 0.0)


@pytest.mark.parametrize("j", [-1, 1.5, True])
def test_bad_indices_are_refused(j):
    with pytest.raises(ValueError, match="a Zernike index must be a non-negative integer"):
        osa_orders(j)


# ---- sags ----


@given(seeds(), st.integers(1, 12), st.integers(1, 12))
def test_legendre_sags_against_numpy(rng, n_x, n_y):
    a = rng.uniform(-1, 1, (n_x, n_y))
    sag = PolynomialSag.legendre((5.0, 0.4), a)
    x, y = rng.uniform(-1, 1, 20), rng.uniform(-1, 1, 20)
    tolerance = 4 * EPS * (n_x**2 + n_y**2) * abs(a).sum()
    assert abs(sag(5 * x, 0.4 * y) - legendre.legval2d(x, y, a)).max() <= tolerance
    assert abs(sag.grid(5 * x, 0.4 * y) - legendre.leggrid2d(x, y, a)).max() <= tolerance
    slopes = legendre.leggrid2d(x, y, legendre.legder(a, axis=1)) / 0.4
    assert abs(sag.grid(5 * x, 0.4 * y, (0, 1)) - slopes).max() <= tolerance * n_y**2 / 0.4


@given(sags(), st.integers(0, 4), st.integers(0, 4))
def test_values_and_derivatives_against_numpy(sag, a, b):
    hx, hy = sag.half_width
    x, y = np.linspace(-hx, hx, 9), np.linspace(-hy, hy, 7)
    c = chebyshev.chebder(chebyshev.chebder(sag.coefficients, a, axis=0), b, axis=1)
    want = chebyshev.chebgrid2d(x / hx, y / hy, c) / hx**a / hy**b
    allowed = 2000 * EPS * (abs(c).sum() + 1e-300) / hx**a / hy**b
    assert abs(sag.grid(x, y, (a, b)) - want).max() <= allowed
    assert abs(sag(x[:7], y, (a, b)) - np.diag(want[:7])).max() <= allowed
    assert abs(sag.derivative(a, b).grid(x, y) - want).max() <= allowed


@given(st.dictionaries(st.sampled_from(TERMS), st.floats(-1, 1), max_size=6), st.floats(0.3, 3))
def test_zernike_sags_are_their_terms(terms, share):
    """On rectangles within the disk and far beyond; the rounding is that of the greatest values on the
    rectangle."""
    half, radius = (5.0, 4.0), 5.0 / share
    sag = PolynomialSag.zernike(half, radius, terms)
    x, y = np.linspace(-5, 5, 17), np.linspace(-4, 4, 15)
    want = sum(
        (a * zernike(n, m, x[:, None] / radius, y[None, :] / radius) for (n, m), a in terms.items()),
        np.zeros((17, 15)),
    )
    assert abs(sag.grid(x, y) - want).max() <= 1e4 * EPS * sum(
        abs(a * zernike(n, 0 if n % 2 == 0 else 1, np.sqrt(2) * max(share, 1), 0.0))
        for (n, _), a in terms.items()
    )


@given(sags(6), seeds())
def test_rounding_is_bounded(sag, rng):
    """Values against exact sums."""
    (hx, hy), bound = sag.half_width, sag.rounding(*([-h, h] for h in sag.half_width))
    for s, t in [(1, 1), (-1, 1), *rng.uniform(-1, 1, (4, 2)).tolist()]:
        x, y = s * hx, t * hy
        exact = sum(
            Fraction(float(c))
            * exact_chebyshev(m, Fraction(x) / Fraction(hx))
            * exact_chebyshev(n, Fraction(y) / Fraction(hy))
            for (m, n), c in np.ndenumerate(sag.coefficients)
        )
        assert abs(Fraction(float(sag.grid([x], [y])[0, 0])) - exact) <= bound
    assert bound <= 200 * EPS * abs(sag.coefficients).sum()


@given(sags(), st.integers(0, 11), st.sampled_from([0, 1]), st.integers(1, 6))
def test_derivative_bounds_contain_samples(sag, order, axis, cells):
    x, y = (np.linspace(-h, h, cells + 1) for h in sag.half_width)
    derivative = (order, 0) if axis == 0 else (0, order)
    bound = sag.derivative_bound(order, axis, x, y)
    fine = [
        np.minimum((b[:-1, None] + np.diff(b)[:, None] * np.linspace(0, 1, 9)).ravel(), b[-1]) for b in (x, y)
    ]
    found = abs(sag.grid(*fine, derivative)).reshape(cells, 9, cells, 9).max(axis=(1, 3))
    assert (found <= bound).all()
    if order > sag.degrees[axis]:
        assert (bound == 0).all()
    # Lambda^2 <= 7 for degree 10; 9 x 9 samples miss little of a polynomial of that degree
    assert bound.max() <= 12 * found.max()


# ---- splines ----


@given(sags(6), st.integers(0, 3), st.integers(0, 3))
def test_splines_of_sufficient_degree_are_exact_but_for_rounding(sag, more_x, more_y):
    kvs = knots(sag, *(max(n, 1) + more for n, more in zip(sag.degrees, (more_x, more_y))))
    size = abs(sag.coefficients).sum()
    found = approximated(sag, *kvs, 1e-10 * size)
    assert (found.surface.kv_u.dim, found.surface.kv_v.dim) == tuple(kv.dim for kv in kvs)
    assert greatest_errors(sag, found.surface).max() <= found.bound <= 1e-10 * size


@given(sags(), st.integers(2, 5), st.integers(2, 5), st.integers(1, 5))
def test_bounds_contain_the_error_of_interpolation(sag, p, q, spans):
    surface = interpolated(sag, *knots(sag, p, q, spans))
    bounds = error_bounds(sag, surface)
    assert (greatest_errors(sag, surface) <= bounds.total + bounds.rounding).all()


@pytest.mark.parametrize("degree", [3, 4, 5])
def test_zernike_sags_as_splines_to_a_tolerance(degree):
    sag = PolynomialSag.zernike(
        (5.0, 4.0), 5.0, {(2, 0): 0.1, osa_orders(12): 0.02, (3, -3): 0.01, (6, 2): 0.003}
    )
    found = approximated(sag, *knots(sag, degree, degree, 1), 1e-8)
    error = greatest_errors(sag, found.surface).max()
    assert error <= found.bound <= 1e-8
    assert found.bound <= 12 * error
    # a bisection of all spans divides the error by 2^(degree + 1): more of them than needed are not made
    assert error >= 1e-8 / 12 / 2 ** (degree + 1)


def test_bad_sags_are_refused():
    with pytest.raises(ValueError, match="half_width must be two positive numbers"):
        PolynomialSag((5, 0), [[1.0]])
    for c in ([1.0, 2.0], [[np.nan]], np.zeros((0, 2))):
        with pytest.raises(ValueError, match="coefficients must be a table of finite numbers"):
            PolynomialSag((5, 4), c)
    with pytest.raises(ValueError, match="coefficients must be a table"):
        PolynomialSag.legendre((5, 4), [1.0, 2.0])
    with pytest.raises(ValueError, match=r"x = -6.0 lies outside the domain \[-5.0, 5.0\]"):
        PolynomialSag((5, 4), [[1.0]]).rounding([-6.0, 1.0], [0, 1])
