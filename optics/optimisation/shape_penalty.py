"""What the shape of a lens adds to the loss: roughness, and violated limits of thickness and curvature.

With the Hessian D^2 of a sag s and of a whole surface z, h the larger half-width, means over the rectangle:

    roughness    h^2 mean |D^2 s|^2              the bending energy of a thin plate
    curvature    mean max(0, R |D^2 z| - 1)^2    R the least radius; |D^2 z| bounds both principal curvatures
    thickness    mean max(0, 1 - gap / t)^2      t the least thickness; gap between equal relative positions

Means are taken by Simpson's rule on every knot span: curvatures of cubics are greatest at the knots, which
are points of the rule.  R and t are taken 2 % larger (STRICTER).  The parameters of the sags are x and y in
mm.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from thbcad.splines import tensor_apply

if TYPE_CHECKING:
    from thbcad.lens import FreeformSurface, Lens
    from thbcad.splines import KnotVector
    from thbcad.surfaces import THBSurface

STRICTER = 1.02  # limits are kept with this room, so that what the mean leaves over stays within them
HESSIAN = ((2, 0), (1, 1), (1, 1), (0, 2))

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class ShapeWeights:
    """Weights of roughness and of violated limits, and the limits.

    radius, thickness : the least radius of curvature and thickness, mm; 0 for none
    """

    roughness: float = 0.0
    limits: float = 0.0
    radius: float = 0.0
    thickness: float = 0.0

    @property
    def any(self) -> bool:
        return bool(self.roughness or (self.limits and (self.radius or self.thickness)))


class ShapePenalty:
    """The shape's part of the loss, and its gradient by the coefficients of every sag, front first."""

    def __init__(self, lens: Lens, weights: ShapeWeights) -> None:
        self._weights, self._lens = weights, lens
        self._surfaces = [_Samples(s, s.sag) for s in (lens.front, lens.rear) if s.sag is not None]
        self._gap = _Gap(lens) if weights.limits and weights.thickness else None

    def __call__(self, coefficients: Sequence[Floats]) -> tuple[float, list[Floats]]:
        """Return (loss, gradients)."""
        w = self._weights
        nets = [s.embedding.coefficients(c) for s, c in zip(self._surfaces, coefficients)]
        loss, slopes = 0.0, [np.zeros_like(net) for net in nets]
        for samples, net, slope in zip(self._surfaces, nets, slopes):
            for derivative in set(HESSIAN):
                weight = HESSIAN.count(derivative) * w.roughness * samples.size**2
                values = samples.values(net, derivative)
                loss += weight * float((samples.mean * values**2).sum())
                slope += samples.pulled(2 * weight * samples.mean * values, derivative)
            if w.limits and w.radius:
                loss += self._curvature(samples, net, slope)
        if self._gap:
            loss += w.limits * self._gap.violation(nets, slopes, w.thickness * STRICTER, w.limits)
        return loss, [s.embedding.adjoint(slope) for s, slope in zip(self._surfaces, slopes)]

    def _curvature(self, samples: _Samples, net: Floats, slope: Floats) -> float:
        """Add the gradient of the curvature's violation to `slope` and return its loss."""
        radius, weight = self._weights.radius * STRICTER, self._weights.limits
        hessian = {d: samples.values(net, d) + samples.conic[d] for d in set(HESSIAN)}
        norm = np.sqrt(sum(HESSIAN.count(d) * h**2 for d, h in hessian.items()))
        excess = np.maximum(radius * norm - 1, 0)
        for d, h in hessian.items():
            pull = (
                2
                * weight
                * samples.mean
                * excess
                * radius
                * HESSIAN.count(d)
                * h
                / np.where(norm > 0, norm, 1)
            )
            slope += samples.pulled(pull, d)
        return weight * float((samples.mean * excess**2).sum())


class _Samples:
    """Values of a sag at the points of Simpson's rule: sparse matrices times its tensor-product net."""

    def __init__(self, surface: FreeformSurface, sag: THBSurface) -> None:
        self.embedding = sag.space.embedding
        knots = self.embedding.kv_u, self.embedding.kv_v
        (x, wx), (y, wy) = (_simpson(kv) for kv in knots)
        self._matrices = [[kv.collocation(s, d) for d in range(3)] for kv, s in zip(knots, (x, y))]
        self.mean = np.outer(wx, wy)
        self.size = max(surface.half_width)
        self.conic = {d: surface.conic(x[:, None], y[None, :], d) for d in HESSIAN}

    def values(self, net: Floats, derivative: tuple[int, int]) -> Floats:
        a, b = (m[d] for m, d in zip(self._matrices, derivative))
        return tensor_apply(a, b, net)

    def pulled(self, values: Floats, derivative: tuple[int, int]) -> Floats:
        """Return the adjoint of `values` applied to numbers at the points."""
        a, b = (m[d].T for m, d in zip(self._matrices, derivative))
        return tensor_apply(a, b, values)


class _Gap:
    """The thickness at the points of the finest sag, between equal relative positions of front and rear."""

    def __init__(self, lens: Lens) -> None:
        finest = max((s.space.embedding for s in lens.sags), key=lambda e: e.kv_u.dim * e.kv_v.dim)
        half = next(
            s.half_width
            for s in (lens.front, lens.rear)
            if s.sag is not None and s.sag.space.embedding is finest
        )
        (x, wx), (y, wy) = (_simpson(kv) for kv in (finest.kv_u, finest.kv_v))
        s, t = x / half[0], y / half[1]
        self._mean = np.outer(wx, wy)
        self._fixed = np.full((len(s), len(t)), lens.thickness)
        self._parts: list[tuple[float, csr_array, csr_array]] = []
        for sign, surface in ((-1.0, lens.front), (1.0, lens.rear)):
            px, py = s * surface.half_width[0], t * surface.half_width[1]
            self._fixed += sign * surface.conic(px[:, None], py[None, :])
            if surface.sag is not None:
                e = surface.sag.space.embedding
                self._parts.append((sign, e.kv_u.collocation(px), e.kv_v.collocation(py)))

    def violation(
        self, nets: Sequence[Floats], slopes: Sequence[Floats], least: float, weight: float
    ) -> float:
        """Add weight times the gradient to `slopes` and return the mean of max(0, 1 - gap / least)^2."""
        gap = self._fixed + sum(
            sign * tensor_apply(a, b, net) for (sign, a, b), net in zip(self._parts, nets)
        )
        short = np.maximum(1 - gap / least, 0)
        for (sign, a, b), slope in zip(self._parts, slopes):
            slope += tensor_apply(a.T, b.T, -2 * weight * sign / least * self._mean * short)
        return float((self._mean * short**2).sum())


def _simpson(kv: KnotVector) -> tuple[Floats, Floats]:
    """Return the breaks and the middles between them, and Simpson's weights, which sum to 1."""
    span = np.diff(kv.breaks) / (kv.stop - kv.start)
    points = np.sort(np.concatenate([kv.breaks, (kv.breaks[:-1] + kv.breaks[1:]) / 2]))
    weights = np.zeros_like(points)
    weights[1::2] = span * 2 / 3
    weights[:-1:2] += span / 6
    weights[2::2] += span / 6
    return points, weights
