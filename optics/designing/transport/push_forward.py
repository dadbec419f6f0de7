"""Light carried by the map of a potential: t(x) = x - grad psi(x), of which every drop is kept."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np

from optics.base.runtime import Backend, DrArray, OrderFreeSums
from thbcad.checks import Floats

SAMPLES = 2  # of a cell in each direction: one leaves stripes where the map stretches, four change nothing


def push_forward(backend: Backend, psi: Floats, light: Floats, spacing: Sequence[float]) -> Floats:
    """Return the light that t = x - grad psi carries to every cell of the same grid, (nx, ny).

    The map is bilinear between the corners of the cells, and keeps the border on the border.  A cell's light
    goes in SAMPLES x SAMPLES equal parts to where the map sends them.  Each part is shared by the four cells
    whose centres are around it.

    psi, light : (nx, ny).  spacing : width and height of a cell, in the unit whose square is that of psi.
    """
    dr, Float, Index = backend.dr, backend.Float, backend.Index
    nx, ny = psi.shape
    potential, part = backend.array(np.pad(psi, 1, mode="edge")), backend.array(light / SAMPLES**2)
    # sizes are opaque, so that every grid runs the same compiled kernel
    columns, stride = dr.opaque(Index, ny), dr.opaque(Index, ny + 2)
    most = [backend.opaque(n - 1.0) for n in (nx, ny)]
    scale = [backend.opaque(0.5 / h**2) for h in spacing]
    cell = dr.arange(Index, nx * ny)
    i = cell // columns
    j = cell - i * columns
    p = [[dr.gather(Float, potential, (i + a) * stride + j + b) for b in range(3)] for a in range(3)]
    corners = list(product(range(2), range(2)))
    # how far the corners are displaced, in cells
    dx = [(p[a][b] + p[a][b + 1] - p[a + 1][b] - p[a + 1][b + 1]) * scale[0] for a, b in corners]
    dy = [(p[a][b] + p[a + 1][b] - p[a][b + 1] - p[a + 1][b + 1]) * scale[1] for a, b in corners]
    # parts of the cells (k, m), (k, m + 1), (k + 1, m), (k + 1, m + 1)
    quads = OrderFreeSums(backend, 4 * nx * ny, most=float(np.abs(light).sum()))
    middles = [(s + 0.5) / SAMPLES for s in range(SAMPLES)]
    for u, v in product(middles, middles):
        shares = ((1 - u) * (1 - v), (1 - u) * v, u * (1 - v), u * v)
        x = dr.clip(Float(i) + (u - 0.5) + _weighted(shares, dx), 0, most[0])
        y = dr.clip(Float(j) + (v - 0.5) + _weighted(shares, dy), 0, most[1])
        k, m = Index(x), Index(y)
        wx, wy = x - Float(k), y - Float(m)
        low, high = part * (1 - wx), part * wx
        parts = low * (1 - wy), low * wy, high * (1 - wy), high * wy
        quads.add(parts, k * columns + m)
    four = quads.values().numpy().reshape(nx, ny, 4)
    out = four[:, :, 0].copy()  # nothing lies past the border
    out[:, 1:] += four[:, :-1, 1]
    out[1:] += four[:-1, :, 2]
    out[1:, 1:] += four[:-1, :-1, 3]
    return out


def _weighted(weights: Sequence[float], values: Sequence[DrArray]) -> DrArray:
    a, b, c, d = (w * v for w, v in zip(weights, values))
    return a + b + (c + d)
