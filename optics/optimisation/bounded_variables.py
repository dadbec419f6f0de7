"""The variables of the optimiser: multilevel weights, squashed into the bounds.

    c = b S(H (S^-1(c0 / b) + k M D w)),    S(y) = y / (1 + |y|^8)^(1/8)

H averages with the mirror images of a symmetric problem (otherwise the identity), k is STEP.
M is the multilevel generating system, b = z_freedom.  S is the identity for sags well inside
the bounds (thesis 4.33 and 5.3 bend everywhere with the arctangent) and keeps |c| < b.  D is
diagonal: the identity, or what makes the diagonal of the Gauss-Newton Hessian constant.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from optics.optimisation.indicators import LEAST
from optics.optimisation.symmetry import Mirrors
from thbcad.hierarchy import MultilevelBasis

if TYPE_CHECKING:
    from thbcad.surfaces import THBSurface

SHARPNESS = 8
STEP = 0.02  # of the bound: the length of the optimiser's unit
FAR = 1e6  # of the bound: far outside, where the powers still are numbers
INSIDE = 0.99  # of the bound: where coefficients that lie on it start


class BoundedVariables:
    """The map w -> c of one or more sags and its adjoint around a start c0.

    bounds : z_freedom of every sag, mm.  axes : directions of mirror symmetry that is kept.
    """

    def __init__(self, sags: Sequence[THBSurface], bounds: Sequence[float], axes: Sequence[int] = ()) -> None:
        self._parts = [_Part(sag, bound, Mirrors(sag.space, axes)) for sag, bound in zip(sags, bounds)]
        self._ends = np.cumsum([part.basis.size for part in self._parts])
        self._scale = np.ones(self._ends[-1])

    def zeros(self) -> NDArray[np.float64]:
        """Return the weights of the start."""
        return np.zeros(self._ends[-1])

    def coefficients(self, weights: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        """Return c of every sag and keep the slopes of the squashing for `gradient`."""
        return [
            part.coefficients(w)
            for part, w in zip(self._parts, np.split(self._scale * weights, self._ends[:-1]))
        ]

    def gradient(self, gradients: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
        """Return dL/dw from dL/dc at the last coefficients."""
        return self._scale * np.concatenate([part.gradient(g) for part, g in zip(self._parts, gradients)])

    def precondition(self, vectors: Sequence[Sequence[NDArray[np.float64]]]) -> None:
        """Scale the weights at the start by `Objective.curvature`'s vectors there; the mean square of the
        scales is 1."""
        self.coefficients(self.zeros())
        diagonal = np.mean([np.square(self.gradient(v)) for v in vectors], axis=0)
        if not diagonal.any():  # no light on the pixels
            return
        scale = 1 / np.sqrt(np.maximum(diagonal, LEAST * diagonal.mean()))
        self._scale = self._scale * scale / np.sqrt(np.mean(scale**2))


class _Part:
    def __init__(self, sag: THBSurface, bound: float, mirrors: Mirrors) -> None:
        self.basis, self._bound, self._mirrors = MultilevelBasis(sag.space), bound, mirrors
        ratio = np.clip(sag.coefficients / bound, -INSIDE, INSIDE)
        self._start = ratio / (1 - np.abs(ratio) ** SHARPNESS) ** (1 / SHARPNESS)
        self._slope: NDArray[np.float64] | None = None

    def coefficients(self, weights: NDArray[np.float64]) -> NDArray[np.float64]:
        y = np.clip(self._start + STEP * self.basis.coefficients(weights), -FAR, FAR)
        y = self._mirrors.of_coefficients(y)
        base = 1 + np.abs(y) ** SHARPNESS
        self._slope = base ** (-1 / SHARPNESS - 1)
        return np.clip(self._bound * y * base ** (-1 / SHARPNESS), -self._bound, self._bound)

    def gradient(self, gradient: NDArray[np.float64]) -> NDArray[np.float64]:
        return self.basis.adjoint(self._mirrors.of_coefficients(gradient * self._slope)) * (
            self._bound * STEP
        )
