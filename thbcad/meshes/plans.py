"""What meshes over a plan share: bounds of the surfaces above it, its triangles, and their corners on front
and rear.

On a triangle of the plan within a circle of radius R linear interpolation of a function errs by at most
M R^2 / 2, M a bound of its second derivatives in any direction.  By Gershgorin's theorem
M = max(|z_xx|, |z_yy|) + |z_xy|.

Source: S. Waldron, The error in linear interpolation at the vertices of a simplex, SIAM J. Numer. Anal. 35
(1998), theorem 2.1.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from thbcad.certified import cell_bounds
from thbcad.checks import Floats
from thbcad.lens import ALLOWANCE, MOST_TRIANGLES, Lens

SINGLE = 2.0**-24  # relative rounding of float32


class Bounds(NamedTuple):
    """Bounds over front and rear.

    bend : of second derivatives in any direction, 1/mm.  slope : in any direction.  size : of coordinates, mm
    """

    bend: float
    slope: float
    size: float

    def rounding(self, single: bool) -> float:
        """Return what rounding adds to the chord error, mm; single : to float32."""
        return ALLOWANCE + (2 * SINGLE * self.size * (1 + self.slope) if single else 0.0)


def bounds_of(lens: Lens, reach: float) -> Bounds:
    """Return the Bounds of a lens; reach : the greatest |x| or |y| of the mesh, mm."""
    bends, slopes = [], []
    for graph in lens.graphs():
        xx, xy, yy, x, y = cell_bounds(graph, ((2, 0), (1, 1), (0, 2), (1, 0), (0, 1)))
        bends.append(float((np.maximum(xx, yy) + xy).max()))
        slopes.append(float(np.hypot(x, y).max()))
    size = max(reach, *(float(abs(graph.coefficients).max()) for graph in lens.graphs())) + lens.thickness
    return Bounds(max(bends), max(slopes), size)


def greatest_circle(a: Floats, b: Floats, c: Floats) -> float:
    """Return R^2 of the greatest of the least circles round triangles with corners (..., 2), mm^2."""
    corners = a, b, c
    squares = np.sort([((p - q) ** 2).sum(axis=-1) for p, q in zip(corners, (b, c, a))], axis=0)
    u, v = b - a, c - a
    double_area = np.abs(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])
    blunt = squares[2] >= squares[0] + squares[1]
    around = np.divide(squares.prod(axis=0), 4 * double_area**2, out=np.zeros_like(double_area), where=~blunt)
    # the circle through the corners of acute triangles, that over the longest side of the others; some
    # operations are rounded
    return float(np.where(blunt, squares[2] / 4, around).max()) * (1 + 1e-12)


def on_surfaces(lens: Lens, front: Floats, rear: Floats) -> list[Floats]:
    """Return the points of front and rear at positions (n, 2) each, (n, 3); those that rounding put beside
    the rectangle have the height of its rim."""
    levels = []
    for graph, vertex, own in zip(lens.graphs(), (0.0, lens.thickness), (front, rear)):
        x, y = (np.clip(row, kv.start, kv.stop) for row, kv in zip(own.T, (graph.kv_u, graph.kv_v)))
        levels.append(np.column_stack([own, vertex + graph(x, y)]))
    return levels


def too_many(chord: float) -> ValueError:
    """Return the error for a chord error that needs more triangles than a mesh may have."""
    return ValueError(
        f"a chord error of {chord:.3g} mm needs more than {MOST_TRIANGLES:,} triangles; allow a greater one"
    )
