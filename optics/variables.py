"""The variables of the optimiser: multilevel weights, squashed into the bounds.

    c = b S((c0 + k M w) / b),    S(y) = y / (1 + |y|^8)^(1/8)

M is the multilevel generating system, b = z_freedom.  S is the identity for sags well inside
the bounds (thesis 4.33 and 5.3 bend everywhere with the arctangent) and keeps |c| < b.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from thbcad.multilevel import MultilevelBasis

if TYPE_CHECKING:
    from thbcad.thb import THBSurface

SHARPNESS = 8
STEP = 0.02  # of the bound: the length of the optimiser's unit
FAR = 1e6  # of the bound: far outside, where the powers still are numbers
INSIDE = 0.99  # of the bound: where coefficients that lie on it start


class BoundedVariables:
    """The map w -> c and its adjoint around a start c0."""

    def __init__(self, sag: THBSurface, bound: float) -> None:
        self._basis = MultilevelBasis(sag.space)
        self._bound = bound
        ratio = np.clip(sag.coefficients / bound, -INSIDE, INSIDE)
        self._start = ratio / (1 - np.abs(ratio) ** SHARPNESS) ** (1 / SHARPNESS)
        self._slope: NDArray[np.float64] | None = None

    def zeros(self) -> NDArray[np.float64]:
        """Return the weights of the start."""
        return np.zeros(self._basis.size)

    def coefficients(self, weights: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return c and keep the slope of the squashing for `gradient`."""
        y = np.clip(self._start + STEP * self._basis.coefficients(weights), -FAR, FAR)
        base = 1 + np.abs(y) ** SHARPNESS
        self._slope = base ** (-1 / SHARPNESS - 1)
        return np.clip(self._bound * y * base ** (-1 / SHARPNESS), -self._bound, self._bound)

    def gradient(self, gradient: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return dL/dw from dL/dc at the last coefficients."""
        return self._basis.adjoint(gradient * self._slope) * (self._bound * STEP)
