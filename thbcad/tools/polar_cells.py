"""Derivatives of a graph z(x, y) along and round the axis of a spindle, as Bernstein coefficients: their
ranges on cells, and their values at the corners of cells.

With the position X = (x, y) = rho (cos theta, sin theta), T = (-y, x), the gradient g and the Hessian H,

    z_theta = T . g,                    rho z_rho = X . g,
    z_theta_theta = T H T - X . g,      rho^2 z_rho_rho = X H X,
    rho z_rho_theta = T H X + T . g.

These are polynomials on every cell, two degrees above z, and stay so at the axis.  For the ranges rho divides
them; on cells that touch the axis the norm of the gradient and the eigenvalues of the Hessian bound the
quotients instead.

Source: G. Farin, Curves and Surfaces for CAGD, chapter 5 (products of Bernstein polynomials).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import prod

import numpy as np

from thbcad.certified import Cells, bernstein, corners, rounding
from thbcad.checks import EPS, Floats
from thbcad.splines import BSplineSurface
from thbcad.tools.spiral_motion import DERIVATIVES, RoundAxis

Z_X, Z_Y, Z_XX, Z_XY, Z_YY = range(5)
PASSES = 4  # linear factors of a product: two in x, two in y
ROUNDINGS = 5  # of one factor: a weight, two products with it, and their sum

# a polynomial as terms (factor, power of x, power of y, derivative)
Term = tuple[int, int, int, int]
ROUND_SLOPE: tuple[Term, ...] = ((-1, 0, 1, Z_X), (1, 1, 0, Z_Y))  # z_theta
RADIAL_SLOPE: tuple[Term, ...] = ((1, 1, 0, Z_X), (1, 0, 1, Z_Y))  # rho z_rho
ROUND: tuple[Term, ...] = (  # z_theta_theta
    *((1, 0, 2, Z_XX), (-2, 1, 1, Z_XY), (1, 2, 0, Z_YY)),
    *((-1, 1, 0, Z_X), (-1, 0, 1, Z_Y)),
)
RADIAL: tuple[Term, ...] = ((1, 2, 0, Z_XX), (2, 1, 1, Z_XY), (1, 0, 2, Z_YY))  # rho^2 z_rho_rho
MIXED: tuple[Term, ...] = (  # rho z_rho_theta
    *((-1, 1, 1, Z_XX), (1, 2, 0, Z_XY), (-1, 0, 2, Z_XY), (1, 1, 1, Z_YY)),
    *((-1, 0, 1, Z_X), (1, 1, 0, Z_Y)),
)
PLAIN: tuple[tuple[Term, ...], ...] = tuple(((1, 0, 0, k),) for k in range(5))
ROWS = (*PLAIN, ROUND_SLOPE, RADIAL_SLOPE, ROUND, RADIAL, MIXED)
TURN_ROUNDINGS = 24  # of a cosine and a sine, the products with them, and their sum
SAFE = 1 + 64 * EPS  # more than the roundings of any product here


@dataclass(frozen=True, eq=False)
class PolarJet:
    """Rows of polar cells by name, (..., n) each; `plain` holds z_x, z_y, z_xx, z_xy, z_yy."""

    plain: Floats
    round_slope: Floats
    radial_slope: Floats
    round: Floats
    radial: Floats
    mixed: Floats

    @classmethod
    def of(cls, rows: Floats) -> PolarJet:
        """Return the rows (10, ...) by name."""
        return cls(rows[:5], *rows[5:])


def polar_cells(graph: BSplineSurface) -> Iterator[Cells]:
    """Yield the derivatives of a scalar graph in x, y and round the axis as polynomials on its cells.

    The axis is x = y = 0.  The rows are those of `PolarJet`.
    """
    reach = [max(abs(kv.start), abs(kv.stop)) for kv in (graph.kv_u, graph.kv_v)]
    for cells in bernstein(graph, DERIVATIVES):
        made: dict[Term, Floats] = {}
        rows = [_polynomial(cells, reach, terms, made) for terms in ROWS]
        coefficients, magnitude, error = zip(*rows)
        yield Cells(np.stack(coefficients), cells.box, np.array(magnitude), np.array(error))


def _polynomial(
    cells: Cells, reach: list[float], terms: tuple[Term, ...], made: dict[Term, Floats]
) -> tuple[Floats, float, float]:
    """Return (coefficients, a bound of them, a bound of their rounding errors) of a sum of terms.

    made : products that were formed before, by (1, power of x, power of y, derivative).
    """
    total = np.zeros(1)
    magnitude = error = 0.0
    for factor, a, b, k in terms:
        key = (1, a, b, k)
        if key not in made:
            made[key] = _product(cells, a, b, k)
        total = total + factor * made[key]
        size = abs(factor) * prod(r**n for r, n in zip(reach, (a, b)))
        magnitude += size * float(cells.magnitude[k])
        own = rounding(PASSES * ROUNDINGS, float(cells.magnitude[k]))
        error += size * (float(cells.error[k]) + own)
    return total, magnitude, error + rounding(2 * len(terms), magnitude)


def _product(cells: Cells, a: int, b: int, k: int) -> Floats:
    """Return the Bernstein coefficients of x^a y^b times a derivative, two degrees higher in x and in y."""
    block: Floats = cells.coefficients[k]
    for axis, power in ((0, a), (1, b)):
        ones = np.ones_like(cells.box[:, axis])
        for count in range(2):
            block = _times(axis, block, cells.box[:, axis] if count < power else ones)
    return block


def _times(axis: int, block: Floats, ends: Floats) -> Floats:
    """Return the product with a linear polynomial: ((n + 1 - k) a c_k + k b c_(k-1)) / (n + 1).

    ends : (2, n) float, the values a and b of the linear polynomial at both ends of every cell.
    """
    block = np.asarray(np.moveaxis(block, axis, 0))
    degree = len(block)
    weight = (np.arange(degree) + 1.0)[:, None, None] / degree
    result = np.zeros((degree + 1, *block.shape[1:]))
    result[:-1] += weight[::-1] * ends[0] * block
    result[1:] += weight * ends[1] * block
    return np.moveaxis(result, 0, axis)


@dataclass(frozen=True, eq=False)
class Ranges:
    """What bounds the derivatives on n cells, (n,) each, rounding included.

    low, high : of z_theta_theta.  across : greatest |z_theta| / rho.  mixed_low, mixed : of |z_rho_theta|
    bend_low, bend : of z_rho_rho.  flat : least |z_rho|.  steep : greatest |z_rho|
    """

    low: Floats
    high: Floats
    across: Floats
    mixed_low: Floats
    mixed: Floats
    bend_low: Floats
    bend: Floats
    flat: Floats
    steep: Floats


def ranges(cells: Cells) -> Ranges:
    """Return the ranges on every cell of `polar_cells`."""
    jet, error = PolarJet.of(cells.coefficients), PolarJet.of(cells.error)
    near, far = _distances(cells)
    gradient = np.hypot(*map(_most, jet.plain[:2], error.plain[:2])) * SAFE
    least, most = _eigenvalues(jet.plain[2:], error.plain[2:])
    low, high = _range(jet.round, error.round)
    bend_low, bend = _range(jet.radial, error.radial)
    slope_low, slope = _range(jet.radial_slope, error.radial_slope)
    return Ranges(
        low=low,
        high=high,
        across=np.minimum(_over(_most(jet.round_slope, error.round_slope), near), gradient),
        mixed_low=_least(jet.mixed, error.mixed) / far / SAFE,
        mixed=np.minimum(
            _over(_most(jet.mixed, error.mixed), near), ((most - least) / 2 * far + gradient) * SAFE
        ),
        bend_low=np.maximum(-_quotient(-bend_low, near**2, far**2), least),
        bend=np.minimum(_quotient(bend, near**2, far**2), most),
        flat=_least(jet.radial_slope, error.radial_slope) / far / SAFE,
        steep=np.minimum(_over(np.maximum(slope, -slope_low), near), gradient),
    )


def values(cells: Cells) -> RoundAxis:
    """Return the derivatives at the corners of every cell of `polar_cells`, (4, n) each."""
    x, y = cells.box[[0, 0, 1, 1], 0], cells.box[[0, 1, 0, 1], 1]
    return RoundAxis.of(x, y, corners(cells.coefficients[:5]))


def held(cells: Cells, numbers: Floats) -> Floats:
    """Return numbers at the corners, (4, n), -inf at those outside the region of the cells."""
    return np.where(cells.corners_inside(), numbers, -np.inf)


def errors(cells: Cells) -> dict[str, float]:
    """Return bounds of the rounding errors of `values`, by the name of the derivative."""
    rho = float(_distances(cells)[1].max())
    error = cells.error[:5] + rounding(TURN_ROUNDINGS, cells.magnitude[:5])
    slope, bend = float(error[:2].sum()), float(error[2] + 2 * error[3] + error[4])
    return {
        "slope": slope,
        "across": slope,
        "turn": rho * (rho * bend + slope) * SAFE,
        "mixed": (rho * bend + slope) * SAFE,
        "bend": bend,
    }


def _eigenvalues(hessian: Floats, error: Floats) -> tuple[Floats, Floats]:
    """Return bounds of the least and of the greatest second derivative in any direction, (n,) each.

    The greatest eigenvalue is convex, so that its greatest value at the Bernstein coefficients bounds it.
    """
    z_xx, z_xy, z_yy = hessian
    mean, half = (z_xx + z_yy) / 2, np.hypot((z_xx - z_yy) / 2, z_xy)
    slack = max(error[0], error[2]) + error[1]
    slack = slack + (SAFE - 1) * (abs(mean) + half).max(axis=(0, 1))
    return (mean - half).min(axis=(0, 1)) - slack, (mean + half).max(axis=(0, 1)) + slack


def _range(block: Floats, error: Floats) -> tuple[Floats, Floats]:
    return block.min(axis=(0, 1)) - error, block.max(axis=(0, 1)) + error


def _most(block: Floats, error: Floats) -> Floats:
    return np.asarray(abs(block).max(axis=(0, 1)) + error)


def _least(block: Floats, error: Floats) -> Floats:
    """Return a lower bound of the magnitude."""
    low, high = _range(block, error)
    return np.maximum(np.maximum(low, -high), 0.0)


def _distances(cells: Cells) -> tuple[Floats, Floats]:
    """Return the least and the greatest distance of every cell from the axis."""
    low, high = cells.box
    nearest = np.maximum(np.maximum(low, -high), 0.0)
    return np.hypot(*nearest) / SAFE, np.hypot(*np.maximum(abs(low), abs(high))) * SAFE


def _over(bound: Floats, rho: Floats) -> Floats:
    """Return bound / rho, infinite where the cell touches the axis."""
    return np.divide(bound * SAFE, rho, out=np.full_like(bound, np.inf), where=rho > 0)


def _quotient(bound: Floats, near: Floats, far: Floats) -> Floats:
    """Return an upper bound of p / t for p <= bound and t from near to far."""
    return np.where(bound > 0, _over(bound, near), bound / far / SAFE)
