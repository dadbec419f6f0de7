"""Quadrature over outlines against closed forms and a fine grid of points."""

import numpy as np
import pytest

from thbcad.outlines.outline_integrals import area_rule, integral_inside
from thbcad.outlines.rounded_rectangle import Outline
from thbcad.splines import BSplineSurface, KnotVector

H = (4.0, 3.0)
X, Y = np.array([-4, -1.3, 0.2, 3.1, 3.9, 4]), np.array([-3, -2.9, -1, 0.3, 2.5, 3])


@pytest.mark.parametrize("corners", [(0.0, 0.0), (1e-3, 1e-3), (2.0, 1.0), (4.0, 1.0), H])
def test_areas_are_those_of_the_outline_and_points_lie_inside(corners):
    outline = Outline(H, corners)
    x, y, weights = area_rule(outline, X, Y, 8)
    assert outline.contains(x, y, 1e-12).all()
    assert (weights > 0).all()
    assert weights.sum() == pytest.approx(outline.area, rel=1e-14)


def test_polynomials_over_an_ellipse_have_their_moments():
    """The integral of x^2 y^2 over an ellipse is pi a^3 b^3 / 24."""
    x, y, weights = area_rule(Outline(H, H), X, Y, 8)
    assert weights @ (x * y) ** 2 == pytest.approx(np.pi * 12**3 / 24, rel=1e-13)


@pytest.mark.slow
def test_functions_with_kinks_on_the_lines_are_summed_as_on_a_fine_grid():
    """Middles of 2000 cells each way: those on the rim, below 0.2 % of all, err by half in both senses."""
    outline = Outline(H, (2.0, 1.0))
    x, y, weights = area_rule(outline, X, Y, 8)
    a, b = (h * (2 * np.arange(2000) + 1 - 2000) / 2000 for h in H)
    held = outline.contains(a[:, None], b)
    rough = (abs(a[:, None] - 0.2) * abs(b - 0.3) ** 3)[held].sum() * 4 * H[0] * H[1] / 2000**2
    assert weights @ (abs(x - 0.2) * abs(y - 0.3) ** 3) == pytest.approx(rough, rel=1e-4)


@pytest.mark.parametrize("corners", [(0.0, 0.0), (0.5, 1.0), H])
def test_whole_cells_and_those_that_the_rim_cuts_make_up_an_outline(corners):
    """A spline of degree 3 on the lines, for which 8 nodes are exact but beside the rim."""
    outline, rng = Outline(H, corners), np.random.default_rng(5)
    kv_x, kv_y = (KnotVector(3, np.r_[[rows[0]] * 3, rows, [rows[-1]] * 3]) for rows in (X, Y))
    graph = BSplineSurface(kv_x, kv_y, rng.normal(size=(kv_x.dim, kv_y.dim)))
    x, y, weights = area_rule(outline, X, Y, 12)
    assert integral_inside(graph, outline, X, Y, 8) == pytest.approx(float(weights @ graph(x, y)), rel=1e-12)
