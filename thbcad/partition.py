"""Partition of a set of grid cells into the least number of rectangles.

The least number is, for every connected component without and with holes,

    concave corners - largest set of disjoint chords - holes + 1,

where a chord is a grid segment inside the region between two concave corners.  The largest set
is the complement of a minimum vertex cover of the bipartite graph of crossing chords (Koenig).
Cutting along these chords, and once from every concave corner that is left, attains it.

Source: W. Lipski et al., Graph-theoretic algorithms for minimum rectangle partition (1979);
D. Eppstein, Graph-theoretic solutions to computational geometry problems (2009).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, maximum_bipartite_matching

Mask = NDArray[np.bool_]


def rectangles(mask: Mask) -> NDArray[np.int64]:
    """Return the fewest rectangles that tile the True cells, (n, 4) int [i0, i1, j0, j1), sorted."""
    if not mask.any():
        return np.zeros((0, 4), dtype=np.int64)
    corners = _concave(mask)
    along_i, along_j = _chords(mask, corners, 0), _chords(mask, corners, 1)
    cuts = _Cuts(mask)
    for axis, chosen in enumerate(_disjoint(along_i, along_j)):
        for line, start, stop in chosen:
            cuts.draw(axis, line, start, stop)
    for i, j in np.argwhere(corners):
        if not cuts.touch(i, j):
            cuts.extend(i, j)
    return cuts.rooms()


def _concave(mask: Mask) -> Mask:
    """Return the grid points (rows + 1, columns + 1) where exactly three of the four cells are in the set."""
    p = np.pad(mask, 1).astype(np.int8)
    return p[:-1, :-1] + p[1:, :-1] + p[:-1, 1:] + p[1:, 1:] == 3


def _chords(mask: Mask, corners: Mask, axis: int) -> list[tuple[int, int, int]]:
    """Return chords (line, start, stop) along an axis: between neighbouring concave corners, inside the set."""
    m, c = (mask, corners) if axis == 0 else (mask.T, corners.T)
    chords = []
    for line in range(1, m.shape[1]):
        ends = np.flatnonzero(c[:, line])
        if len(ends) < 2:
            continue
        inside = np.r_[0, np.cumsum(m[:, line - 1] & m[:, line])]
        for start, stop in zip(ends[:-1].tolist(), ends[1:].tolist()):
            if inside[stop] - inside[start] == stop - start:
                chords.append((line, start, stop))
    return chords


def _disjoint(along_i: list[tuple[int, int, int]], along_j: list[tuple[int, int, int]]) -> tuple[list, list]:
    """Return the largest sets of chords of both directions that neither cross nor touch."""
    if not along_i or not along_j:
        return along_i, along_j
    a, b = np.array(along_i), np.array(along_j)
    # a lies on j = line for i in [start, stop], b on i = line for j in [start, stop]
    meet = (a[:, 1, None] <= b[:, 0]) & (b[:, 0] <= a[:, 2, None]) & (b[:, 1] <= a[:, 0, None]) & (a[:, 0, None] <= b[:, 2])
    partner = maximum_bipartite_matching(csr_array(meet), perm_type="column")
    # Koenig: what alternating paths from the unmatched chords reach
    left = partner < 0
    owner = np.full(len(b), -1)
    owner[partner[~left]] = np.flatnonzero(~left)
    right = np.zeros(len(b), dtype=bool)
    while True:
        reached = meet[left].any(axis=0) & ~right
        if not reached.any():
            break
        right |= reached
        left[owner[reached]] = True
    return [c for c, keep in zip(along_i, left) if keep], [c for c, keep in zip(along_j, ~right) if keep]


class _Cuts:
    """Walls between cells: along axis 0 at a line j, and along axis 1 at a line i."""

    def __init__(self, mask: Mask) -> None:
        self._mask = np.pad(mask, 1)  # cell (i, j) is at [i + 1, j + 1]
        rows, columns = mask.shape
        self._walls = np.zeros((rows, columns + 1), dtype=bool), np.zeros((rows + 1, columns), dtype=bool)

    def draw(self, axis: int, line: int, start: int, stop: int) -> None:
        """Cut along `axis` at the given line, from grid point start to stop."""
        if axis == 0:
            self._walls[0][start:stop, line] = True
        else:
            self._walls[1][line, start:stop] = True

    def touch(self, i: int, j: int) -> bool:
        """Return whether a cut starts, ends or passes at a grid point inside."""
        w0, w1 = self._walls
        rows, columns = w0.shape[0], w1.shape[1]
        return bool((i > 0 and w0[i - 1, j]) or (i < rows and w0[i, j]) or (j > 0 and w1[i, j - 1]) or (j < columns and w1[i, j]))

    def extend(self, i: int, j: int) -> None:
        """Cut from a concave corner along axis 0 until the border or another cut."""
        m, (w0, w1) = self._mask, self._walls
        # the missing cell lies on one side in i; the cut goes to the other
        forward = not (m[i, j] and m[i, j + 1])
        while True:
            cell = i if forward else i - 1
            if not (0 <= cell < w0.shape[0] and m[cell + 1, j] and m[cell + 1, j + 1]):
                return
            w0[cell, j] = True
            i += 1 if forward else -1
            if w1[i, j - 1] or w1[i, j]:
                return

    def rooms(self) -> NDArray[np.int64]:
        """Return the rectangles between the walls."""
        m = self._mask[1:-1, 1:-1]
        number = np.arange(m.size).reshape(m.shape)
        ok_i = m[:-1] & m[1:] & ~self._walls[1][1:-1]
        ok_j = m[:, :-1] & m[:, 1:] & ~self._walls[0][:, 1:-1]
        a = np.r_[number[:-1][ok_i], number[:, :-1][ok_j]]
        b = np.r_[number[1:][ok_i], number[:, 1:][ok_j]]
        graph = csr_array((np.ones(len(a), dtype=bool), (a, b)), shape=(m.size, m.size))
        label = connected_components(graph, directed=False)[1].reshape(m.shape)
        i, j = np.nonzero(m)
        _, first, inverse = np.unique(label[m], return_index=True, return_inverse=True)
        last = np.zeros(len(first), dtype=np.int64)
        np.maximum.at(last, inverse, np.arange(len(i)))  # cells run row by row: first and last are opposite corners
        found = np.stack([i[first], i[last] + 1, j[first], j[last] + 1], axis=1)
        return found[np.lexsort((found[:, 2], found[:, 0]))]
