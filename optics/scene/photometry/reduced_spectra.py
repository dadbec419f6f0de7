"""Spectra as few lines, which a lens is traced at.

A spectrum S with many rows is cut into strata, each of which becomes one line.  With u = 1 / wavelength^2, in
which the index is about linear (Cauchy), a line stands where the flux of its stratum has its mean u, so that
only the second order of the spread within a stratum is left.  The sum of flux times spread^2 is least where
strata have equal shares of

    integral of S^(1/3) |du|    (Panter and Dite, Proc. IRE 39, 44, 1951).

A line has the colour of its whole stratum, so that the colour of the source is exact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from optics.scene.photometry.cie_tables import colour_matching, illuminant
from thbcad.checks import Floats

MOST_LINES = 10  # docs/materials.md says what they leave
STEP = 1.0  # nm, at which a spectrum is integrated

Rows = Sequence[tuple[float, float]]


@dataclass(frozen=True)
class SpectralLine:
    """Light of one wavelength.  nm : of it.  weight : share of the source's flux.

    xyz : CIE 1931 colour of a watt of it, in units of 683 lm/W; the second is V(lambda).
    """

    nm: float
    weight: float
    xyz: tuple[float, float, float]


def spectral_lines(spectrum: str | Rows, most: int = MOST_LINES) -> tuple[SpectralLine, ...]:
    """Return the lines of a spectrum, by wavelength; their weights sum to 1.

    spectrum : rows (nm, radiant weight), or the name of a CIE illuminant.  Up to `most` rows are lines
        themselves; more are a curve, linear between them, of which `most` strata are taken.

    Raises UserError : see `illuminant`.
    """
    if isinstance(spectrum, str):
        nm, power = illuminant(spectrum)
    else:
        nm, power = (np.array(column) for column in zip(*sorted(spectrum)))
    if len(nm) > most:
        fine = np.union1d(nm, np.arange(np.ceil(nm[0]), nm[-1], STEP))
        flux = np.interp(fine, nm, power) * _widths(fine)
        shares = (np.interp(fine, nm, power) ** (1 / 3) * _widths(fine) / fine**3).cumsum()
        of = np.minimum((shares / shares[-1] * most).astype(int), most - 1)
        xyz = colour_matching(fine)
        sums = np.array([np.bincount(of, flux * row, most) for row in (np.ones_like(fine), fine**-2.0, *xyz)])
        sums = sums[:, sums[0] > 0]
        return _lines((sums[1] / sums[0]) ** -0.5, sums[0] / sums[0].sum(), sums[2:] / sums[0])
    lit = power > 0
    nm, power = nm[lit], power[lit]
    return _lines(nm, power / power.sum(), colour_matching(nm))


def white_of(lines: Sequence[SpectralLine]) -> Floats:
    """Return the colour of a watt of the whole source, XYZ in units of 683 lm/W, (3,)."""
    return np.sum([line.weight * np.array(line.xyz) for line in lines], axis=0)


def _widths(nm: Floats) -> Floats:
    """Return the weights of the trapezoidal rule on a grid."""
    steps = np.diff(nm)
    return (np.concatenate([[0.0], steps]) + np.concatenate([steps, [0.0]])) / 2


def _lines(nm: Floats, weights: Floats, xyz: Floats) -> tuple[SpectralLine, ...]:
    return tuple(
        SpectralLine(float(w), float(share), (float(x), float(y), float(z)))
        for w, share, x, y, z in zip(nm, weights, *xyz)
    )
