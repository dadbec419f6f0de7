"""Graphs and their poles."""

import numpy as np

from thbcad.sags import graph_of_poles, graph_poles
from thbcad.splines import BSplineSurface, KnotVector


def test_the_graph_of_poles_is_the_graph_that_made_them():
    kv_x, kv_y = KnotVector.uniform(3, 4, -5.0, 5.0), KnotVector.uniform(2, 3, -4.0, 4.0)
    graph = BSplineSurface(kv_x, kv_y, np.sin(np.arange(35.0)).reshape(7, 5))
    poles = graph_poles(graph, 2.0, graph)
    x, y, z = graph_of_poles(poles)
    np.testing.assert_array_equal(x, kv_x.greville())
    np.testing.assert_array_equal(y, kv_y.greville())
    np.testing.assert_array_equal(z.coefficients, 2.0 + graph.coefficients)


def test_a_pole_aside_by_its_last_bit_makes_no_graph():
    kv = KnotVector.uniform(2, 3, -4.0, 4.0)
    poles = graph_poles(
        BSplineSurface(kv, kv, np.zeros((5, 5))), 0.0, BSplineSurface(kv, kv, np.zeros((5, 5)))
    )
    for axis in (0, 1):
        moved = poles.coefficients.copy()
        moved[1, 3, axis] = np.nextafter(moved[1, 3, axis], 9.0)
        assert graph_of_poles(BSplineSurface(kv, kv, moved)) is None
