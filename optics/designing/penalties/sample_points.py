"""Points at which the penalties see the shape of a free surface, and the derivatives there.

Means are taken by Simpson's rule on every knot span: derivatives of cubics are greatest at the knots, which
are points of the rule.  Points outside the outline have the weight 0.  The parameters of the sags are x and y
in mm.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from thbcad.checks import Floats
from thbcad.lens import FreeformSurface, Lens
from thbcad.outlines import Outline
from thbcad.splines import KnotVector, tensor_apply

EDGE = 1e-12  # relative: points that rounding put beside an outline

Pull = Callable[[Floats, Sequence[Floats]], None]


class Excess(Protocol):
    """By how much nets exceed a limit, relative to it, at points: at most 0 where the limit is kept.

    key : of the limit.  mean : (m, n), weights of the points, whose sum is 1, 0 of those that do not count.
    """

    @property
    def key(self) -> str: ...

    @property
    def mean(self) -> Floats: ...

    def __call__(self, nets: Sequence[Floats], shift: Floats) -> tuple[Floats, Pull]:
        """Return (excess, pull) with a shift, (m, n), added; excess : (k, m, n), k numbers at every point.

        pull(bar, slopes) adds the gradient of sum(bar * excess) by every net to its slope.
        """
        ...


class SurfaceSamples:
    """Derivatives of one free surface at the points of Simpson's rule.

    number : of the surface among the free ones, front first.  fine : at twice as many points each way.
    """

    def __init__(self, surface: FreeformSurface, number: int, fine: bool = False) -> None:
        assert surface.sag is not None
        self.number = number
        embedding = surface.sag.space.embedding
        knots = embedding.kv_u, embedding.kv_v
        (self.x, wx), (self.y, wy) = (simpson(kv, fine) for kv in knots)
        self._matrices = [[kv.collocation(s, d) for d in range(3)] for kv, s in zip(knots, (self.x, self.y))]
        self._conic = surface.conic
        self.mean = within(surface.outline, self.x, self.y, np.outer(wx, wy))

    def sag(self, net: Floats, derivative: tuple[int, int]) -> Floats:
        """Return a derivative of the sag, (m, n)."""
        a, b = (m[d] for m, d in zip(self._matrices, derivative))
        return tensor_apply(a, b, net)

    def conic(self, derivative: tuple[int, int]) -> Floats:
        """Return a derivative of the conic, (m, n)."""
        return self._conic(self.x[:, None], self.y[None, :], derivative) + np.zeros_like(self.mean)

    def pulled(self, values: Floats, derivative: tuple[int, int]) -> Floats:
        """Return the adjoint of `sag` applied to numbers at the points."""
        a, b = (m[d].T for m, d in zip(self._matrices, derivative))
        return tensor_apply(a, b, values)


def free_surfaces(lens: Lens) -> list[tuple[str, FreeformSurface]]:
    """Return the free surfaces with their names, front first."""
    named = ("front", lens.front), ("rear", lens.rear)
    return [(name, surface) for name, surface in named if surface.sag is not None]


def simpson(kv: KnotVector, fine: bool = False) -> tuple[Floats, Floats]:
    """Return the breaks and the middles between them, and Simpson's weights, which sum to 1.

    fine : with the middles as breaks too.
    """
    breaks = _halved(kv.breaks) if fine else kv.breaks
    span, points = np.diff(breaks) / (kv.stop - kv.start), _halved(breaks)
    weights = np.zeros_like(points)
    weights[1::2] = span * 2 / 3
    weights[:-1:2] += span / 6
    weights[2::2] += span / 6
    return points, weights


def within(outline: Outline, x: Floats, y: Floats, weights: Floats) -> Floats:
    """Return weights of the points x_i, y_j, those outside an outline 0, with a sum of 1."""
    if outline.is_rectangle:
        return weights
    kept = weights * outline.contains(x[:, None], y, EDGE)
    return kept / kept.sum()


def _halved(breaks: Floats) -> Floats:
    return np.sort(np.concatenate([breaks, (breaks[:-1] + breaks[1:]) / 2]))
