"""Laws of dispersion, n(wavelength), in the forms that their authors print; wavelengths in micrometres."""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt

Law = Callable[[float], float]


def sellmeier(*terms: tuple[float, float]) -> Law:
    """Return n(w) with n^2 = 1 + sum_i B_i w^2 / (w^2 - C_i).  terms : (B_i, C_i in um^2)."""
    return lambda um: sqrt(1 + sum(b * um**2 / (um**2 - c) for b, c in terms))


def power_law(constant: float, *terms: tuple[float, int]) -> Law:
    """Return n(w) with n^2 = A + sum_i A_i w^p_i.  terms : (A_i, p_i)."""
    return lambda um: sqrt(constant + sum(a * um**p for a, p in terms))


def cauchy(constant: float, *terms: float) -> Law:
    """Return n(w) = A + sum_i A_i / w^(2 i).  terms : A_1, A_2, ..."""
    return lambda um: constant + sum(a / um ** (2 * i) for i, a in enumerate(terms, 1))
