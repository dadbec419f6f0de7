"""How a road surface reflects light to a driver: the r-table, r(beta, tan gamma) = q cos^3 gamma.

L = I r / h^2 is the luminance of a point by an intensity I towards it from the height h.  gamma is the
angle of the light from the vertical; beta is 0 where the lamp stands beyond the point as the driver sees
it.  Tables hold r in 1e-4 cd/(m^2 lx).  In between r is bilinear; beyond tan gamma = 12 it is zero.

Tables of measured roads (R1 to R4, C1, C2) belong to the International Commission on Illumination.  No
source with a licence was found that lets them be handed on, so that a file is read.

Source: CIE 144:2001, Road surface and road marking reflection characteristics.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from optics.base.runtime import UserError, read_at_most
from thbcad.checks import Floats
from thbcad.texts import LATIN, columns_by_blanks, number, text_of

BETAS = np.array([0, 2, 5, 10, 15, 20, 25, 30, 35, 40, 45, 60, 75, 90, 105, 120, 135, 150, 165, 180.0])
TANGENTS = np.append(np.arange(0, 2, 0.25), np.arange(2, 12.1, 0.5))
UNIT = 1e-4
BELOW = 0.01  # of r under the lamp, where beta has no meaning: what rounded numbers of one row may differ by
MOST_BYTES = 100_000
MOST = 1e6  # of r: a hundred times what any road sends anywhere


@dataclass(frozen=True, eq=False)
class RoadSurface:
    """The r-table of a road.  r : (29, 20), rows by TANGENTS, columns by BETAS, in 1e-4 cd/(m^2 lx).

    Raises UserError : another shape, numbers that are negative, or above 1e6, rows and columns exchanged.
    """

    r: Floats

    def __post_init__(self) -> None:
        wanted = len(TANGENTS), len(BETAS)
        if self.r.shape != wanted:
            raise UserError(
                f"an r-table has {wanted[0]} rows (tan gamma 0 to 12) of {wanted[1]} numbers (beta 0 to 180) "
                f"with decimal points and no headings; got the shape {self.r.shape}"
            )
        if not (np.isfinite(self.r).all() and self.r.min() >= 0 and self.r.max() <= MOST):
            raise UserError(
                f"the numbers of an r-table must lie between 0 and {MOST:g} (in 1e-4 cd/(m^2 lx)), got "
                f"{self.r.min():g} to {self.r.max():g}"
            )
        first = self.r[0]
        if np.ptp(first) > BELOW * first.max() or not first.max():
            raise UserError(
                "the first row of an r-table is light from above, one number greater than 0; got "
                f"{first.min():g} to {first.max():g}: rows go by tan gamma, columns by beta"
            )

    @property
    def specular(self) -> float:
        """S1 = r(0, 2) / r(0, 0), by which tables are told apart: 1.11 for R3, 0.97 for C2."""
        return float(self.r[TANGENTS == 2, 0][0] / self.r[0, 0])

    def at(self, beta: Floats, tangent: Floats) -> Floats:
        """Return r at angles in degrees from 0 to 180 and tangents of gamma, cd/(m^2 lx)."""
        grid = RegularGridInterpolator((TANGENTS, BETAS), UNIT * self.r, bounds_error=False, fill_value=0.0)
        return np.asarray(grid(np.stack([tangent, beta], axis=-1)))


def read_r_table(path: str | Path) -> RoadSurface:
    """Return the r-table of a text file: 29 lines of 20 numbers, apart by blanks, commas or semicolons.

    Raises UserError : no such file, or no such numbers in it; one sentence names it.
    """
    data = read_at_most(path, MOST_BYTES)
    try:
        lines = columns_by_blanks(text_of(data, LATIN), len(BETAS)).split("\n")
        rows = [row for line in lines if (row := [number(word) for word in line.split()])]
        return RoadSurface(np.array(rows))
    except UserError as error:
        raise UserError(f"{path}: {error}") from None
    except ValueError as error:
        reason = "its lines differ in length" if "inhomogeneous" in str(error) else error
        raise UserError(
            f"{path} is no r-table of {len(TANGENTS)} lines with {len(BETAS)} numbers each: {reason}"
        ) from None
