"""Quadrature over the inside of an outline, for functions that are smooth between lines."""

from __future__ import annotations

import numpy as np

from thbcad.checks import Floats
from thbcad.outlines.rounded_rectangle import Outline
from thbcad.splines import gauss_rule

TURNS = np.linspace(0, np.pi / 2, 9)  # of a corner: a rule of 6 nodes on each errs by less than 1e-12


def area_rule(outline: Outline, x: Floats, y: Floats, count: int) -> tuple[Floats, Floats, Floats]:
    """Return points and weights, (n,) each, of Gauss rules of `count` nodes each way on all pieces inside.

    x, y : lines x = x_i and y = y_j between which integrands are smooth, mm, rising

    Strips end at lines and where the rim crosses them.  Beside a corner x = +-(hx - cx + cx sin t) makes the
    ends of the strips, y = +-(hy - cy + cy cos t), smooth in t: the rules converge as those of a rectangle.
    """
    (hx, hy), (cx, cy) = outline.half_width, outline.corners
    straight, inner = hx - cx, y[abs(y) < hy]
    beside = inner[abs(inner) > hy - cy]
    turned = np.arccos(np.clip((abs(beside) - (hy - cy)) / cy, 0, 1)) if cy else np.empty(0)
    lines = abs(x[(abs(x) > straight) & (abs(x) < hx)])
    ends = np.unique(np.r_[TURNS, np.arcsin((lines - straight) / cx), turned]) if cx else np.zeros(1)
    t, weights = gauss_rule(ends, count)
    places, tops, sizes = [straight + cx * np.sin(t)], [hy - cy + cy * np.cos(t)], [weights * cx * np.cos(t)]
    places, tops, sizes = [*places, -places[0]], tops * 2, sizes * 2
    if straight > 0:
        middle, weights = gauss_rule(np.unique(np.r_[-straight, x[abs(x) < straight], straight]), count)
        places, tops, sizes = [*places, middle], [*tops, np.full_like(middle, hy)], [*sizes, weights]
    at, top, size = (np.concatenate(rows) for rows in (places, tops, sizes))
    # lines above the rim stand at its height: their pieces are empty
    breaks = np.clip(np.r_[-hy, inner, hy], -top[:, None], top[:, None])
    nodes, parts = gauss_rule(np.array([-1.0, 1.0]), count)
    half = np.diff(breaks)[..., None] / 2
    across = breaks[:, :-1, None] + half * (1 + nodes)
    area = size[:, None, None] * half * parts
    real = area > 0
    return np.broadcast_to(at[:, None, None], area.shape)[real], across[real], area[real]
