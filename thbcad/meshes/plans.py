"""What meshes over a plan share: bounds of the surfaces above it, its triangles, and their corners on front
and rear.

On a triangle of the plan within a circle of radius R linear interpolation of a function errs by at most
M R^2 / 2, M a bound of its second derivatives in any direction.  By Gershgorin's theorem
M = max(|z_xx|, |z_yy|) + |z_xy|.

Source: S. Waldron, The error in linear interpolation at the vertices of a simplex, SIAM J. Numer. Anal. 35
(1998), theorem 2.1.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from thbcad.certified import cell_bounds
from thbcad.checks import Floats
from thbcad.lens import ALLOWANCE, MOST_TRIANGLES, Lens
from thbcad.outlines import Outline

SINGLE = 2.0**-24  # relative rounding of float32
BESIDE = 1e-9  # of the half-width: by which points of a plan may lie beside their outline


class Bends(NamedTuple):
    """Bounds of the second derivatives of a surface, in any direction, on the cells of its spline.

    x, y : (n + 1,), (m + 1,) the lines between the cells, mm.  sizes : (n, m), 1/mm; 0 outside the outline
    """

    x: Floats
    y: Floats
    sizes: Floats

    def over(self, low: Floats, high: Floats) -> Floats:
        """Return the greatest bound on each of the rectangles with corners (..., 2), mm."""
        ends = []
        for k, lines in enumerate((self.x, self.y)):
            first = np.searchsorted(lines, low[..., k]) - 1  # a cell that is only touched counts
            last = np.searchsorted(lines, high[..., k], "right") - 1
            ends.append([np.clip(row, 0, len(lines) - 2) for row in (first, last)])
        (i, far_i), (j, far_j) = ends
        greatest = np.zeros(i.shape)
        for right in range(int((far_i - i).max()) + 1):
            for up in range(int((far_j - j).max()) + 1):
                own = self.sizes[np.minimum(i + right, far_i), np.minimum(j + up, far_j)]
                np.maximum(greatest, own, out=greatest)
        return greatest


class Bounds(NamedTuple):
    """Bounds over front and rear, within the outline of a mesh.

    bends : of front and rear.  slope : in any direction.  size : of coordinates, mm
    """

    bends: tuple[Bends, Bends]
    slope: float
    size: float

    @property
    def bend(self) -> float:
        """The greatest second derivative, 1/mm."""
        return max(float(bends.sizes.max()) for bends in self.bends)

    def rounding(self, single: bool) -> float:
        """Return what rounding adds to the chord error, mm; single : to float32."""
        return ALLOWANCE + (2 * SINGLE * self.size * (1 + self.slope) if single else 0.0)


def bounds_of(lens: Lens, reach: float, shapes: Sequence[Outline]) -> Bounds:
    """Return the Bounds of a lens.

    reach : the greatest |x| or |y| of the mesh, mm.  shapes : what of front and rear counts; cells outside
    have the bound 0
    """
    bends, slopes = [], []
    for graph, shape in zip(lens.graphs(), shapes):
        xx, xy, yy, x, y = cell_bounds(graph, ((2, 0), (1, 1), (0, 2), (1, 0), (0, 1)))
        lines = graph.kv_u.breaks, graph.kv_v.breaks
        nearest = (np.maximum(np.maximum(row[:-1], -row[1:]), 0.0) for row in lines)
        x_near, y_near = np.meshgrid(*nearest, indexing="ij")
        met = shape.contains(x_near, y_near, slack=BESIDE)
        bends.append(Bends(*lines, (np.maximum(xx, yy) + xy) * met))
        slopes.append(float((np.hypot(x, y) * met).max()))
    size = max(reach, *(float(abs(graph.coefficients).max()) for graph in lens.graphs())) + lens.thickness
    return Bounds((bends[0], bends[1]), max(slopes), size)


def least_circles(a: Floats, b: Floats, c: Floats) -> Floats:
    """Return R^2 of the least circles round triangles with corners (..., 2), mm^2."""
    corners = a, b, c
    squares = np.sort([((p - q) ** 2).sum(axis=-1) for p, q in zip(corners, (b, c, a))], axis=0)
    u, v = b - a, c - a
    double_area = np.abs(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])
    blunt = squares[2] >= squares[0] + squares[1]
    around = np.divide(squares.prod(axis=0), 4 * double_area**2, out=np.zeros_like(double_area), where=~blunt)
    # the circle through the corners of acute triangles, that over the longest side of the others; some
    # operations are rounded
    circles: Floats = np.where(blunt, squares[2] / 4, around) * (1 + 1e-12)
    return circles


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
