"""The share of functions that the gallery shows."""

import numpy as np
import pytest

from benchmarks.gallery.gallery import share_of_uniform
from thbcad import FreeformSurface, KnotVector, Lens, THBSpace, THBSurface


def test_the_share_of_a_mesh_is_its_functions_over_those_of_the_finest_uniform_mesh():
    """Of 8 x 8 spans of degree 3, one quarter refined once: 19 x 19 functions would be uniform."""
    knots = KnotVector.uniform(3, 8, -10, 10)
    space = THBSpace(knots, knots)
    sag = THBSurface(space, np.zeros(space.dim)).refine({0: [(i, j) for i in range(4) for j in range(4)]})
    plane = FreeformSurface((10, 10))
    lens = Lens(plane, FreeformSurface((10, 10), sag=sag), thickness=5, index=1.5)
    assert share_of_uniform(lens) == pytest.approx(sag.space.dim / 19**2, rel=1e-15)
