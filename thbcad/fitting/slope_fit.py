"""Surfaces from slopes: least squares in a THB space.

On a tensor-product mesh with knots in both directions, and even weights, the normal equations are

    (K_x C M_y + M_x C K_y) = R,    M = B^T B,  K = B'^T B',

with the collocation matrices B, B' of the samples in one direction.  The generalised eigenvectors
K V = M V diag(l), V^T M V = I of both directions solve them at once:

    C = V_x [ (V_x^T R V_y)_ij / (lx_i + ly_j) ] V_y^T.

Source: R. Lynch, J. Rice, D. Thomas, Direct solution of partial difference equations by tensor product
methods, Numer. Math. 6 (1964).

A THB space starts from the fits of its levels: a function of level l takes its coefficient from the fit of
that level (a quasi-interpolant: H. Speleers, C. Manni, Numer. Math. 132 (2016)).  What is left, there and for
uneven weights, a banded Cholesky factorisation solves on small tensor-product meshes, conjugate gradients on
others.  They solve for the weights of a `MultilevelBasis`, preconditioned by the diagonal of their normal
equations, so that weights which differ a thousandfold cost few steps (multilevel diagonal scaling: X. Zhang,
Numer. Math. 63 (1992)).
"""

from collections.abc import Iterator

import numpy as np
from scipy.linalg import eigh, solveh_banded
from scipy.sparse import csc_array, csr_array
from scipy.sparse.linalg import LinearOperator, cg

from thbcad.checks import Bools, Floats, Integers
from thbcad.hierarchy import MultilevelBasis, THBSpace
from thbcad.splines import KnotVector
from thbcad.surfaces import THBSurface

DIRECT = 4000  # functions of a tensor-product mesh, at most: then a factorisation is quicker than steps
STEPS = 60  # of conjugate gradients, at most
# of the residual, relative to the right side: with 3e-4 a mirror before a disk of light ends at a rel_l2 of
# 3.6 %, from 1e-4 on of 0.3 %; what a start tells of the losses of another place needs 1e-5
TOLERANCE = 1e-5
EXTENSION = 1e-4  # of the mean square of samples: weight of the polygon's bends where samples lack
# Greatest ratio of functions and samples in a direction: from 0.88 on slopes at samples leave nearly open how
# the coefficients alternate (a sag of 6 mm then had coefficients of 35 mm).
DENSEST = 0.85
SEEN = 1e-3  # of the greatest square sum of samples: what determines a function
IN_CORNERS = 0.05  # the same for functions there, of which the product of two such shares counts
# Charge for the squares of the corrections, relative to the stiffness of one function: those beside the
# samples hardly count in the fit, and grow with every step without it.
HELD = 1e-5
CONSTANT = 1e-12  # of the greatest eigenvalue: smaller ones belong to the constant, which slopes leave open


def fit_slopes(space: THBSpace, x: Floats, y: Floats, zx: Floats, zy: Floats, weight: Floats) -> THBSurface:
    """Return the THB surface over x, y in mm whose slopes fit (zx, zy) on a grid best.

    weight : (nx, ny), of the squares.  Beyond the samples the surface goes on straight.
    The constant that slopes leave open is chosen so that the greatest and the least coefficient among the
    samples (`seen_functions`) are opposite.
    """
    embedding = space.embedding
    (a0, a1), (b0, b1) = (
        (kv.collocation(s), kv.collocation(s, 1)) for kv, s in ((embedding.kv_u, x), (embedding.kv_v, y))
    )
    a0t, a1t, b0t, b1t = (m.T.tocsr() for m in (a0, a1, b0, b1))
    held = HELD * float(weight.mean()) / ((x[1] - x[0]) * (y[1] - y[0]))

    def transposed(gx: Floats, gy: Floats) -> Floats:
        net = b0t @ (a1t @ gx).T + b1t @ (a0t @ gy).T
        return embedding.adjoint(net.T)

    def weighted(coefficients: Floats) -> tuple[Floats, Floats]:
        net = embedding.coefficients(coefficients)
        values, slopes = (np.ascontiguousarray((b @ net.T).T) for b in (b0, b1))
        return weight * (a1 @ values), weight * (a0 @ slopes)

    start = _level_fits(space, x, y, zx, zy)
    along, across = weighted(start)
    missing = transposed(weight * zx - along, weight * zy - across)
    if len(embedding.active[-1]) == space.dim <= DIRECT:
        normal = _normal_bands(embedding.kv_u, embedding.kv_v, x, y, weight)
        normal[0] += held
        c = start + solveh_banded(normal, missing, lower=True)
    else:
        basis = MultilevelBasis(space)
        right = basis.adjoint(missing)
        enough = TOLERANCE * float(np.linalg.norm(basis.adjoint(transposed(weight * zx, weight * zy))))
        system = LinearOperator(
            (basis.size, basis.size),
            matvec=lambda w: basis.adjoint(transposed(*weighted(basis.coefficients(w)))) + held * w,
            dtype=np.float64,
        )
        diagonal = basis.diagonal(_square_slopes(space, x, y, weight)) + held
        scaling = LinearOperator(system.shape, matvec=lambda w: w / diagonal, dtype=np.float64)
        weights, _ = cg(system, right, rtol=0.0, atol=enough, maxiter=STEPS, M=scaling)
        c = start + basis.coefficients(weights)
    seen = seen_functions(space, x, y)
    known = c[seen] if seen.any() else c
    return THBSurface(space, c - (known.max() + known.min()) / 2)


