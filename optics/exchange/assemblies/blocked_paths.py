"""Straight paths and what lies in their way: triangles in a tree of boxes, and figures of edges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from thbcad.checks import Bools, Floats, Integers

LEAF = 8  # triangles
ENDS = 1e-9  # of a path: its ends lie on faces


@dataclass(frozen=True, eq=False)
class _Node:
    """A box round triangles: two smaller ones, or the triangles of a leaf."""

    low: Floats
    high: Floats
    parts: tuple[_Node, _Node] | None
    triangles: Floats


class Obstacles:
    """Triangles that stop light.  triangles : (n, 3, 3), corners in mm."""

    def __init__(self, triangles: Floats) -> None:
        self._root = _node(triangles) if len(triangles) else None

    def stop(self, start: Floats, stop: Floats) -> Bools:
        """Return which of the straight paths (n, 3) to (n, 3) meet a triangle between their ends, (n,)."""
        met = np.zeros(len(start), dtype=bool)
        if self._root is not None:
            _search(self._root, start, stop - start, np.arange(len(start)), met)
        return met


def _node(triangles: Floats) -> _Node:
    low, high = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    if len(triangles) <= LEAF:
        return _Node(low, high, None, triangles)
    middles = triangles.mean(axis=1)
    order = np.argsort(middles[:, np.ptp(middles, axis=0).argmax()], kind="stable")
    half = len(order) // 2
    return _Node(low, high, (_node(triangles[order[:half]]), _node(triangles[order[half:]])), triangles[:0])


def _search(node: _Node, start: Floats, along: Floats, paths: Integers, met: Bools) -> None:
    """Mark the paths, by number, that meet a triangle below a node."""
    paths = paths[~met[paths]]
    origin, way = start[paths], along[paths]
    with np.errstate(divide="ignore", invalid="ignore"):
        a, b = ((end - origin) / way for end in (node.low, node.high))
    # a path in the plane of a side, 0 / 0, is inside as far as that side goes
    first = np.fmax.reduce(np.fmin(a, b), axis=1, initial=0.0)
    last = np.fmin.reduce(np.fmax(a, b), axis=1, initial=1.0)
    paths = paths[first <= last]
    if not len(paths):
        return
    if node.parts is None:
        met[paths] = _meets(start[paths], along[paths], node.triangles)
        return
    for part in node.parts:
        _search(part, start, along, paths, met)


def _meets(start: Floats, along: Floats, triangles: Floats) -> Bools:
    """Return which paths meet one of some triangles, by Moeller's and Trumbore's test.

    Source: T. Moeller, B. Trumbore, Journal of graphics tools 2 (1997) 21.
    """
    corner, one, other = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    across = np.cross(along[:, None], other)
    determinant = np.einsum("ntk,tk->nt", across, one)
    offset = start[:, None] - corner
    turned = np.cross(offset, one)
    with np.errstate(divide="ignore", invalid="ignore"):
        u = np.einsum("ntk,ntk->nt", offset, across) / determinant
        v = np.einsum("nk,ntk->nt", along, turned) / determinant
        t = np.einsum("tk,ntk->nt", other, turned) / determinant
        inside = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > ENDS) & (t < 1 - ENDS)
    return np.asarray(inside.any(axis=1))


def within_outline(points: Floats, outline: Floats) -> Bools:
    """Return which points (n, 2) lie within closed lines of segments, (m, 2, 2), by counting crossings."""
    order = np.argsort(points[:, 1], kind="stable")
    x, y = points[order].T
    odd = np.zeros(len(points), dtype=bool)
    low, high = outline[:, :, 1].min(axis=1), outline[:, :, 1].max(axis=1)
    first, last = np.searchsorted(y, low), np.searchsorted(y, high)
    for (start, stop), i, j in zip(outline, first.tolist(), last.tolist()):
        if i < j:
            share = (y[i:j] - start[1]) / (stop[1] - start[1])
            odd[i:j] ^= x[i:j] < start[0] + share * (stop[0] - start[0])
    result = np.empty_like(odd)
    result[order] = odd
    return result
