"""The points of a curve or surface that are closest to given ones: Newton's steps inside a search that misses
nothing.

A Bezier cell has homogeneous Bernstein coefficients (w_k P_k, w_k).  For a point x,

    |S - x|^2 = |w S - w x|^2 / w^2 >= min_k a_k / b_k,

where a_k and b_k are the Bernstein coefficients of |w S - w x|^2 and of w^2, of twice the degrees.  Cells
whose bound is not less than the best distance so far, less the tolerance, are left out; others are halved.

Source: X.-D. Chen et al., Computing the minimum distance between a point and a NURBS curve, CAD 40 (2008).
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import comb

import numpy as np

from thbcad.checks import EPS, Floats, Integers, require_number
from thbcad.splines.polar_forms import halves

MOST_CELLS = 4096  # for one point
MOST_PAIRS = 2**18  # of points and cells at once
ROUNDS = 50  # halvings: then cells are as short as float64 tells apart
POLISH = 6  # Newton's steps at the end: each doubles the digits, once there are some
TOLERANCE = 1e-9  # of the greatest extent, where none is given

# parameters (n, k) and orders of a derivative (k,) -> (n, d)
Evaluation = Callable[[Floats, tuple[int, ...]], Floats]


@dataclass(frozen=True, eq=False)
class ClosestPoints:
    """Points of a spline closest to n points, or to one: no point of it is nearer than distances - errors.

    That is proven, but for rounding.  Where the spline comes as near in several places, it is one of them.

    parameters : (n,) of a curve, (n, 2) of a surface.  points : (n, d).  distances : (n,).  One point: no n.
    errors : (n,), the tolerance; more where more than 4096 cells are as near but for it, as round the centre
        of a circle that is approximated.
    """

    parameters: Floats
    points: Floats
    distances: Floats
    errors: Floats


def closest_points(
    evaluate: Evaluation, nets: Floats, ends: Floats, x: Floats, tolerance: float | None
) -> ClosestPoints:
    """Return the closest points of a spline by its Bezier cells.

    nets : (m, p + 1, q + 1, d + 1), homogeneous, q = 0 of a curve.  ends : (m, 2, k), in the k parameters.
    """
    d = nets.shape[-1] - 1
    if x.ndim != 2 or x.shape[1] != d or not np.isfinite(x).all():
        raise ValueError(f"points must be finite and have shape (n, {d}), got shape {x.shape}")
    poles = nets[..., :-1] / nets[..., -1:]
    hulls = poles.min(axis=(1, 2)), poles.max(axis=(1, 2))
    if tolerance is None:
        tolerance = TOLERANCE * float((hulls[1].max(axis=0) - hulls[0].min(axis=0)).max())
    require_number("tolerance", tolerance, least=0)
    step = max(1, MOST_PAIRS // len(nets))
    parts = [
        _search(evaluate, nets, ends, hulls, x[first : first + step], tolerance)
        for first in range(0, max(len(x), 1), step)
    ]
    at, distances, errors = (np.concatenate(rows) for rows in zip(*parts))
    found = evaluate(at, (0,) * at.shape[1])
    return ClosestPoints(at[:, 0] if at.shape[1] == 1 else at, found, distances, errors)


def _search(
    evaluate: Evaluation,
    nets: Floats,
    ends: Floats,
    hulls: tuple[Floats, Floats],
    x: Floats,
    tolerance: float,
) -> tuple[Floats, Floats, Floats]:
    """Return the parameters, the distances and their errors."""
    domain, middles = (ends[:, 0].min(axis=0), ends[:, 1].max(axis=0)), ends.mean(axis=1)
    offsets = evaluate(middles, (0,) * ends.shape[2]) - x[:, None]
    at, distance = _stepped(evaluate, x, middles[np.linalg.norm(offsets, axis=2).argmin(axis=1)], domain)
    beside = np.maximum(np.maximum(hulls[0] - x[:, None], x[:, None] - hulls[1]), 0)
    owner, which = np.nonzero(np.linalg.norm(beside, axis=2) < distance[:, None] - tolerance)
    nets, ends, least = nets[which], ends[which], np.full(len(x), np.inf)
    for number in range(ROUNDS):
        if not len(owner):
            break
        at, distance = _best(evaluate, x, at, distance, owner, ends.mean(axis=1))
        at, distance = _stepped(evaluate, x, at, domain)
        weights = nets[..., -1:]
        squares = _square(nets[..., :-1] - weights * x[owner][:, None, None]) / _square(weights)
        bounds = np.sqrt(np.maximum(squares.min(axis=(1, 2)), 0))
        near = bounds < (distance - tolerance)[owner]
        left = np.bincount(owner[near], minlength=len(x)) > (MOST_CELLS if number < ROUNDS - 1 else 0)
        np.minimum.at(least, owner[near & left[owner]], bounds[near & left[owner]])
        kept = near & ~left[owner]
        nets, ends = _halved(nets[kept], ends[kept])
        owner = np.tile(owner[kept], 2 ** ends.shape[2])
    for _ in range(POLISH):
        at, distance = _stepped(evaluate, x, at, domain)
    return at, distance, np.maximum(tolerance, distance - least)


def _halved(nets: Floats, ends: Floats) -> tuple[Floats, Floats]:
    """Return the halves of cells in every parameter, all lower ones of a direction first."""
    for k in range(ends.shape[2]):
        both = (np.tensordot(half, nets, (1, k + 1)) for half in halves(nets.shape[k + 1] - 1))
        low, high = ends.copy(), ends.copy()
        low[:, 1, k] = high[:, 0, k] = ends[:, :, k].mean(axis=1)
        nets = np.concatenate([np.moveaxis(half, 0, k + 1) for half in both])
        ends = np.concatenate([low, high])
    return nets, ends


def _best(
    evaluate: Evaluation, x: Floats, at: Floats, distance: Floats, owner: Integers, tried: Floats
) -> tuple[Floats, Floats]:
    """Return the best parameters and distances, of the points `owner` those tried included."""
    found = np.linalg.norm(evaluate(tried, (0,) * tried.shape[1]) - x[owner], axis=1)
    order = np.lexsort((found, owner))
    first = order[np.unique(owner[order], return_index=True)[1]]
    first = first[found[first] < distance[owner[first]]]
    at, distance = at.copy(), distance.copy()
    at[owner[first]], distance[owner[first]] = tried[first], found[first]
    return at, distance


def _stepped(
    evaluate: Evaluation, x: Floats, at: Floats, domain: tuple[Floats, Floats]
) -> tuple[Floats, Floats]:
    """Return parameters and distances after a step of Newton's method for |S - x|^2, if that is no farther.

    Where the step leaves the domain and fails, the parameters that it takes to the end go there alone; at an
    end they stay where the distance falls outwards.  Negative eigenvalues of second derivatives change sign.
    """
    n, k = at.shape
    unit = np.eye(k, dtype=int)
    offset = evaluate(at, (0,) * k) - x
    first = np.stack([evaluate(at, tuple(a.tolist())) for a in unit], axis=1)
    second = np.stack([[evaluate(at, tuple((a + b).tolist())) for a in unit] for b in unit])
    gradient = np.einsum("nkd,nd->nk", first, offset)
    hessian = np.einsum("nkd,nld->nkl", first, first) + np.einsum("klnd,nd->nkl", second, offset)
    free = ~((at <= domain[0]) & (gradient > 0) | (at >= domain[1]) & (gradient < 0))
    hessian *= free[:, :, None] & free[:, None, :]
    values, vectors = np.linalg.eigh(hessian)
    slopes = np.einsum("nkl,nk->nl", vectors, gradient * free)
    sizes = np.abs(values)
    steps = np.divide(slopes, sizes, out=np.zeros((n, k)), where=sizes > EPS * sizes.max(axis=1)[:, None])
    free_step = at - np.einsum("nkl,nl->nk", vectors, steps)
    moved = np.clip(free_step, *domain)
    distance = np.linalg.norm(offset, axis=1)
    for needed in (True, moved != free_step):  # where the whole step is taken, the second one is the same
        tried = np.where(needed, moved, at)
        other = np.linalg.norm(evaluate(tried, (0,) * k) - x, axis=1)
        nearer = other <= distance + 4 * EPS * np.abs(x).max(axis=1)
        at, distance = np.where(nearer[:, None], tried, at), np.where(nearer, other, distance)
    return at, distance


def _square(net: Floats) -> Floats:
    """Return the Bernstein coefficients of |f|^2, (m, p + 1, q + 1, d) -> (m, 2 p + 1, 2 q + 1)."""
    (p, q), rows = (n - 1 for n in net.shape[1:3]), [[comb(n, i) for i in range(n + 1)] for n in range(21)]
    scaled = net * np.outer(rows[p], rows[q])[:, :, None]
    out = np.zeros((len(net), 2 * p + 1, 2 * q + 1))
    for i in range(p + 1):
        for j in range(q + 1):
            out[:, i : i + p + 1, j : j + q + 1] += np.einsum("md,mpqd->mpq", scaled[:, i, j], scaled)
    squares: Floats = out / np.outer(rows[2 * p], rows[2 * q])
    return squares
