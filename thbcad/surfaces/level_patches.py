"""Exact B-spline patches of a THB surface: rectangles of cells of one level.

On its leaf cells a THB spline of level l is an ordinary spline of that level.  The leaf cells of
every level are tiled with the fewest rectangles; the coefficients of a patch are polar forms at
its knots, so that nothing is fitted.

Partition: the least number of rectangles is, for every connected component without and with holes,

    concave corners - largest set of disjoint chords - holes + 1,

where a chord is a grid segment inside the region between two concave corners.  The largest set
is the complement of a minimum vertex cover of the bipartite graph of crossing chords (Koenig).
Cutting along these chords, and once from every concave corner that is left, attains it.

Source: W. Lipski et al., Graph-theoretic algorithms for minimum rectangle partition (1979);
D. Eppstein, Graph-theoretic solutions to computational geometry problems (2009).
"""

from collections.abc import Iterator

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, maximum_bipartite_matching

from thbcad.checks import Bools, Floats, Integers
from thbcad.hierarchy import DyadicAxis, THBSpace
from thbcad.splines import KnotVector, band_matrix, blossom, tensor_apply


def rectangles(cells: Integers) -> Integers:
    """Return the fewest rectangles that tile a set of cells, (m, 4) int [i0, i1, j0, j1), sorted.

    cells : (n, 2) int, different cells (i, j) in order of i, then j; they may lie anywhere.
    """
    if len(cells) == 0:
        return np.zeros((0, 4), dtype=np.int64)
    region = _Region(cells)
    corners = region.concave_corners()
    chords = [_chords(corners, region.inner_edges[axis], axis) for axis in (0, 1)]
    cuts = _Cuts(region)
    for axis, keep in enumerate(_disjoint(*chords)):
        for line, start, stop in chords[axis][keep].tolist():
            cuts.draw(axis, line, start, stop)
    for i, j in corners.tolist():
        if not cuts.touch(i, j):
            cuts.extend(i, j)
    return cuts.rooms()


class _Region:
    """Cells as sorted keys i width + j, and the edges between neighbouring cells.

    A grid point (i, j) is the corner of the cell (i, j) with the least i and j.
    inner_edges : per axis, the edges along it inside the region, (k, 2) int: the point at which they start
    """

    def __init__(self, cells: Integers) -> None:
        self.cells = cells
        self.origin = cells.min(axis=0) - 1
        i, j = (cells - self.origin).T
        self.width = int(j.max()) + 2
        self.keys = i * self.width + j
        before_j, before_i = (np.isin(self.keys - step, self.keys) for step in (1, self.width))
        self.inner_edges = tuple(np.stack([i[here], j[here]], axis=1) for here in (before_j, before_i))

    def concave_corners(self) -> Integers:
        """Return the grid points where exactly three of the four cells are in the region, (k, 2) int."""
        around = self.keys[:, None] + [0, 1, self.width, self.width + 1]
        points, count = np.unique(around, return_counts=True)
        return np.stack(np.divmod(points[count == 3], self.width), axis=1)


def _chords(corners: Integers, edges: Integers, axis: int) -> Integers:
    """Return chords along an axis, between neighbouring concave corners and inside the region, (k, 3) int
    [line, start, stop]."""
    line = corners[:, 1 - axis]
    position = corners[:, axis]
    order = np.lexsort((position, line))
    line = line[order]
    position = position[order]
    same = line[1:] == line[:-1]
    line = line[1:][same]
    start = position[:-1][same]
    stop = position[1:][same]
    length = max(int(edges[:, axis].max(initial=0)), int(stop.max(initial=0))) + 1
    inside = np.sort(edges[:, 1 - axis] * length + edges[:, axis])
    count = np.searchsorted(inside, line * length + stop) - np.searchsorted(inside, line * length + start)
    result: Integers = np.stack([line, start, stop], axis=1)[count == stop - start]
    return result


def _disjoint(along_i: Integers, along_j: Integers) -> tuple[Bools, Bools]:
    """Return which chords of both directions form a largest set that neither crosses nor touches."""
    meet = _meetings(along_i, along_j)
    left, right = np.ones(len(along_i), dtype=bool), np.zeros(len(along_j), dtype=bool)
    if meet.nnz == 0:
        return left, ~right
    partner = maximum_bipartite_matching(meet, perm_type="column")
    # Koenig: what alternating paths from the unmatched chords lead to
    left = partner < 0
    owner = np.full(len(along_j), -1)
    owner[partner[~left]] = np.flatnonzero(~left)
    while True:
        reached = (left @ meet > 0) & ~right
        if not reached.any():
            return left, ~right
        right |= reached
        left[owner[reached]] = True


def _meetings(along_i: Integers, along_j: Integers) -> csr_array:
    """Return which chords (j = line, i in [start, stop]) meet which chords (i = line, j in [start, stop]),
    csr_array of counts."""
    order = np.argsort(along_j[:, 0], kind="stable")
    lines, low, high = along_j[order].T
    first, last = np.searchsorted(lines, along_i[:, 1]), np.searchsorted(lines, along_i[:, 2], side="right")
    row = np.repeat(np.arange(len(along_i)), last - first)
    column = np.arange(len(row)) - np.repeat(np.cumsum(last - first) - last, last - first)
    line = along_i[row, 0]
    meet = (low[column] <= line) & (line <= high[column])
    entries = np.ones(int(meet.sum()), dtype=np.int64), (row[meet], order[column[meet]])
    return csr_array(entries, shape=(len(along_i), len(along_j)))


