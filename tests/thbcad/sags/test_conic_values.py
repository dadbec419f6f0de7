"""Conics: heights and slopes against closed forms and the complex step."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given, strategies as st

from tests.thbcad.cases import EPS, R2, X, Y
from thbcad.sags import Conic


@pytest.mark.parametrize("radius", [8.0, -8.0, 30.0, -1e4])
@pytest.mark.parametrize("constant", [0.0, 0.3, -0.5, -2.0, -10.0])
def test_conic_against_the_quadratic_formula(radius, constant):
    """(1 + K) z^2 - 2 R z + r^2 = 0, the root at the vertex; exact to the cancellation in that formula."""
    q = 1 + constant
    want = radius / q * (1 - np.sqrt(1 - q * R2 / radius**2))
    assert abs(Conic(radius, constant)(X, Y) - want).max() <= 8 * EPS * abs(radius / q)


def test_sphere_paraboloid_plane_hyperbola():
    assert Conic(5.0)(3.0, 0.0) == pytest.approx(1.0, rel=4 * EPS)
    assert Conic(-5.0)(0.0, 3.0) == pytest.approx(-1.0, rel=4 * EPS)
    assert abs(Conic(7.0, -1.0)(X, Y) - R2 / 14).max() <= 4 * EPS * R2.max() / 14
    assert (Conic()(X, Y) == 0).all()
    assert (Conic(-np.inf, 5.0)(X, Y) == 0).all()
    # hyperbola with K = -2: (z + R)^2 = R^2 + r^2
    assert Conic(3.0, -2.0)(4.0, 0.0) == pytest.approx(2.0, rel=4 * EPS)


@given(st.floats(0.1, 1e6), st.booleans(), st.floats(-20, 5), st.floats(0, 1), st.floats(0, 1))
def test_conic_satisfies_its_equation(radius, negative, constant, x, y):
    """The residual of r^2 - 2 R z + (1 + K) z^2 in exact arithmetic; near the vertex the sag keeps its
    relative accuracy."""
    x, y = 0.5 * x * radius, 0.5 * y * radius
    q = Fraction(1 + constant)
    r2 = Fraction(x) ** 2 + Fraction(y) ** 2
    assume(q * r2 <= Fraction(9, 10) * Fraction(radius) ** 2)
    z = Fraction(float(Conic(-radius if negative else radius, constant)(x, y))) * (-1 if negative else 1)
    assert z >= 0
    residual = abs(r2 - 2 * Fraction(radius) * z + q * z * z)
    # roundings: the argument of the root loses up to 1 / (1 - 0.9) in relative accuracy; x^2 may be subnormal
    assert residual <= (Fraction(1, 10**300) if r2 < Fraction(1, 10**280) else 400 * Fraction(EPS) * r2)


@pytest.mark.parametrize(
    "conic", [Conic(9.0), Conic(-9.0, 0.4), Conic(12.0, -1.0), Conic(-7.0, -3.0), Conic()]
)
def test_conic_slopes_by_the_complex_step(conic):
    h = 1e-30
    for order, step in (((1, 0), (X + 1j * h, Y)), ((0, 1), (X, Y + 1j * h))):
        assert np.allclose(conic(X, Y, order), conic.formula(*step).imag / h, rtol=20 * EPS, atol=20 * EPS)


@pytest.mark.parametrize("radius", [0, 0.0, -0.0, np.nan, None, "a"])
def test_radius_is_refused(radius):
    with pytest.raises(ValueError, match=r"radius must be a number( other than 0)?, got"):
        Conic(radius)


@pytest.mark.parametrize("constant", [np.nan, np.inf, -np.inf])
def test_conic_constant_is_refused(constant):
    with pytest.raises(ValueError, match="conic constant must be a finite number"):
        Conic(5.0, constant)


def test_kinds_of_conic():
    assert Conic().is_plane
    assert Conic(np.inf, 3.0).is_paraboloid
    assert Conic(5.0, -1.0).is_paraboloid
    assert not Conic(5.0, -1.0).is_plane
    assert not Conic(5.0, 0.0).is_paraboloid
