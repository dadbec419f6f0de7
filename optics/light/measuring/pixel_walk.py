"""Following straight edges from pixel to pixel (Dr.Jit)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType
from typing import Any, TypeAlias

from optics.base.runtime import DrArray
from optics.light.measuring.cell_grid import highest, lowest

Numbers: TypeAlias = "tuple[DrArray, ...]"


@dataclass(frozen=True, eq=False)
class Edges:
    """Edges p(t) = (a, b) + t (da, db), 0 <= t <= 1, in pixel units, as Dr.Jit arrays."""

    a: DrArray
    b: DrArray
    da: DrArray
    db: DrArray


@dataclass(frozen=True, eq=False)
class Pieces:
    """The pieces of edges that lie in one pixel each, as Dr.Jit arrays.

    i, j : whole numbers, the pixel along a and b; -1 is anything before the first pixel and the number of
        pixels anything behind the last.
    length, middle : of the piece in t.  on : edges that have such a piece; the others are at their end.
    """

    i: DrArray
    j: DrArray
    length: DrArray
    middle: DrArray
    on: DrArray


def walk(
    dr: ModuleType,
    edges: Edges,
    active: DrArray,
    counts: tuple[DrArray, DrArray],
    visit: Callable[[Numbers, Pieces], Numbers],
    numbers: Numbers = (),
) -> Numbers:
    """Visit every piece of active edges in the order of t, and return the last numbers.

    counts : pixels along a and b, opaque whole numbers.  visit : called with (numbers, Pieces), returns the
    next numbers.  Outside of the pixels a piece is as long as it can be.
    """
    Float, Int = type(edges.a), type(counts[0])
    starts, steps = (edges.a, edges.b), (edges.da, edges.db)
    up = [d > 0 for d in steps]
    inverse = [dr.select(d != 0, 1 / d, 0) for d in steps]
    cells = [Int(dr.clip(dr.floor(s), -1, Float(n))) for s, n in zip(starts, counts)]

    def crossing(axis: int, cell: DrArray) -> DrArray:
        """Return t at the next line between pixels; 2 where there is none."""
        line = cell + dr.select(up[axis], Int(1), Int(0))
        exists = (line >= 0) & (line <= counts[axis]) & (steps[axis] != 0)
        return dr.select(exists, (Float(line) - starts[axis]) * inverse[axis], 2.0)

    def body(t: DrArray, i: DrArray, j: DrArray, on: DrArray, *numbers: DrArray) -> Numbers:
        by_a, by_b = crossing(0, i), crossing(1, j)
        first = lowest(dr, by_a, by_b)
        end = lowest(dr, highest(dr, first, t), Float(1))
        numbers = visit(numbers, Pieces(i, j, end - t, 0.5 * (t + end), on))
        on = on & (first < 1)
        along_a = by_a <= by_b
        i = dr.select(on & along_a, i + dr.select(up[0], Int(1), Int(-1)), i)
        j = dr.select(on & ~along_a, j + dr.select(up[1], Int(1), Int(-1)), j)
        return (end, i, j, on, *numbers)

    def goes_on(*state: Any) -> DrArray:
        return state[3]

    start = (dr.zeros(Float, dr.width(edges.a)), *cells, active, *numbers)
    return tuple(dr.while_loop(start, goes_on, body, mode="symbolic")[4:])
