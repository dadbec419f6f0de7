"""The bound of the distance of a spline from a conic: never below brute force, and near it."""

import numpy as np
import pytest
from hypothesis import assume, given, strategies as st

from thbcad.cad.foreign.conic_bounds import conic_deviation
from thbcad.sags import Conic, PlacedConic
from thbcad.splines import KnotVector, NURBSSurface

HALF = (4.0, 3.0)


def brute_force(surface, conic):
    u, v = (np.linspace(kv.start, kv.stop, 41) for kv in (surface.kv_u, surface.kv_v))
    x, y, z = surface(*(a.ravel() for a in np.meshgrid(u, v))).T
    return np.abs(z - conic(x, y)).max()


@given(
    st.floats(8, 60),
    st.sampled_from([-1, 1]),
    st.floats(-3, 0.5),
    st.floats(-0.1, 0.1),
    st.floats(0.99, 1.01),
)
def test_a_bound_is_never_below_brute_force(radius, sign, constant, bump, change):
    assume(abs(1 + constant) > 0.05)
    conic = Conic(sign * radius, constant)
    patch = PlacedConic(conic, 0.0, HALF).patch
    points = patch.coefficients.copy()
    points[1, 0, 2] += bump
    surface = NURBSSurface(patch.kv_u, patch.kv_v, points, patch.weights).insert([0.3], [-0.2, 1.0])
    other = Conic(sign * radius * change, constant)
    bound = conic_deviation(surface.kv_u, surface.kv_v, surface.coefficients, surface.weights, other)
    exact = brute_force(surface, other)
    assert exact <= bound <= 20 * exact + 1e-9  # one control point has its bump as the greatest coefficient


def test_the_patch_of_a_conic_is_that_conic():
    for constant in (-2.5, -0.5, 0.0, 0.7):
        conic = Conic(-20.0, constant)
        patch = PlacedConic(conic, 0.0, HALF).patch
        assert conic_deviation(patch.kv_u, patch.kv_v, patch.coefficients, patch.weights, conic) < 1e-11


def test_what_has_no_use_is_none():
    conic = Conic(20.0, 0.0)
    patch = PlacedConic(conic, 0.0, HALF).patch
    assert conic_deviation(patch.kv_u, patch.kv_v, patch.coefficients, -patch.weights, conic) is None
    assert conic_deviation(patch.kv_u, patch.kv_v, patch.coefficients, patch.weights, Conic(5.0, 0.0)) is None
    high = patch.coefficients + np.array([0, 0, 25.0])
    assert conic_deviation(patch.kv_u, patch.kv_v, high, patch.weights, conic) is None


@pytest.mark.parametrize("radius", [12.0, -30.0])
def test_a_polynomial_net_of_a_paraboloid(radius):
    """z = (x^2 + y^2) / (2 R) has the poles (a, b, ...) of the blossom."""
    kv = KnotVector(2, np.repeat([-3.0, 3.0], 3))
    a = kv.greville()
    square = np.array([9.0, -9.0, 9.0])
    x, y = np.meshgrid(a, a, indexing="ij")
    points = np.stack([x, y, (square[:, None] + square) / (2 * radius)], axis=-1)
    assert conic_deviation(kv, kv, points, np.ones((3, 3)), Conic(radius, -1.0)) < 1e-11
