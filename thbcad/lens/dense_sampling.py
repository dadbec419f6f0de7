"""Grids so dense that interpolation between their points keeps a proven error.

In a cell with the sides h and k, and bounds M of a graph's derivatives there, linear interpolation is wrong
by at most

    (h^2 M_xx + 2 h k M_xy + k^2 M_yy) / 8,

on triangles and bilinearly.  Heights and normals at the corners make a bicubic patch, that of Coons: cubics
along the sides, blended linearly.  It is the Boolean sum of linear interpolation in x and in y, of which each
meets cubics of Hermite in place of the sides, so that it is wrong by at most

    (h^4 M_xxxx + k^4 M_yyyy) / 384 + h^2 k^2 M_xxyy / 64.

All knots are lines of the grid: within a cell the graph is one polynomial.

Source: G. Farin, Curves and surfaces for CAGD, on Coons patches; P. J. Davis, Interpolation and
approximation, chapter 3, on remainders.
"""

from typing import NamedTuple

import numpy as np

from thbcad.certified import cell_bounds
from thbcad.checks import Floats, require_number, require_type
from thbcad.lens.triangulation import subdivided
from thbcad.splines import BSplineSurface

MOST_POINTS = 10_000_000
LEAST_STEPS = 100  # along each direction, of planes too
ORDERS = ((2, 0), (1, 1), (0, 2), (4, 0), (2, 2), (0, 4))


class DenseGrid(NamedTuple):
    """Lines of a grid, and what interpolation between its points may err.

    x, y : (nx,), (ny,) mm.  linear : mm, of triangles and bilinear patches.  cubic : of Coons patches.
    """

    x: Floats
    y: Floats
    linear: float
    cubic: float


def dense_grid(graph: BSplineSurface, linear: float, cubic: float) -> DenseGrid:
    """Return a grid over a scalar graph z(x, y) between whose points interpolation keeps two errors, mm.

    As 2 h k <= h^2 + k^2, here and for squares, it is enough that h^2 (M_xx + M_xy) <= 4 linear and
    h^4 (M_xxxx / 3 + M_xxyy) <= 64 cubic, and the same for k.

    Raises ValueError : errors that are not positive, more than 10 million points.
    """
    require_type("graph", graph, BSplineSurface)
    for name, error in (("linear", linear), ("cubic", cubic)):
        require_number(name, error, above=0, finite=True)
    xx, xy, yy, x4, xxyy, y4 = cell_bounds(graph, ORDERS)
    parts, steps = [], []
    for axis, (kv, second, fourth) in enumerate(zip((graph.kv_u, graph.kv_v), (xx, yy), (x4, y4))):
        needs = (second + xy) / (4 * linear), (fourth / 3 + xxyy) / (64 * cubic)
        bends, twists = (need.max(axis=1 - axis) for need in needs)
        width = np.diff(kv.breaks)
        per_mm = np.maximum(np.maximum(bends**0.5, twists**0.25), LEAST_STEPS / width.sum())
        parts.append(np.ceil(np.clip(width * per_mm, 1, MOST_POINTS)))
        steps.append(width / parts[-1])
    count = (parts[0].sum() + 1) * (parts[1].sum() + 1)
    if count > MOST_POINTS:
        raise ValueError(
            f"points that give {linear:g} mm linearly and {cubic:g} mm cubically would be {count:,.0f}, more "
            f"than {MOST_POINTS:,}"
        )
    x, y = (subdivided(kv.breaks, n.astype(np.int64)) for kv, n in zip((graph.kv_u, graph.kv_v), parts))
    h, k = steps[0][:, None], steps[1][None, :]
    return DenseGrid(
        x,
        y,
        float((h**2 * xx + 2 * h * k * xy + k**2 * yy).max()) / 8,
        float(((h**4 * x4 + k**4 * y4) / 384 + (h * k) ** 2 * xxyy / 64).max()),
    )
