"""Ranges of the derivatives round a spindle's axis on cells, and their values at the corners of cells.

rho divides the polynomials of `polar_cells`.  On cells that touch the axis the norm of the gradient and the
eigenvalues of the Hessian bound the quotients instead.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from thbcad.certified import Cells, corners, rounding
from thbcad.checks import EPS, Floats
from thbcad.tools.polar_cells import PolarJet
from thbcad.tools.spiral_motion import RoundAxis

ROUNDINGS = 24  # of a cosine and a sine, the products with them, and their sum
SAFE = 1 + 64 * EPS  # more than the roundings of any product here


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
    error = cells.error[:5] + rounding(ROUNDINGS, cells.magnitude[:5])
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
