"""Piecewise polynomials on Dr.Jit arrays against the kernel's splines."""

import numpy as np
import pytest

from optics.light.intersections.spline_table import PolynomialTable
from tests.optics.cases import THREADS, on_threads
from thbcad.splines import BSplineSurface, KnotVector

DERIVATIVES = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))


def uneven(degree, start, stop, seed):
    """Return a knot vector with uneven spans and one repeated interior knot (still twice differentiable where
    it can be)."""
    inner = np.sort(np.random.default_rng(seed).uniform(start, stop, 6))
    repeated = [inner[2]] * max(0, degree - 3)
    return KnotVector(degree, np.sort(np.r_[[start] * (degree + 1), inner, repeated, [stop] * (degree + 1)]))


def points(kv_x, kv_y, count=400):
    """Return scattered points, every knot crossing and the corners."""
    rng = np.random.default_rng(8)
    x, y = (rng.uniform(kv.start, kv.stop, count) for kv in (kv_x, kv_y))
    a, b = np.meshgrid(kv_x.breaks, kv_y.breaks)
    return np.r_[x, a.ravel()], np.r_[y, b.ravel()]


@pytest.mark.parametrize(("p", "q"), [(2, 2), (3, 3), (4, 4), (5, 5), (2, 5), (4, 3)])
def test_values_and_derivatives_are_those_of_the_spline(backend, p, q):
    kv_x, kv_y = uneven(p, -3.0, 5.0, 1), uneven(q, 0.5, 2.0, 2)
    net = np.random.default_rng(3).uniform(-1, 1, (kv_x.dim, kv_y.dim))
    x, y = points(kv_x, kv_y)
    table = PolynomialTable(backend, (kv_x, kv_y))
    found = table(table.power(net), backend.Float(x), backend.Float(y))
    surface = BSplineSurface(kv_x, kv_y, net)
    for values, derivative in zip(found, DERIVATIVES):
        values = values.numpy()
        expected = surface(x, y, derivative)
        if sum(derivative) == 2 and max(p, q) > 2:
            # a second derivative of a piece may differ across a knot where the spline has only one: leave
            # those out
            smooth = np.arange(len(x)) < 400
            values, expected = values[smooth], expected[smooth]
        # power form on [0, 1]: eps times the sum of the coefficients' moduli, which 2^p p^2 bounds; short
        # spans enlarge derivatives
        shortest = min(np.diff(kv_x.breaks).min(), np.diff(kv_y.breaks).min())
        atol = 2.0 ** (p + q) * 1e-16 * (2 * max(p, q) / shortest) ** sum(derivative) * 4
        np.testing.assert_allclose(values, expected, rtol=0, atol=atol)


def test_a_linear_spline_is_the_plane_everywhere(backend):
    kv_x, kv_y = uneven(3, -3.0, 5.0, 1), uneven(3, 0.5, 2.0, 2)
    table = PolynomialTable(backend, (kv_x, kv_y))
    power = table.power(2 * kv_x.greville()[:, None] - 7 * kv_y.greville()[None, :])
    x, y = points(kv_x, kv_y)
    z, zx, zy, zxx, zxy, zyy = (a.numpy() for a in table(power, backend.Float(x), backend.Float(y)))
    np.testing.assert_allclose(z, 2 * x - 7 * y, rtol=0, atol=1e-13)
    shortest = min(np.diff(kv_x.breaks).min(), np.diff(kv_y.breaks).min())
    np.testing.assert_allclose(zx, 2, rtol=0, atol=1e-13 / shortest)
    np.testing.assert_allclose(zy, -7, rtol=0, atol=1e-13 / shortest)
    np.testing.assert_allclose(np.abs([zxx, zxy, zyy]).max(), 0, atol=1e-12 / shortest**2)


@pytest.mark.parametrize(("p", "q"), [(1, 1), (2, 3), (3, 3), (5, 4)])
def test_pull_back_is_the_adjoint(backend, p, q):
    """<g, A c> = <A^T g, c> for values and both slopes, for random g and c."""
    kv_x, kv_y = uneven(p, -3.0, 5.0, 1), uneven(q, 0.5, 2.0, 2)
    rng = np.random.default_rng(9)
    net = rng.standard_normal((kv_x.dim, kv_y.dim))
    x, y = points(kv_x, kv_y)
    gradients = rng.standard_normal((3, len(x)))
    surface = BSplineSurface(kv_x, kv_y, net)
    forward = [surface(x, y, d) for d in DERIVATIVES[:3]]
    table = PolynomialTable(backend, (kv_x, kv_y))
    back = table.pull_back(backend.Float(x), backend.Float(y), [*map(backend.array, gradients)])
    assert back.shape == net.shape
    scale = sum(np.abs(g) @ np.abs(f) for g, f in zip(gradients, forward))
    assert np.sum(back * net) == pytest.approx(
        sum(g @ f for g, f in zip(gradients, forward)), abs=1e-13 * scale
    )


def test_pull_back_is_the_same_on_any_number_of_threads_and_in_any_order(backend):
    """Gradients of ten orders of magnitude, on 2^17 points that several threads share."""
    kv_x, kv_y = uneven(3, -3.0, 5.0, 1), uneven(3, 0.5, 2.0, 2)
    rng = np.random.default_rng(9)
    x, y = rng.uniform(-3, 5, 1 << 17), rng.uniform(0.5, 2, 1 << 17)
    gradients = rng.standard_normal((3, 1 << 17)) * 10 ** rng.uniform(-9, 1, 1 << 17)

    def pulled(order):
        table = PolynomialTable(backend, (kv_x, kv_y))
        at = backend.array(x[order]), backend.array(y[order])
        return table.pull_back(*at, [backend.array(g[order]) for g in gradients]).tobytes()

    orders = slice(None), slice(None, None, -1), rng.permutation(1 << 17)
    found = {on_threads(threads, pulled, order) for threads in THREADS for order in orders}
    assert len(found) == 1
