"""Random conics, and the greatest errors of a spline of a sag, cell by cell."""

import numpy as np
from hypothesis import strategies as st

from thbcad.sags.conic import Conic


def greatest_errors(function, surface, n=9):
    """Return the greatest |f - s| at n x n points of every cell."""
    kvs = surface.kv_u, surface.kv_v
    x, y = (
        np.minimum(
            (kv.breaks[:-1, None] + np.diff(kv.breaks)[:, None] * np.linspace(0, 1, n)).ravel(), kv.stop
        )
        for kv in kvs
    )
    errors = abs(function.grid(x, y) - surface.grid(x, y))
    return errors.reshape(surface.kv_u.spans, n, surface.kv_v.spans, n).max(axis=(1, 3))


@st.composite
def conics(draw, constants=(-6.0, 4.0)):
    """(conic, (hx, hy)) whose rim stays clear of the end of the conic: 1 - (1 + K) r^2 / R^2 >= 0.1."""
    half = draw(st.floats(0.1, 50)), draw(st.floats(0.1, 50))
    constant = draw(st.floats(*constants))
    least = np.hypot(*half) * max(0.2, np.sqrt(max(0.0, (1 + constant) / 0.9)))
    radius = draw(st.sampled_from([1, -1])) * least * draw(st.floats(1.001, 30))
    return Conic(radius, constant), half
