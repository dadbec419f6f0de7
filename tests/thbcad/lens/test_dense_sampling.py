"""Grids whose interpolation errors are proven: bounds against dense sampling, and where they are sharp."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from thbcad import KnotVector
from thbcad.lens import dense_grid
from thbcad.splines import BSplineSurface

WITHIN = np.linspace(0, 1, 9)  # of a cell


def coons(size, heights, slopes_x, slopes_y):
    """Return a function of s, t in [0, 1]: cubics of Hermite along four sides, blended linearly.

    heights, slopes : at the corners, [i][j].
    """

    def cubic(s, a, b, da, db):
        return (
            (2 * s**3 - 3 * s**2 + 1) * a
            + (3 * s**2 - 2 * s**3) * b
            + s * (1 - s) ** 2 * da
            + (s - 1) * s**2 * db
        )

    (h, k), z, zx, zy = size, heights, slopes_x, slopes_y

    def patch(s, t):
        low, high = (cubic(s, z[0][j], z[1][j], h * zx[0][j], h * zx[1][j]) for j in (0, 1))
        left, right = (cubic(t, z[i][0], z[i][1], k * zy[i][0], k * zy[i][1]) for i in (0, 1))
        flat = sum(z[i][j] * (s if i else 1 - s) * (t if j else 1 - t) for i in (0, 1) for j in (0, 1))
        return (1 - t) * low + t * high + (1 - s) * left + s * right - flat

    return patch


def errors(graph, grid):
    """Return the greatest errors of triangles, bilinear patches and Coons patches at 9 x 9 points a cell."""
    z, zx, zy = (graph.grid(grid.x, grid.y, order) for order in ((0, 0), (1, 0), (0, 1)))
    fine = [np.concatenate([a[:-1, None] + np.diff(a)[:, None] * WITHIN]).ravel() for a in (grid.x, grid.y)]
    exact = graph.grid(*fine).reshape(len(grid.x) - 1, 9, len(grid.y) - 1, 9).transpose(0, 2, 1, 3)
    s, t = WITHIN[:, None], WITHIN[None, :]
    corners = [
        [[a[i : len(a) - 1 + i, j : a.shape[1] - 1 + j, None, None] for j in (0, 1)] for i in (0, 1)]
        for a in (z, zx, zy)
    ]
    h, k = np.diff(grid.x)[:, None, None, None], np.diff(grid.y)[None, :, None, None]
    (a, b), (c, d) = corners[0]
    triangles = np.where(s > t, a + s * (c - a) + t * (d - c), a + t * (b - a) + s * (d - b))
    bilinear = (1 - s) * ((1 - t) * a + t * b) + s * ((1 - t) * c + t * d)
    patches = coons((h, k), *corners)(s, t)
    return [np.abs(made - exact).max() for made in (triangles, bilinear, patches)]


@st.composite
def graphs(draw):
    """Splines of degrees 2 to 5 over uneven knots, mm."""
    axes = []
    for _ in range(2):
        inner = draw(st.lists(st.integers(1, 15), max_size=4, unique=True))
        degree = draw(st.integers(2, 5))
        axes.append(
            KnotVector(degree, np.r_[[-4.0] * (degree + 1), np.sort(inner) / 2 - 4, [4.0] * (degree + 1)])
        )
    seed = draw(st.integers(0, 99))
    net = np.random.default_rng(seed).uniform(-0.5, 0.5, [kv.dim for kv in axes])
    return BSplineSurface(*axes, net)


@given(graph=graphs(), linear=st.floats(1e-3, 1e-1), cubic=st.floats(1e-4, 1e-2))
def test_no_point_between_errs_more_than_the_bound_and_that_no_more_than_asked(graph, linear, cubic):
    grid = dense_grid(graph, linear, cubic)
    triangles, bilinear, patches = errors(graph, grid)
    rounding = 1e-13
    assert max(triangles, bilinear) <= grid.linear + rounding <= linear + 2 * rounding
    assert patches <= grid.cubic + rounding <= cubic + 2 * rounding


@given(graph=graphs())
def test_every_knot_is_a_line_and_both_rims_are(graph):
    grid = dense_grid(graph, 1e-1, 1e-2)
    for kv, line in ((graph.kv_u, grid.x), (graph.kv_v, grid.y)):
        assert set(kv.breaks) <= set(line)
        assert (np.diff(line) > 0).all()
        assert (line[0], line[-1]) == (kv.start, kv.stop)


def polynomial(power_x, power_y):
    """Return x^a y^b as a spline of degrees (4, 4) on [-1, 1]^2."""
    kv = KnotVector.uniform(4, 1, -1.0, 1.0)
    u = kv.greville()
    fit = np.linalg.inv(kv.collocation(u).toarray())
    return BSplineSurface(kv, kv, np.outer(fit @ u**power_x, fit @ u**power_y))


@pytest.mark.parametrize(
    ("powers", "which"),
    [((2, 0), "linear"), ((1, 1), "linear"), ((4, 0), "cubic"), ((0, 4), "cubic"), ((2, 2), "cubic")],
)
def test_the_bounds_are_reached_by_polynomials_whose_derivative_is_constant(powers, which):
    """Of x y by triangles, at the middle of the longest side."""
    graph = polynomial(*powers)
    grid = dense_grid(graph, 1e-3, 1e-6)
    triangles, _, patches = errors(graph, grid)
    found, bound = (triangles, grid.linear) if which == "linear" else (patches, grid.cubic)
    assert found == pytest.approx(bound, rel=1e-4)


def test_a_plane_has_points_too():
    kv = KnotVector.uniform(3, 1, -5.0, 5.0)
    grid = dense_grid(BSplineSurface(kv, kv, np.zeros((4, 4))), 1e-3, 1e-6)
    assert (len(grid.x), len(grid.y), grid.linear, grid.cubic) == (101, 101, 0.0, 0.0)


def test_errors_that_need_too_many_points_are_refused():
    with pytest.raises(ValueError, match="more than 10,000,000"):
        dense_grid(polynomial(4, 0), 1e-12, 1e-6)
    with pytest.raises(ValueError, match="cubic"):
        dense_grid(polynomial(4, 0), 1e-3, 0.0)
