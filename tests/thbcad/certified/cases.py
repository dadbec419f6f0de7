"""Random scalar surfaces, and how errors of bounds fall with the size of cells."""

import numpy as np
from hypothesis import strategies as st

from tests.thbcad.cases import coefficients, knot_vectors
from thbcad.splines import BSplineSurface


@st.composite
def graphs(draw, **options):
    """Random scalar surfaces."""
    kv_u, kv_v = draw(knot_vectors(**options)), draw(knot_vectors(**options))
    return BSplineSurface(kv_u, kv_v, draw(coefficients(kv_u.dim, kv_v.dim)))


def assert_it_falls_with_the_square_of_the_cell_size(error_of, graph):
    """error_of : a graph, on whose cells as they are; they are bisected five times."""
    errors = []
    for _ in range(6):
        errors.append(error_of(graph))
        graph = graph.insert(*(kv.breaks[:-1] + np.diff(kv.breaks) / 2 for kv in graph.knot_vectors))
    assert errors[-1] > 0
    # from one level to the next the error varies with the place of the extreme in its cell; the fitted line
    # does not
    rate = -np.polyfit(range(6), np.log2(errors), 1)[0]
    assert 1.7 < rate < 2.5
