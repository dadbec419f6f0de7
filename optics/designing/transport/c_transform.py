"""c-transforms of potentials on grids: lower envelopes of parabolas, exact but for rounding.

    phi^c(x) = min_y |x - y|^2 / 2 - phi(y)      over the cell centres y of a grid, at the same centres x

The squared distance is a sum over the directions, so the minimum is taken along x and then along y.  In one
direction it is the lower envelope of the parabolas (k - j)^2 / 2 - f_j.  One pass finds the parabolas that
take part and where each begins to be the lowest; a second pass evaluates them.  Both are linear in the cells.

Source: P. Felzenszwalb, D. Huttenlocher, Distance transforms of sampled functions, Theory of Computing 8
(2012); M. Jacobs, F. Leger, A fast approach to optimal transport: the back-and-forth method, Numerische
Mathematik 146 (2020).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from optics.base.runtime import Backend, DrArray
from thbcad.checks import Floats

ROOM = 512  # parabolas that one compiled kernel has room for; longer rows compile another one


def c_transform(backend: Backend, phi: Floats, spacing: Sequence[float]) -> Floats:
    """Return phi^c, (nx, ny).

    phi : (nx, ny), on the centres of cells.  spacing : width and height of a cell, in the unit whose square
        is that of phi.
    """
    (nx, ny), (hx, hy) = phi.shape, spacing
    along_x = _envelopes(backend, backend.array(phi.ravel()), hx**2, (nx, ny), (ny, 1))
    both = _envelopes(backend, along_x, -(hy**2), (ny, nx), (1, ny))
    return np.asarray(both.numpy().reshape(nx, ny), dtype=np.float64)


def _envelopes(
    backend: Backend, f: DrArray, unit: float, counts: tuple[int, int], strides: tuple[int, int]
) -> DrArray:
    """Return g_k = min_j |unit| (k - j)^2 / 2 - f_j of every row of f; with unit < 0 of -f_j for f_j.

    f, g : flat.  counts : in a row, and of rows.  strides : from a value to the next, and from row to row.
    """
    dr, Float, Index = backend.dr, backend.Float, backend.Index
    n, columns = counts
    # sizes are opaque, so that every grid runs the same compiled kernel
    count, stride, apart = (dr.opaque(Index, k) for k in (n, *strides))
    size, scale = backend.opaque(unit), backend.opaque(abs(unit))
    column = dr.arange(Index, columns) * apart

    def value(j: DrArray) -> DrArray:
        return dr.gather(Float, f, j * stride + column) / size

    room = max(ROOM, n)
    members = dr.alloc_local(Index, room, value=Index(0))  # parabolas of the envelope, from left to right
    begins = dr.alloc_local(Float, room, value=Float(-np.inf))  # where they begin to be the lowest

    def add(
        j: DrArray, top: DrArray, b: DrArray, fb: DrArray, members: DrArray, begins: DrArray
    ) -> tuple[DrArray, ...]:
        """Add parabola j behind the last one, b, or take b away where j lies below all of its piece."""
        fj = value(j)
        crossing = 0.5 * (Float(j) + Float(b)) - (fj - fb) / (Float(j) - Float(b))
        hidden = crossing <= begins[top]
        at = dr.select(hidden, top - 1, top + 1)
        last = dr.select(hidden, members[at], j)
        members[at] = last
        begins[at] = dr.select(hidden, begins[at], crossing)
        return dr.select(hidden, j, j + 1), at, last, dr.select(hidden, value(last), fj), members, begins

    zero = dr.zeros(Index, columns)
    _, top, _, _, members, begins = dr.while_loop(
        (zero + 1, zero, zero, value(zero), members, begins),
        lambda j, *_: j < count,
        add,
        mode="symbolic",
    )
    out = dr.zeros(Float, n * columns)

    def put(
        k: DrArray, i: DrArray, b: DrArray, fb: DrArray, members: DrArray, begins: DrArray
    ) -> tuple[DrArray, ...]:
        """Write the minimum at k, or go on to the next parabola where it has begun."""
        following = dr.minimum(i + 1, top)
        passed = (i < top) & (begins[following] < Float(k))
        lowest = 0.5 * dr.square(Float(k) - Float(b)) - fb
        dr.scatter(out, lowest * scale, k * stride + column, ~passed)
        i = dr.select(passed, following, i)
        b = dr.select(passed, members[i], b)
        return dr.select(passed, k, k + 1), i, b, dr.select(passed, value(b), fb), members, begins

    ended = dr.while_loop(
        (zero, zero, zero + members[zero], value(members[zero]), members, begins),
        lambda k, *_: k < count,
        put,
        mode="symbolic",
    )
    dr.eval(out, ended[0])
    return out