class _Cuts:
    """Walls along the edges of a region: per axis, the keys of the points at which walled edges start."""

    def __init__(self, region: _Region) -> None:
        self._region = region
        self._width = region.width
        self._cells = set(region.keys.tolist())
        self._walls: tuple[set[int], set[int]] = (set(), set())

    def draw(self, axis: int, line: int, start: int, stop: int) -> None:
        """Cut along `axis` at the given line, from grid point start to stop."""
        if axis == 0:
            self._walls[0].update(range(start * self._width + line, stop * self._width + line, self._width))
        else:
            self._walls[1].update(range(line * self._width + start, line * self._width + stop))

    def touch(self, i: int, j: int) -> bool:
        """Return whether a cut starts, ends or passes at a grid point."""
        at = i * self._width + j
        return (
            at in self._walls[0]
            or at - self._width in self._walls[0]
            or at in self._walls[1]
            or at - 1 in self._walls[1]
        )

    def extend(self, i: int, j: int) -> None:
        """Cut from a concave corner along axis 0 until the border or another cut."""
        cells, (along_i, along_j), width = self._cells, self._walls, self._width
        at = i * width + j
        # the missing cell lies on one side in i; the cut goes to the other
        forward = not (at - width in cells and at - width - 1 in cells)
        while True:
            edge = at if forward else at - width
            if not (edge in cells and edge - 1 in cells):
                return
            along_i.add(edge)
            at += width if forward else -width
            if at in along_j or at - 1 in along_j:
                return

    def rooms(self) -> Integers:
        """Return the rectangles between the walls."""
        region = self._region
        keys = self._region.keys
        pairs = []
        for edges, walls, step in zip(region.inner_edges, self._walls, (1, self._width)):
            sides = edges @ np.array([self._width, 1])
            free = sides[~np.isin(sides, np.fromiter(walls, dtype=np.int64, count=len(walls)))]
            pairs.append(np.searchsorted(keys, np.stack([free - step, free])))
        a, b = np.concatenate(pairs, axis=1)
        graph = csr_array((np.ones(len(a), dtype=bool), (a, b)), shape=(len(keys), len(keys)))
        _, label = connected_components(graph, directed=False)
        _, first = np.unique(label, return_index=True)
        last = len(keys) - 1 - np.unique(label[::-1], return_index=True)[1]
        # cells run row by row: the first and the last of a room are opposite corners
        (i0, j0), (i1, j1) = region.cells[first].T, region.cells[last].T + 1
        return np.stack([i0, i1, j0, j1], axis=1)[np.lexsort((j0, i0))]


def cell_rectangles(space: THBSpace) -> Integers:
    """Return the fewest rectangles of same-level leaf cells, (n, 5) int [level, i0, i1, j0, j1)."""
    rows = []
    for level in space.hierarchy:
        boxes = rectangles(level.leaves)
        rows.append(np.column_stack([np.full(len(boxes), level.number), boxes]))
    return np.concatenate(rows)


def patches(space: THBSpace, coefficients: Floats) -> Iterator[tuple[KnotVector, KnotVector, Floats]]:
    """Yield (knot vector in u, knot vector in v, net) of every patch, nets (n_u, n_v, ...)."""
    nets = list(space.nets.coefficients(coefficients))
    known: dict[tuple[int, int, int, int], tuple[KnotVector, csr_array, Integers]] = {}
    for number, i0, i1, j0, j1 in cell_rectangles(space).tolist():
        level = space.hierarchy[number]
        sides = []
        for d, (start, stop) in enumerate(((i0, i1), (j0, j1))):
            key = number, d, start, stop
            if key not in known:
                known[key] = _side(level.axes[d], number, start, stop)
            sides.append(known[key])
        (kv_u, by_u, rows), (kv_v, by_v, columns) = sides
        at = level.find(np.stack(np.broadcast_arrays(rows[:, None], columns), axis=-1))
        yield kv_u, kv_v, tensor_apply(by_u, by_v, nets[number][at])


def _side(axis: DyadicAxis, level: int, start: int, stop: int) -> tuple[KnotVector, csr_array, Integers]:
    """Return the clamped knots of [start, stop), the operator to their coefficients and the functions it
    applies to."""
    p = axis.degree
    breaks = np.arange(start, stop + 1)
    count = axis.multiplicity(level, breaks)
    count[[0, -1]] = p + 1
    patch = KnotVector(p, np.repeat(axis.value(level, breaks), count))
    spans = np.repeat(breaks[:-1], count[:-1])
    first = axis.acting(level, spans)
    functions = np.arange(first[0], first[-1] + p + 1)
    weights = blossom(axis.knots_around(level, spans), patch.inner_knots())
    return patch, band_matrix(first - first[0], weights, len(functions)), functions
