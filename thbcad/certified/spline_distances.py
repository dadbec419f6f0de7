"""Bounds of the distance between two splines over one rectangle, on the cells of their common mesh.

Both are written with the knots and the degrees of both.  Their difference is then one spline, and on a cell
its distance from 0 is at most that of its Bernstein coefficients, vectors where the splines have values in
several dimensions.
"""

from collections.abc import Iterator

import numpy as np

from thbcad.certified.bernstein_cells import bernstein, roundings, tensor_form
from thbcad.certified.polynomial_cells import Cells, corners, rounding
from thbcad.checks import Floats
from thbcad.splines import BSplineSurface, tensor_apply
from thbcad.surfaces import THBSurface

QUARTERINGS = 3  # what the coefficients exceed the values by is then 64 times smaller
CLOSE = 1.1  # a bound this near a value is left as it is


def distance_bounds(
    surface: BSplineSurface | THBSurface, other: BSplineSurface | THBSurface, enough: float
) -> tuple[Floats, Floats]:
    """Return cells by a point (u, v) within each, (2, n), and bounds of |surface - other| on them, (n,),
    rounding included.

    The cells cover the rectangle of `surface`, on which `other` must lie too.  Bounds are improved where they
    exceed `enough` and no value nearby does.

    Raises ValueError : a rectangle of `other` that is smaller, splines of different dimensions, coefficients
        above 1e40.
    """
    points, bounds = [], []
    greatest = 0.0
    for cells in _difference(surface, other):
        for step in range(QUARTERINGS + 1):
            error = float(np.linalg.norm(cells.error))
            upper = np.linalg.norm(cells.coefficients, axis=0).max(axis=(0, 1)) + error
            met = np.linalg.norm(corners(cells.coefficients), axis=0).max(axis=0) - error
            greatest = max(greatest, float(met.max(initial=0.0)))
            open_ = (upper > enough) & ((met <= enough) | (upper > CLOSE * greatest)) & (step < QUARTERINGS)
            points.append(cells.box[:, :, ~open_].mean(axis=0))
            bounds.append(upper[~open_])
            if not open_.any():
                break
            cells = cells.take(open_).quartered()
    return np.concatenate(points, axis=1), np.concatenate(bounds)


def _difference(surface: BSplineSurface | THBSurface, other: BSplineSurface | THBSurface) -> Iterator[Cells]:
    """Yield the difference on the cells of the common mesh, strip by strip, as vectors."""
    (one, error), (two, slack) = (tensor_form(x) for x in (surface, other))
    piece = [a.segment(b.start, b.stop) for a, b in ((two.kv_u, one.kv_u), (two.kv_v, one.kv_v))]
    (kv_u, by_u), (kv_v, by_v) = piece
    both = one, BSplineSurface(kv_u, kv_v, tensor_apply(by_u, by_v, two.coefficients))
    if len({x.coefficients.shape[2:] for x in both}) > 1:
        shapes = " and ".join(str(x.coefficients.shape) for x in both)
        raise ValueError(f"a distance needs splines of one dimension, got nets of shapes {shapes}")
    degrees = [(x.kv_u.degree, x.kv_v.degree) for x in both]
    p, q = np.max(degrees, axis=0).tolist()
    raised = [x.elevate(p, q) for x in both]
    kv_u, kv_v = raised[0].kv_u.merge(raised[1].kv_u), raised[0].kv_v.merge(raised[1].kv_v)
    nets = [
        tensor_apply(x.kv_u.prolongation(kv_u), x.kv_v.prolongation(kv_v), x.coefficients) for x in raised
    ]
    # for each net a piece, elevations and knots, each by products with polar forms; and their difference
    steps = 2 * (2 + p + q - int(np.sum(degrees, axis=1).min()))
    size = max(float(np.abs(x.coefficients).max()) for x in (one, two))
    error += slack + rounding(steps * roundings(p, q) + 1, size)
    components = (nets[0] - nets[1]).reshape(kv_u.dim, kv_v.dim, -1)
    parts = [bernstein(BSplineSurface(kv_u, kv_v, net), ((0, 0),)) for net in np.moveaxis(components, 2, 0)]
    for strips in zip(*parts):
        yield Cells(
            np.concatenate([cells.coefficients for cells in strips]),
            strips[0].box,
            np.concatenate([cells.magnitude for cells in strips]),
            np.concatenate([cells.error for cells in strips]) + error,
        )
