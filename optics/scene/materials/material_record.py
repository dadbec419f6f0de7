"""A material as a record, and values between the rows of a table."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import isfinite, nan, pi

import numpy as np

from optics.base.runtime import UserError

NM_PER_MM = 1e6

Table = Sequence[tuple[float, float]]


@dataclass(frozen=True, kw_only=True)
class Material:
    """What a lens is made of.

    law : refractive index relative to air at a wavelength, nm.  range : nm, where it is used.
    measured : nm, where it was fitted.  source : of the law.
    accuracy : of the index, how far a grade or a melt may be from the law.
    density : g/cm^3.  extinction : k at a wavelength, nm; the absorption is 4 pi k / wavelength.
    dn_dt : 1/K, change of the index with temperature.  expansion : 1/K, linear.  None is unknown.
    """

    name: str
    law: Callable[[float], float]
    range: tuple[float, float]
    measured: tuple[float, float]
    source: str
    accuracy: float | None = None
    density: float | None = None
    extinction: Callable[[float], float] | None = None
    dn_dt: float | None = None
    expansion: float | None = None

    def index(self, nm: float) -> float:
        """Return the refractive index at a wavelength, nm.

        Raises UserError : the wavelength is out of `range`; it names both.
        """
        low, high = self.range
        if not low <= nm <= high:
            raise UserError(
                f"the index of {self.name} is known from {low:g} to {high:g} nm, not at {nm:g} nm; "
                "take another wavelength, or give the index as a number"
            )
        return float(self.law(nm))

    def absorption(self, nm: float) -> float:
        """Return the absorption at a wavelength, 4 pi k / wavelength, 1/mm.

        Raises UserError : it is not known there.
        """
        k = nan if self.extinction is None else self.extinction(nm)
        if not isfinite(k):
            raise UserError(
                f"no absorption of {self.name} is known at {nm:g} nm; give lens.absorption in 1/mm, or "
                "lens.absorptions = [[nm, 1/mm], ...]"
            )
        return 4 * pi * k / nm * NM_PER_MM


def tabulated(table: Table, nm: float, what: str, power: int = 1) -> float:
    """Return the value at a wavelength between the rows (nm, value) of a table, linear in nm^power.

    A row's own wavelength gives its own value.  With power = -2 two rows make Cauchy's law n = A + B / nm^2.

    Raises UserError : the wavelength is out of the table; what : it holds, for the message.
    """
    rows = sorted(table)
    wavelengths = np.array([row[0] for row in rows])
    if not rows or not wavelengths[0] <= nm <= wavelengths[-1]:
        known = f"from {wavelengths[0]:g} to {wavelengths[-1]:g} nm" if rows else "nowhere"
        raise UserError(f"{what} is known {known}, not at {nm:g} nm; add a row for that wavelength")
    order = np.sign(power)
    values = np.array([row[1] for row in rows])[::order]
    return float(np.interp(nm**power, (wavelengths**power)[::order], values))
