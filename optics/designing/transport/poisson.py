"""Poisson's equation on a rectangle by cosine transforms, and heights from slopes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.fft import dctn, idctn

from thbcad.checks import Floats


def solved_poisson(density: Floats, spacing: Sequence[float]) -> Floats:
    """Return the potential u of mean 0 with -Laplace u = density less its mean.

    It has no slope across the border.  The Laplacian is that of five points, whose eigenvectors are cosines.

    density, u : (nx, ny), on the centres of cells.  spacing : width and height of a cell.
    """
    spectrum = np.add.outer(
        *((2 - 2 * np.cos(np.pi * np.arange(n) / n)) / h**2 for n, h in zip(density.shape, spacing))
    )
    spectrum[0, 0] = 1.0
    transformed = dctn(density) / spectrum
    transformed[0, 0] = 0.0
    return np.asarray(idctn(transformed, overwrite_x=True), dtype=np.float64)


def height_from_slopes(zx: Floats, zy: Floats, spacing: Sequence[float]) -> Floats:
    """Return the height of mean 0 whose differences fit slopes best, (nx, ny).

        sum ((z[i+1, j] - z[i, j]) / hx - mean of zx there)^2 + the same along y  ->  min

    The normal equations are Poisson's.  Where slopes are no gradient, as along the cracks of a transport map,
    no path is preferred.

    zx, zy : (nx, ny), on the centres of cells.  spacing : (hx, hy).
    """
    hx, hy = spacing
    source = np.zeros(zx.shape)
    across = (zx[1:] + zx[:-1]) / (2 * hx)
    source[1:] += across
    source[:-1] -= across
    along = (zy[:, 1:] + zy[:, :-1]) / (2 * hy)
    source[:, 1:] += along
    source[:, :-1] -= along
    return solved_poisson(source, spacing)
