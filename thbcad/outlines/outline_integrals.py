"""Integrals within an outline: of functions that are smooth between lines, and the volume between two graphs
within walls round it.

V = integral of z dx dy over the surface of the body, by the divergence theorem.  Between the points (f, z_f)
and (r, z_r) of equal parameter of the two rims a wall is ruled, and with d = r - f and
a x b = a_x b_y - a_y b_x it adds the integral along the rim of

    z_f (f' x d + d' x d / 2) + (z_r - z_f) (f' x d / 2 + d' x d / 3).
"""

from typing import Protocol

import numpy as np

from thbcad.checks import Bools, Floats
from thbcad.outlines.pieces import RimPiece, integral_within
from thbcad.outlines.rounded_rectangle import Outline
from thbcad.splines import BSplineSurface, Integrand, gauss_rule

TURNS = np.linspace(0, np.pi / 2, 9)  # of a corner: a rule of 6 nodes on each errs by less than 1e-12
ROWS = 512  # of nodes of whole cells, at once
UPRIGHT = (1.0, 1.0)


def integral_inside(f: Integrand, outline: Outline, x: Floats, y: Floats, count: int) -> float:
    """Return the integral of f over an outline by `area_rule`; cells that lie inside are taken as a grid."""
    held = outline.contains(x[:, None], y)
    whole = held[1:, 1:] & held[1:, :-1] & held[:-1, 1:] & held[:-1, :-1]
    (at_x, by_x), (at_y, by_y) = gauss_rule(x, count), gauss_rule(y, count)
    total = 0.0
    for first in range(0, len(at_x), ROWS):
        part = slice(first, first + ROWS)
        counts = np.repeat(np.repeat(whole, count, axis=0)[part], count, axis=1)
        total += float(by_x[part] @ np.where(counts, f.grid(at_x[part], at_y), 0.0) @ by_y)
    at_x, at_y, weights = area_rule(outline, x, y, count, whole)
    return total + float(weights @ f(at_x, at_y))


def area_rule(
    outline: Outline, x: Floats, y: Floats, count: int, without: Bools | None = None
) -> tuple[Floats, Floats, Floats]:
    """Return points and weights, (n,) each, of Gauss rules of `count` nodes each way on all pieces inside.

    x, y : lines x = x_i and y = y_j between which integrands are smooth, mm, rising
    without : (len(x) - 1, len(y) - 1), cells between lines that are left out, None is none

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
    lines = np.r_[-hy, inner, hy]
    # lines above the rim stand at its height: their pieces are empty
    breaks = np.clip(lines, -top[:, None], top[:, None])
    half = np.diff(breaks) / 2
    wanted = half > 0
    if without is not None:
        column, row = np.searchsorted(x, at) - 1, np.searchsorted(y, (lines[1:] + lines[:-1]) / 2) - 1
        wanted &= ~without[column][:, row]
    strip, piece = np.nonzero(wanted)
    nodes, parts = gauss_rule(np.array([-1.0, 1.0]), count)
    half = half[strip, piece][:, None]
    across, area = breaks[strip, piece][:, None] + half * (1 + nodes), size[strip][:, None] * half * parts
    return np.repeat(at[strip], count), across.ravel(), area.ravel()


class Shape(Protocol):
    """What an outline encloses."""

    @property
    def area(self) -> float:
        """The area within, mm^2."""

    @property
    def pieces(self) -> tuple[RimPiece, ...]:
        """The outline, counter-clockwise."""


def walled_volume(
    graphs: tuple[BSplineSurface, BSplineSurface],
    thickness: float,
    shape: Shape,
    factors: tuple[float, float] = UPRIGHT,
) -> float:
    """Return the volume of a body from the graph of its front to that of its rear, mm^3.

    graphs : scalar splines z(x, y), mm.  thickness : of the rear's z = 0 over the front's, mm
    shape : the outline of the rear.  factors : of x and y, from it to that of the front

    The integrals are exact for the splines but for rounding.
    """
    front, rear = graphs
    low = tuple(piece.scaled(factors) for piece in shape.pieces) if factors != UPRIGHT else shape.pieces
    volume = shape.area * thickness + integral_within(rear, shape.pieces) - integral_within(front, low)
    if factors == UPRIGHT:
        return volume
    x, y = (
        np.union1d(a.breaks / factor, b.breaks)
        for a, b, factor in zip((front.kv_u, front.kv_v), (rear.kv_u, rear.kv_v), factors)
    )
    degree = max(g.kv_u.degree + g.kv_v.degree for g in graphs)
    for own, other in zip(low, shape.pieces):
        t, weights = other.rule(x, y, degree)
        f, r = own(t), other(t)
        base, top = front(*front.on_domain(*f)), thickness + rear(*rear.on_domain(*r))
        d, slope, other_slope = np.subtract(r, f), np.array(own(t, 1)), np.array(other(t, 1))
        first, second = cross(slope, d), cross(other_slope - slope, d)
        volume += float(weights @ (base * (first + second / 2) + (top - base) * (first / 2 + second / 3)))
    return volume


def cross(a: Floats, b: Floats) -> Floats:
    product: Floats = a[0] * b[1] - a[1] * b[0]
    return product
