"""Sparse operators on coefficients: how they are stored, applied to nets, and inverted in least squares."""

import numpy as np
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.sparse import csr_array

from thbcad.checks import Floats, Integers


def csr_rows(values: Floats, indices: Integers, columns: int) -> csr_array:
    """Return the csr_array with the same number of entries in every row; both arrays are (n, ...).

    Small matrices get 32-bit indices, which makes products with them faster.
    """
    n = len(values)
    width = values.size // n if n else 1
    dtype = np.int32 if max(columns, values.size) < np.iinfo(np.int32).max else np.int64
    indptr = np.arange(n + 1, dtype=dtype) * width
    return csr_array((values.ravel(), indices.ravel().astype(dtype), indptr), shape=(n, columns))


def band_matrix(first: Integers, values: Floats, columns: int) -> csr_array:
    """Return the csr_array whose row r holds `values[r]` from column `first[r]` on."""
    return csr_rows(values, first[:, None] + np.arange(values.shape[1]), columns)


def apply_along(direction: int, operator: csr_array, net: Floats) -> Floats:
    """Return the net (n_u, ...) or (n_u, n_v, ...) after a linear map along direction 0 or 1."""
    rows = net.swapaxes(0, direction)
    mapped = operator @ rows.reshape(len(rows), -1)
    result: Floats = mapped.reshape(len(mapped), *rows.shape[1:]).swapaxes(0, direction)
    return result


def tensor_apply(a: csr_array, b: csr_array, net: Floats) -> Floats:
    """Return a @ net @ b.T, for every component of a net (n_u, n_v) or (n_u, n_v, d)."""
    return apply_along(1, b, apply_along(0, a, net))


def banded_least_squares(p: csr_array, degree: int, net: Floats) -> Floats:
    """Return the d of least |net - P d|, for net (n, m).

    Banded normal equations, corrected once: cond P grows like 2^p only, so that this is as accurate as QR.
    """
    gram = (p.T @ p).tocoo()
    lower = gram.row >= gram.col
    band = np.zeros((degree + 1, p.shape[1]))
    band[(gram.row - gram.col)[lower], gram.col[lower]] = gram.data[lower]
    factor = cholesky_banded(band, lower=True), True
    d = cho_solve_banded(factor, p.T @ net)
    result: Floats = d + cho_solve_banded(factor, p.T @ (net - p @ d))
    return result
