"""The variables of the optimiser: multilevel weights, squashed into the bounds.

    c = b S(P H (S^-1(c0 / b) + k M D w)),    S(y) = y / (1 + |y|^8)^(1/8)

H averages with the mirror images of a symmetric problem (otherwise the identity), k is STEP.  P continues
what lies inside the outline of a surface beyond it (`Continuation`; the identity of a rectangle).
M is the multilevel generating system, b = z_freedom.  S is the identity for sags well inside
the bounds (thesis 4.33 and 5.3 bend everywhere with the arctangent) and keeps |c| < b.  D is
diagonal: the identity, or what makes the diagonal of the Gauss-Newton Hessian constant.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy

import numpy as np

from optics.designing.optimisation.indicators import LEAST
from optics.light.measuring import Mirrors
from thbcad.checks import Floats
from thbcad.fitting import Continuation
from thbcad.hierarchy import MultilevelBasis
from thbcad.outlines import Outline
from thbcad.surfaces import THBSurface

SHARPNESS = 8
STEP = 0.02  # of the bound: the length of the optimiser's unit
FAR = 1e6  # of the bound: far outside, where the powers still are numbers
INSIDE = 0.99  # of the bound: where coefficients that lie on it start


class BoundedVariables:
    """The map w -> c of one or more sags and its adjoint around a start c0.

    bounds : z_freedom of every sag, mm.  axes : directions of mirror symmetry that is kept.
    outlines : of the surfaces; None where all are rectangles.
    """

    def __init__(
        self,
        sags: Sequence[THBSurface],
        bounds: Sequence[float],
        axes: Sequence[int] = (),
        outlines: Sequence[Outline] | None = None,
    ) -> None:
        shapes = outlines or [Outline((1.0, 1.0))] * len(sags)
        self._parts = [
            _Part(sag, bound, Mirrors(sag.space, axes), Continuation(sag.space, shape))
            for sag, bound, shape in zip(sags, bounds, shapes)
        ]
        self._ends = np.cumsum([part.basis.size for part in self._parts])
        self._scale = np.ones(self._ends[-1])

    def around(self, sags: Sequence[THBSurface]) -> BoundedVariables:
        """Return the variables around other sags of the same spaces, with the same scale."""
        other = copy(self)
        other._parts = [part.around(sag) for part, sag in zip(self._parts, sags)]
        return other

    def zeros(self) -> Floats:
        """Return the weights of the start."""
        return np.zeros(self._ends[-1])

    def coefficients(self, weights: Floats) -> tuple[list[Floats], list[Floats]]:
        """Return c of every sag, and the slopes of the squashing there, which `gradient` needs."""
        rows = np.split(self._scale * weights, self._ends[:-1])
        pairs = [part.coefficients(w) for part, w in zip(self._parts, rows)]
        return [c for c, _ in pairs], [slope for _, slope in pairs]

    def gradient(self, gradients: Sequence[Floats], slopes: Sequence[Floats]) -> Floats:
        """Return dL/dw from dL/dc at coefficients with these slopes."""
        each = [part.gradient(g, s) for part, g, s in zip(self._parts, gradients, slopes)]
        return self._scale * np.concatenate(each)

    def preconditioned(self, vectors: Sequence[Sequence[Floats]]) -> BoundedVariables:
        """Return the variables with weights scaled at the start by `Objective.curvature`'s vectors there.

        The mean square of the scales is 1.
        """
        _, slopes = self.coefficients(self.zeros())
        diagonal = np.mean([np.square(self.gradient(v, slopes)) for v in vectors], axis=0)
        if not diagonal.any():  # no light on the pixels
            return self
        scale = 1 / np.sqrt(np.maximum(diagonal, LEAST * diagonal.mean()))
        scaled = copy(self)
        scaled._scale = self._scale * scale / np.sqrt(np.mean(scale**2))
        return scaled


class _Part:
    """The map w -> c of one sag."""

    def __init__(self, sag: THBSurface, bound: float, mirrors: Mirrors, beside: Continuation) -> None:
        self.basis = MultilevelBasis(sag.space)
        self._bound = bound
        self._mirrors, self._beside = mirrors, beside
        self._start = self._unsquashed(sag)

    def around(self, sag: THBSurface) -> _Part:
        """Return the map around another sag of the same space."""
        other = copy(self)
        other._start = self._unsquashed(sag)
        return other

    def _unsquashed(self, sag: THBSurface) -> Floats:
        ratio = np.clip(sag.coefficients / self._bound, -INSIDE, INSIDE)
        result: Floats = ratio / (1 - np.abs(ratio) ** SHARPNESS) ** (1 / SHARPNESS)
        return result

    def coefficients(self, weights: Floats) -> tuple[Floats, Floats]:
        """Return (c, S' at c)."""
        y = np.clip(self._start + STEP * self.basis.coefficients(weights), -FAR, FAR)
        y = self._beside(self._mirrors.of_coefficients(y))
        base = 1 + np.square(np.square(np.square(y)))  # SHARPNESS is 8; powers are slow
        root = np.sqrt(np.sqrt(np.sqrt(base)))
        return np.clip(self._bound * y / root, -self._bound, self._bound), 1 / (root * base)

    def gradient(self, gradient: Floats, slope: Floats) -> Floats:
        """Return dL/dw from dL/dc."""
        back = self.basis.adjoint(self._mirrors.of_coefficients(self._beside.adjoint(gradient * slope)))
        return back * (self._bound * STEP)
