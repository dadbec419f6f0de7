"""Plans of meshes over an outline, and the chord error that they keep.

Front and rear are grids of n x n cells over a plan: the square |s|, |t| <= 1 is mapped onto the outline of
half-widths 1 ray by ray.  A side runs over w in [-1, 1] along the straight side, |w| <= w_0, then round the
corner at equal steps of the angle, at a speed that does not jump:

    w_0 = (1 - c) / (1 - c + c pi / 4),    c the corner's semi-axis along the side;

of an ellipse this is the concentric map.  The error over a triangle of the plan is that of `plans`.  A chord
of the outline over d in w lies within e = max(a, b) (angle / w)^2 d^2 / 8 of it, a and b the corner's
semi-axes; a wall point is then within e (1 + |grad z|) and the error in z of the wall.

Source: P. Shirley, K. Chiu, A low distortion map between disk and square, 1997.
"""

from __future__ import annotations

import numpy as np

from thbcad.checks import Floats
from thbcad.lens import MOST_TRIANGLES
from thbcad.meshes.plans import Bends, Bounds, least_circles, too_many
from thbcad.outlines import Outline


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
