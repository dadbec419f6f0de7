"""Plans of meshes: bounds of the surfaces above a plan, its triangles, their corners on front and rear, and
the chord error that they keep.

On a triangle of the plan within a circle of radius R linear interpolation of a function errs by at most
M R^2 / 2, M a bound of its second derivatives in any direction.  By Gershgorin's theorem
M = max(|z_xx|, |z_yy|) + |z_xy|.

Over an outline front and rear are grids of n x n cells over a plan: the square |s|, |t| <= 1 is mapped onto
the outline of half-widths 1 ray by ray.  A side runs over w in [-1, 1] along the straight side, |w| <= w_0,
then round the corner at equal steps of the angle, at a speed that does not jump:

    w_0 = (1 - c) / (1 - c + c pi / 4),    c the corner's semi-axis along the side;

of an ellipse this is the concentric map.  The error over a triangle of the plan is the one above.  A chord
of the outline over d in w lies within e = max(a, b) (angle / w)^2 d^2 / 8 of it, a and b the corner's
semi-axes; a wall point is then within e (1 + |grad z|) and the error in z of the wall.

Sources: S. Waldron, The error in linear interpolation at the vertices of a simplex, SIAM J. Numer. Anal. 35
(1998), theorem 2.1; P. Shirley, K. Chiu, A low distortion map between disk and square, 1997.
"""

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
        levels.append(np.column_stack([own, vertex + graph(*graph.on_domain(*own.T))]))
    return levels


def too_many(chord: float) -> ValueError:
    """Return the error for a chord error that needs more triangles than a mesh may have."""
    return ValueError(
        f"a chord error of {chord:.3g} mm needs more than {MOST_TRIANGLES:,} triangles; allow a greater one"
    )


def plan_within(shape: Outline, outer: Outline, bounds: Bounds, chord: float) -> tuple[Floats, float]:
    """Return the unit plan of an outline with the fewest cells that keep a chord error, and that error.

    outer : the outline that the walls reach.
    """
    cells = 1
    while 4 * cells**2 <= MOST_TRIANGLES:
        plan = unit_plan(shape, cells)
        bend = max(outer.corners) * turning(outer) ** 2
        bound = max(plan_error(bends, plan * shape.half_width) for bends in bounds.bends)
        bound += bend * (2 / cells) ** 2 / 8 * (1 + bounds.slope)
        if bound <= chord:
            return plan, bound
        cells = max(cells + 1, int(np.ceil(cells * np.sqrt(bound / chord))) if chord > 0 else 2 * cells)
    raise too_many(chord)


def plan_error(bends: Bends, plan: Floats) -> float:
    """Return the chord error of a surface on the triangles of a plan, mm."""
    a, b, c, d = plan[:-1, :-1], plan[1:, :-1], plan[1:, 1:], plan[:-1, 1:]
    circles = np.maximum(least_circles(a, b, c), least_circles(a, c, d))
    low, high = (f.reduce([a, b, c, d]) for f in (np.minimum, np.maximum))
    return float((bends.over(low, high) * circles).max()) / 2


def turning(outline: Outline) -> float:
    """Return the greatest angle of a corner over w, 0 of a rectangle: along a side |r'| <= max(a, b) turning
    and |r''| <= max(a, b) turning^2."""
    return max(np.pi / 4 / (1 - w) if w < 1 else 0.0 for w in _straight(outline))


def unit_plan(outline: Outline, cells: int) -> Floats:
    """Return the positions (x, y) of a grid over an outline whose half-widths are divided out, (cells + 1,
    cells + 1, 2)."""
    s, t = np.meshgrid(*2 * (np.linspace(-1, 1, cells + 1),), indexing="ij")
    if outline.is_rectangle:
        return np.stack([s, t], axis=-1)
    flat = np.abs(t) <= np.abs(s)
    long, short = np.where(flat, s, t), np.where(flat, t, s)
    w = np.divide(short, long, out=np.zeros_like(s), where=long != 0)
    corners, straight = outline.relative_corners, _straight(outline)
    # of the corner's semi-axes, that along the axis of the greater coordinate, and that across it
    own, other = np.where(flat, *corners), np.where(flat, *corners[::-1])
    start = np.where(flat, *straight)
    angle = np.pi / 4 * np.maximum(abs(w) - start, 0.0) / (1 - start)
    along = long * (1 - own + own * np.cos(angle))
    line = np.minimum(abs(w) / np.where(start > 0, start, 1.0), 1.0)
    across = long * np.sign(w) * ((1 - other) * line + other * np.sin(angle))
    return np.stack([np.where(flat, along, across), np.where(flat, across, along)], axis=-1)


def _straight(outline: Outline) -> list[float]:
    """Return w_0 of the sides at +x and at +y."""
    return [(1 - c) / (1 - c + c * np.pi / 4) for c in outline.relative_corners[::-1]]