def _square_slopes(space: THBSpace, x: Floats, y: Floats, weight: Floats) -> Iterator[Floats]:
    """Yield the weighted sum of the squares of the slopes of every B-spline of each W_l, a net of W_l."""
    for number in range(space.levels):
        (a0, a1), (b0, b1) = (
            [kv.collocation(s, d).power(2).T.tocsr() for d in (0, 1)]
            for kv, s in zip(space.embedding.knots(number), (x, y))
        )
        yield (b0 @ (a1 @ weight).T + b1 @ (a0 @ weight).T).T


def _normal_bands(kv_u: KnotVector, kv_v: KnotVector, x: Floats, y: Floats, weight: Floats) -> Floats:
    """Return N_ij = sum of weight (grad B_i . grad B_j) of a tensor-product mesh, its lower bands.

    Returns (bandwidth + 1, dim), row d the d-th diagonal.  With the products of pairs of functions of one
    direction at its samples, N is two products of matrices.
    """
    (pairs_u, u), (pairs_v, v) = (_pairs(kv, s) for kv, s in ((kv_u, x), (kv_v, y)))
    products = u[1].T @ (v[0].T @ weight.T).T + u[0].T @ (v[1].T @ weight.T).T
    row, column = (i[:, None] * kv_v.dim + j for i, j in zip(pairs_u, pairs_v))
    below = row >= column
    bands = np.zeros((int((row - column).max()) + 1, kv_u.dim * kv_v.dim))
    bands[(row - column)[below], column[below]] = products[below]
    return bands


def _pairs(kv: KnotVector, samples: Floats) -> tuple[tuple[Integers, Integers], list[csc_array]]:
    """Return which B-splines meet, and the products of the values and of the slopes of each pair.

    Of the samples, csc_array (n, pairs) each.
    """
    count = np.arange(kv.dim)
    i, j = np.nonzero(abs(count[:, None] - count) <= kv.degree)
    both = (csc_array(kv.collocation(samples, d)) for d in (0, 1))
    return (i, j), [csc_array(m[:, i].multiply(m[:, j])) for m in both]


def level_misfits(
    space: THBSpace, x: Floats, y: Floats, zx: Floats, zy: Floats, weight: Floats, levels: int
) -> Floats:
    """Return the root mean square misfit of slopes on the whole mesh of each level, (levels or fewer,).

    weight : (nx, ny), of the squares in the mean.
    Levels with more functions than samples in a direction are left out: they would fit anything.
    """
    out: list[float] = []
    for kv_u, kv_v in _level_knots(space, levels):
        if out and (kv_u.dim > len(x) or kv_v.dim > len(y)):
            break
        net = _tensor_fit(kv_u, kv_v, x, y, zx, zy)
        (a0, a1), (b0, b1) = ((kv.collocation(s), kv.collocation(s, 1)) for kv, s in ((kv_u, x), (kv_v, y)))
        values, slopes = (np.ascontiguousarray((b @ net.T).T) for b in (b0, b1))
        square = np.average((a1 @ values - zx) ** 2 + (a0 @ slopes - zy) ** 2, weights=weight)
        out.append(float(np.sqrt(square)))
    return np.array(out)


def seen_functions(space: THBSpace, x: Floats, y: Floats) -> Bools:
    """Return which functions of a space the samples on a grid determine, (dim,).

    None are on levels with nearly as many functions as samples in a direction, or more.
    """
    level, i, j = space.functions.T
    out = np.zeros(space.dim, dtype=bool)
    for number, (kv_u, kv_v) in enumerate(_level_knots(space, space.levels)):
        of_level = level == number
        seen_u, seen_v = (_seen(kv.collocation(s)) for kv, s in ((kv_u, x), (kv_v, y)))
        out[of_level] = seen_u[i[of_level]] & seen_v[j[of_level]]
    return out


