"""Which points lie within a polygon."""

import numpy as np
from matplotlib.path import Path

from thbcad.outlines import Polygon


def test_points_within_a_polygon_are_those_of_matplotlib():
    angles, radii = np.linspace(0, 2 * np.pi, 15)[:-1], 7 * [9.0, 4.0]
    star = [(r * np.cos(a), r * np.sin(a)) for a, r in zip(angles, radii)]
    points = np.random.default_rng(1).uniform(-10, 10, (2, 5000))
    inside = Polygon(tuple(star)).contains(*points)
    assert inside.any()
    np.testing.assert_array_equal(inside, Path(star).contains_points(points.T))
