"""Exact faces of a THB surface between two extremes: one face with all needed knots, and many small ones.

A face over a box carries the level-0 knots and one knot line through the middle of every refined
cell that meets the box.  The domain is bisected, across the direction that leaves fewer control
points, as long as two faces can cost less than one; then bisections are taken back, from the smallest
boxes up, where the faces of both halves together cost more than one face:

    cost of a face = its control points + the price of a face.

Source: the pruning of L. Breiman et al., Classification and Regression Trees (1984), chapter 3.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from thbcad.checks import Integers, require_number
from thbcad.hierarchy import DyadicAxis, THBSpace
from thbcad.splines import BSplineSurface, KnotVector, banded_least_squares, tensor_apply

Box = tuple[tuple[int, int], tuple[int, int]]  # start and stop in u and in v, in breaks of the finest level


@dataclass(frozen=True, eq=False)
class _Side:
    """One direction: the level-0 breaks and the extents and middles of the refined cells, in breaks of the
    finest level."""

    axis: DyadicAxis
    top: int
    old: Integers
    multiplicity: Integers
    low: Integers
    high: Integers

    def needed(self, start: int, stop: int, cells: Integers) -> Integers:
        """Return the breaks strictly inside at which a face needs knots, with their multiplicities."""
        inside = (self.old > start) & (self.old < stop)
        middles = (self.low[cells] + self.high[cells]) // 2
        new = np.unique(middles[(middles > start) & (middles < stop)])
        return np.sort(np.concatenate([np.repeat(self.old[inside], self.multiplicity[inside]), new]))

    def meeting(self, start: int, stop: int, cells: Integers) -> Integers:
        """Return those of the refined cells that meet the open interval."""
        return cells[(self.low[cells] < stop) & (self.high[cells] > start)]

    def middle(self, start: int, stop: int) -> int | None:
        """Return the break of the coarsest level strictly inside, the nearest to the middle; None when there
        is none."""
        for level in range(self.top + 1):
            step = 1 << (self.top - level)
            first, last = start // step + 1, -(-stop // step) - 1
            if first <= last:
                return step * min(max(round((start + stop) / (2 * step)), first), last)
        return None

    def knot_vector(self, start: int, stop: int, cells: Integers) -> KnotVector:
        """Return the clamped knot vector of a face."""
        inner = self.axis.value(self.top, self.needed(start, stop, cells))
        return KnotVector.clamped(
            self.axis.degree, inner, *self.axis.value(self.top, np.array([start, stop]))
        )


def faces(space: THBSpace, surface: BSplineSurface, price: float) -> Iterator[BSplineSurface]:
    """Yield the faces of the cheapest pruning of one bisection.

    surface : the tensor-product form of a surface over `space`
    price : control points that a face is worth; 0 gives the fewest control points, inf one face
    """
    require_number("the price of a face", price, least=0)
    sides = _side(space, 0), _side(space, 1)
    (last_u, last_v) = (side.axis.spans(side.top) for side in sides)
    _, boxes = _cheapest(sides, ((0, last_u), (0, last_v)), np.arange(len(sides[0].low)), price)
    for box in boxes:
        yield _face(sides, surface, box)


def _side(space: THBSpace, d: int) -> _Side:
    axis = space.hierarchy[0].axes[d]
    top = space.levels - 1
    old = np.arange(axis.spans0 + 1)
    none = np.zeros(0, dtype=np.int64)
    low = np.concatenate([none, *(c[:, d] << (top - level) for level, c in enumerate(space.refined))])
    size = np.concatenate(
        [none, *(np.full(len(c), 1 << (top - level)) for level, c in enumerate(space.refined))]
    )
    return _Side(
        axis=axis,
        top=top,
        old=old << top,
        multiplicity=axis.multiplicity(0, old),
        low=low,
        high=low + size,
    )


def _cheapest(sides: tuple[_Side, _Side], box: Box, cells: Integers, price: float) -> tuple[float, list[Box]]:
    """Return (cost, boxes) of the cheapest cover of a box that some of the refined cells meet."""
    points, cells = _points(sides, box, cells)
    least = int(np.prod([side.axis.degree + 1 for side in sides]))
    if points + price <= 2 * (least + price):
        return points + price, [box]
    options = []
    for d, side in enumerate(sides):
        at = side.middle(*box[d])
        if at is not None:
            halves = [
                (part, box[1]) if d == 0 else (box[0], part) for part in ((box[d][0], at), (at, box[d][1]))
            ]
            options.append((sum(_points(sides, half, cells)[0] for half in halves), halves))
    if not options:
        return points + price, [box]
    _, halves = min(options, key=lambda option: option[0])
    parts = [_cheapest(sides, half, cells, price) for half in halves]
    cost = sum(part[0] for part in parts)
    return (
        (cost, [b for part in parts for b in part[1]]) if cost < points + price else (points + price, [box])
    )


def _points(sides: tuple[_Side, _Side], box: Box, cells: Integers) -> tuple[int, Integers]:
    """Return the control points of a face over a box, and the refined cells that meet it."""
    for side, ends in zip(sides, box):
        cells = side.meeting(*ends, cells)
    count = 1
    for side, ends in zip(sides, box):
        count *= side.axis.degree + 1 + len(side.needed(*ends, cells))
    return count, cells


def _face(sides: tuple[_Side, _Side], surface: BSplineSurface, box: Box) -> BSplineSurface:
    """Return the face over a box: the segment of the surface, without the knots that only others need."""
    _, cells = _points(sides, box, np.arange(len(sides[0].low)))
    vectors = [side.knot_vector(*ends, cells) for side, ends in zip(sides, box)]
    segments = [kv.segment(face.start, face.stop) for face, kv in zip(vectors, (surface.kv_u, surface.kv_v))]
    (_, by_u), (_, by_v) = segments
    net = tensor_apply(by_u, by_v, surface.coefficients)
    for face, (segment, _) in zip(vectors, segments):
        rows = banded_least_squares(face.prolongation(segment), face.degree, net.reshape(len(net), -1))
        net = np.moveaxis(rows.reshape(face.dim, *net.shape[1:]), 0, 1)
    kv_u, kv_v = vectors
    return BSplineSurface(kv_u, kv_v, net)
