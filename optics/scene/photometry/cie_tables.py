"""The tables of the CIE at 5 nm: the 1931 standard observer of 2 degrees, and illuminants (CIE 15:2018).

Beside them its diagram of uniform chromaticity of 1976.
"""

from __future__ import annotations

from functools import cache
from importlib.resources import files

import numpy as np
from numpy.typing import ArrayLike

from optics.base.runtime import UserError
from optics.scene.photometry.illuminant_names import ILLUMINANTS
from thbcad.checks import Floats

OBSERVER = ("x", "y", "z")


@cache
def _columns() -> dict[str, Floats]:
    """Return the columns of the tables by name; nm is the first."""
    text = files("optics.scene.photometry").joinpath("cie_5nm.csv").read_text("utf-8")
    head, *lines = text.splitlines()
    numbers = np.array([[float(word) for word in line.split(",")] for line in lines]).T
    numbers.flags.writeable = False
    return dict(zip(head.split(","), numbers))


def colour_matching(nm: ArrayLike) -> Floats:
    """Return the colour-matching functions x, y and z of the CIE 1931 observer, (3, n); y is V(lambda).

    nm : (n,) wavelengths.  Between the rows of the table cubic splines are taken, beyond its ends 0.
    """
    from scipy.interpolate import CubicSpline

    columns, nm = _columns(), np.atleast_1d(np.asarray(nm, dtype=np.float64))
    rows = np.array([columns[name] for name in OBSERVER])
    values = CubicSpline(columns["nm"], rows, axis=1)(nm)
    seen = (nm >= columns["nm"][0]) & (nm <= columns["nm"][-1])
    return np.where(seen, np.maximum(values, 0.0), 0.0)


def illuminant(name: str) -> tuple[Floats, Floats]:
    """Return (wavelengths in nm, spectral power on a scale of its own) of a CIE illuminant, (n,) each.

    Raises UserError : another name than those of ILLUMINANTS.
    """
    if name not in ILLUMINANTS:
        raise UserError(f"an illuminant must be one of {', '.join(ILLUMINANTS)}, got {name!r}")
    columns = _columns()
    return columns["nm"], columns[name]


def chromaticity(xyz: Floats) -> Floats:
    """Return u' = 4 X / (X + 15 Y + 3 Z) and v' = 9 Y / (X + 15 Y + 3 Z), (2, ...); NaN of black.

    xyz : (3, ...), on any scale.
    """
    x, y, z = xyz
    total = x + 15 * y + 3 * z
    whole = np.where(total > 0, total, np.nan)
    return np.stack([4 * x / whole, 9 * y / whole])


def chromaticity_distance(xyz: Floats, white: Floats) -> Floats:
    """Return the distance of colours from a white in (u', v'), (...).  xyz : (3, ...).  white : (3,)."""
    u, v = chromaticity(xyz)
    u0, v0 = chromaticity(white)
    return np.hypot(u - u0, v - v0)
