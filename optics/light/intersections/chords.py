"""Where lines in the plan enter and leave the outline of a surface, in closed form."""

from __future__ import annotations

from collections.abc import Sequence

from optics.base.runtime import Backend, DrArray
from thbcad.outlines import Outline


def chord(
    backend: Backend, outline: Outline, point: Sequence[DrArray], direction: Sequence[DrArray]
) -> tuple[DrArray, DrArray]:
    """Return between which t the lines o + t d lie within an outline with rounded corners; start > stop for
    none.

    The rectangle |x| <= hx, |y| <= hy bounds the line.  Where an end lies in a corner, the line's meeting
    with the whole ellipse of the corner takes its place: with its middle m, p = (o - m) / c and q = d / c,

        t = (-p q -+ sqrt(q^2 - (p x q)^2)) / q^2.

    point, direction : o and d, x and y each, mm.  Where d = 0 the line is a point.
    """
    dr, opaque = backend.dr, backend.opaque
    start, stop = backend.Float(-dr.inf), backend.Float(dr.inf)
    half = [opaque(h) for h in outline.half_width]
    for h, o, d in zip(half, point, direction):
        moves = d != 0
        rate = dr.select(moves, d, 1)
        ends = (-h - o) / rate, (h - o) / rate
        start = dr.select(moves, dr.maximum(start, dr.minimum(*ends)), start)
        stop = dr.select(moves, dr.minimum(stop, dr.maximum(*ends)), dr.select(dr.abs(o) <= h, stop, -dr.inf))
    met = start <= stop
    found = []
    for end, side in ((start, -1.0), (stop, 1.0)):
        place = dr.select(dr.isfinite(end), end, 0)
        at_corner, p, q = True, [], []
        for h, c, o, d in zip(half, outline.corners, point, direction):
            straight, per = h - opaque(c), opaque(1 / c)
            a = o + place * d
            at_corner = at_corner & (dr.abs(a) > straight)
            p.append((o - dr.copysign(straight, a)) * per)
            q.append(d * per)
        squares, along, across = (
            q[0] * q[0] + q[1] * q[1],
            p[0] * q[0] + p[1] * q[1],
            p[0] * q[1] - p[1] * q[0],
        )
        moves, room = squares > 0, squares - across * across
        met &= ~at_corner | dr.select(moves, room >= 0, p[0] * p[0] + p[1] * p[1] <= 1)
        root = (side * dr.sqrt(dr.maximum(room, 0)) - along) / dr.select(moves, squares, 1)
        found.append(dr.select(at_corner & moves, root, end))
    return dr.select(met, found[0], 1), dr.select(met, found[1], 0)
