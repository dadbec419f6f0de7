"""The smoothest light that keeps the rows of a table of zones, with the flux that there is.

    int f_xx^2 + 2 f_xy^2 + f_yy^2  ->  min,    f = sum c_ij B_i(u) B_j(v),    c >= 0

with cubic B-splines that vanish at the border of the target, and rows a f >= least (1 + margin) and a f <=
greatest (1 - margin).  Every row has a slack, and its misfit a weight: one problem of non-negative least
squares, which has a solution always.  What it still misses, rougher light may keep.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.sparse import csr_array, kron

from optics.scene.receivers.screen import Screen
from optics.scene.receivers.zones import ZoneRow
from thbcad.checks import Floats
from thbcad.splines import KnotVector

SPANS = 14  # over the narrower side: about the distance between the test points of headlamps
MOST_SPANS = 40
WEIGHT = 300.0  # of rows and flux, relative to the largest entry of the bending energy's root: 1e-3 is kept
MOST_PLACES = 64  # of a region: among pixels as dense as these light is smooth
PASSES = 3  # where limits depend on where the light is brightest
SYMMETRIC = 1e-6  # of the greatest light, to which rounding leaves symmetric light its own mirror image


def smoothest_light(screen: Screen, rows: Sequence[ZoneRow], flux: float) -> Floats:
    """Return the light on a screen, flux per area (rows, columns).  flux : on the whole screen."""
    narrow = 2 * min(screen.half_width) / SPANS
    counts = [
        max(2, min(round(2 * h / narrow), MOST_SPANS, n)) for h, n in zip(screen.half_width, screen.pixels)
    ]
    across, down = (KnotVector.uniform(3, n, -h, h) for n, h in zip(counts, screen.half_width))
    u, v = screen.centres
    to_pixels = csr_array(kron(_inner(down, v), _inner(across, u)))
    bending = _bending(down, across)
    arriving = (screen.projection().ravel() * screen.pixel_area / flux) @ to_pixels
    light = np.zeros(screen.shape)
    for _ in range(PASSES if any(row.brightest or row.least_of_peak for row in rows) else 1):
        limits = [limit for row in rows for limit in _limits(row, light)]
        if not limits:  # all depend on a peak: the first light is even
            light = np.full(screen.shape, flux / float((screen.projection() * screen.pixel_area).sum()))
            continue
        matrix = csr_array(np.vstack([reading for reading, _ in limits])) @ to_pixels
        signs = np.array([sign for _, sign in limits])
        light = (to_pixels @ _solved(bending, matrix.toarray(), signs, arriving)).reshape(screen.shape)
    for axis in (0, 1):
        mirrored = np.flip(light, axis)
        if np.abs(light - mirrored).max() <= SYMMETRIC * light.max():
            light = (light + mirrored) / 2
    return light


def _limits(row: ZoneRow, light: Floats) -> list[tuple[Floats, float]]:
    """Return (reading relative to the limit that is aimed at, -1 of a lower and 1 of an upper one).

    light : of the pass before, dark before the first: what depends on its peak is then left out.
    """
    least, greatest = row.aims(light)
    readings = row.readings[:: max(1, row.readings.shape[0] // MOST_PLACES)].toarray()
    found = [(reading / greatest, 1.0) for reading in readings] if greatest < np.inf else []
    if least and row.brightest:
        readings = row.readings[[int(np.argmax(row.readings @ light.ravel()))]].toarray()
        readings = readings[: int(light.any())]
    return found + [(reading / least, -1.0) for reading in readings if least]


def _solved(bending: Floats, matrix: Floats, signs: Floats, arriving: Floats) -> Floats:
    """Return the coefficients c >= 0 that bend least, with matrix @ c beyond 1 on the side of the signs.

    bending : a root R of the energy c' R' R c.  arriving : arriving @ c is to be 1.
    """
    from scipy.optimize import nnls

    scale = 1 / matrix.max()  # coefficients become numbers about 1
    functions, count = bending.shape[1], len(signs)
    system = np.block(
        [
            [bending / np.abs(bending).max(), np.zeros((len(bending), count))],
            [WEIGHT * scale * matrix, WEIGHT * np.diag(signs)],
            [WEIGHT * scale * arriving[None], np.zeros((1, count))],
        ]
    )
    wanted = np.concatenate([np.zeros(len(bending)), np.full(count + 1, WEIGHT)])
    found, _ = nnls(system, wanted, maxiter=20 * system.shape[1])
    return np.asarray(scale * found[:functions])


def _inner(kv: KnotVector, u: Floats, derivative: int = 0) -> csr_array:
    """Return the collocation matrix of the functions that vanish at both ends."""
    return kv.collocation(u, derivative)[:, 1:-1]


def _bending(down: KnotVector, across: KnotVector) -> Floats:
    """Return the root of the bending energy; a trace of int f^2 keeps it regular."""
    nodes, weights = np.polynomial.legendre.leggauss(4)

    def gram(kv: KnotVector, derivative: int) -> Floats:
        edges = np.unique(kv.knots)
        half = np.diff(edges)[:, None] / 2
        at = (edges[:-1, None] + half * (1 + nodes)).ravel()
        values = _inner(kv, at, derivative).toarray()
        return np.asarray(values.T @ (values * (half * weights).reshape(-1, 1)))

    (a0, a1, a2), (b0, b1, b2) = ([gram(kv, d) for d in range(3)] for kv in (down, across))
    energy = np.kron(a2, b0) + 2 * np.kron(a1, b1) + np.kron(a0, b2)
    mass = np.kron(a0, b0)
    mass *= 1e-9 * np.abs(energy).max() / np.abs(mass).max()
    return np.asarray(np.linalg.cholesky(energy + mass).T)