def _level_fits(space: THBSpace, x: Floats, y: Floats, zx: Floats, zy: Floats) -> Floats:
    """Return the coefficients of a space's functions in the fits of their levels, (dim,)."""
    level, i, j = space.functions.T
    out = np.zeros(space.dim)
    for number, (kv_u, kv_v) in enumerate(_level_knots(space, space.levels)):
        of_level = level == number
        if of_level.any():
            net = _tensor_fit(kv_u, kv_v, x, y, zx, zy)
            out[of_level] = net[i[of_level], j[of_level]]
    return out


def _level_knots(space: THBSpace, levels: int) -> Iterator[tuple[KnotVector, KnotVector]]:
    """Yield the knot vectors of whole levels, coarsest first."""
    kv_u, kv_v = space.kv_u, space.kv_v
    for _ in range(levels):
        yield kv_u, kv_v
        kv_u, kv_v = kv_u.bisect(), kv_v.bisect()


def _tensor_fit(kv_u: KnotVector, kv_v: KnotVector, x: Floats, y: Floats, zx: Floats, zy: Floats) -> Floats:
    """Return the net of the fit on a tensor-product mesh, its mean over the samples zero."""
    a0, a1, by_x, across = of_x = _modes(kv_u, x)
    alike = kv_u == kv_v and np.array_equal(x, y)
    b0, b1, by_y, along = of_x if alike else _modes(kv_v, y)
    right = (b0.T @ (a1.T @ zx).T + b1.T @ (a0.T @ zy).T).T
    stiffness = by_x[:, None] + by_y[None, :]
    stiffness[stiffness <= CONSTANT * stiffness.max()] = np.inf
    net = across @ ((across.T @ right @ along) / stiffness) @ along.T
    # in a corner beyond the samples only bends in one direction of the bends in the other are charged
    (beyond_u, on_u), (beyond_v, on_v) = (_straight_on(kv, a) for kv, a in ((kv_u, a0), (kv_v, b0)))
    net = np.where(np.outer(beyond_u, beyond_v), on_u @ net @ on_v.T, net)
    mean = float((a0 @ (b0 @ net.T).T).mean())
    return np.asarray(net - mean, dtype=np.float64)


def _modes(kv: KnotVector, samples: Floats) -> tuple[csr_array, csr_array, Floats, Floats]:
    """Return B, B', the eigenvalues and the eigenvectors of one direction.

    Functions that are not seen are tied to their neighbours by the bends of the control polygon.
    """
    values, slopes = kv.collocation(samples), kv.collocation(samples, 1)
    mass, stiffness = ((m.T @ m).toarray() for m in (values, slopes))
    n, seen = kv.dim, _seen(values)
    slope = np.diff(np.eye(n), axis=0) / np.diff(kv.greville())[:, None]  # of the control polygon
    differences = np.diff(slope, axis=0)[~(seen[:-2] & seen[1:-1] & seen[2:])]
    differences *= (kv.stop - kv.start) / n
    smooth = EXTENSION * (differences.T @ differences)
    mass += np.trace(mass) / n * smooth
    stiffness += np.trace(stiffness) / n * smooth
    return values, slopes, *eigh(stiffness, mass)


def _straight_on(kv: KnotVector, values: csr_array) -> tuple[Bools, Floats]:
    """Return which functions samples hardly reach, and the matrix that puts their coefficients on lines
    through those of the last two others."""
    places, out = kv.greville(), np.eye(kv.dim)
    known = np.flatnonzero(_seen(values, IN_CORNERS))
    beyond = np.zeros(kv.dim, dtype=bool)
    if len(known) < 2:
        return beyond, out
    for end, inner, others in (
        (known[0], known[1], slice(0, known[0])),
        (known[-1], known[-2], slice(known[-1] + 1, None)),
    ):
        beyond[others], out[others] = True, 0.0
        out[others, inner] = (places[others] - places[end]) / (places[inner] - places[end])
        out[others, end] = 1 - out[others, inner]
    return beyond, out


def _seen(values: csr_array, least: float = SEEN) -> Bools:
    squares = np.asarray(values.power(2).sum(axis=0), dtype=np.float64)
    enough = squares > least * squares.max()
    return enough if enough.sum() <= DENSEST * values.shape[0] else np.zeros_like(enough)
