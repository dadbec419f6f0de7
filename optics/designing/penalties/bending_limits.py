"""Limits that derivatives exceed: the least radii of curvature, and the greatest slope.

With the gradient g and the Hessian A of z, and W^2 = 1 + |g|^2, the principal curvatures are the eigenvalues
k of B = S A S / W, S = (I + g g^T)^(-1/2).  With unit eigenvectors e and N = W (I + g g^T),

    dk = v^T (dA - k dN) v,    v = S e / W^(1/2).

The excess over a least radius R is R k - 1 for both k where z bends towards +z, -R k - 1 where it bends
towards -z.  A penalty that is the same function of both k is smooth where they meet.  The excess over a
greatest slope a is |g| / tan(a) - 1.

Source: M. do Carmo, Differential Geometry of Curves and Surfaces, section 3-3.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, radians, tan

import numpy as np

from optics.designing.penalties.sample_points import Excess, Pull, SurfaceSamples, free_surfaces
from optics.scene.problem import Limits
from thbcad.checks import Floats
from thbcad.lens import Lens

Matrix = tuple[Floats, Floats, Floats]  # xx, xy, yy of symmetric matrices

DERIVATIVES = ((1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
TINY = 1e-300  # stands for a slope or a difference of curvatures of 0


class SlopeExcess:
    """The excess of a surface's slope."""

    key = "slope"

    def __init__(self, samples: SurfaceSamples, degrees: float) -> None:
        self._samples, self._most, self.mean = samples, tan(radians(degrees)), samples.mean
        self._conic = [samples.conic(d) for d in DERIVATIVES[:2]]

    def __call__(self, nets: Sequence[Floats], shift: Floats) -> tuple[Floats, Pull]:
        net = nets[self._samples.number]
        p, q = (c + self._samples.sag(net, d) for c, d in zip(self._conic, DERIVATIVES[:2]))
        slope = np.hypot(p, q)

        def pull(bar: Floats, slopes: Sequence[Floats]) -> None:
            along = bar[0] / (self._most * np.maximum(slope, TINY))
            for part, d in zip((p, q), DERIVATIVES):
                slopes[self._samples.number][...] += self._samples.pulled(along * part, d)

        return slope[None] / self._most - 1 + shift, pull


class RadiusExcess:
    """The excess of a surface's curvatures of the given signs; 1 is towards +z.

    No curvature exceeds the norm of A: where R |A| - 1 is not positive it stands for the excess.
    """

    def __init__(self, key: str, samples: SurfaceSamples, radius: float, signs: Sequence[int]) -> None:
        self.key, self._samples, self._radius, self._signs = key, samples, radius, signs
        self.mean = samples.mean
        self._conic = [samples.conic(d) for d in DERIVATIVES]

    def __call__(self, nets: Sequence[Floats], shift: Floats) -> tuple[Floats, Pull]:
        net = nets[self._samples.number]
        parts = [c + self._samples.sag(net, d) for c, d in zip(self._conic, DERIVATIVES)]
        r, s, t = parts[2:]
        bound = self._radius * np.sqrt(r * r + 2 * s * s + t * t) - 1 + shift
        near = bound > 0
        bent = Curvatures(*(part[near] for part in parts))
        factors = [self._radius * sign for sign in self._signs]
        excess = np.broadcast_to(bound, (2 * len(factors), *bound.shape)).copy()
        for k, f in enumerate(factors):
            excess[2 * k : 2 * k + 2, near] = np.stack([f * bent.greater, f * bent.lesser]) - 1 + shift[near]

        def pull(bar: Floats, slopes: Sequence[Floats]) -> None:
            bars = sum((f * bar[2 * k : 2 * k + 2, near] for k, f in enumerate(factors)), np.zeros(1))
            for part, d in zip(bent.pulled(*bars), DERIVATIVES):
                spread = np.zeros_like(bound)
                spread[near] = part
                slopes[self._samples.number][...] += self._samples.pulled(spread, d)

        return excess, pull


class Curvatures:
    """The principal curvatures of a graph from its derivatives z_x, z_y, z_xx, z_xy, z_yy, of one shape."""

    def __init__(self, p: Floats, q: Floats, r: Floats, s: Floats, t: Floats) -> None:
        self._gradient, self._w = (p, q), np.sqrt(1 + p**2 + q**2)
        factor = 1 / (self._w * (self._w + 1))
        self._root = 1 - factor * p**2, -factor * p * q, 1 - factor * q**2
        b_xx, b_xy, b_yy = (b / self._w for b in _between(self._root, (r, s, t)))
        mean, half = (b_xx + b_yy) / 2, np.hypot((b_xx - b_yy) / 2, b_xy)
        self.greater, self.lesser = mean + half, mean - half
        self._turn = [b / np.maximum(half, TINY) for b in ((b_xx - b_yy) / 2, b_xy)]

    def pulled(self, greater: Floats, lesser: Floats) -> tuple[Floats, ...]:
        """Return the gradient of sum(greater k_1 + lesser k_2) by the five derivatives."""
        (p, q), w = self._gradient, self._w
        by_r, by_s, by_t = (b / w for b in _between(self._root, self._spread(greater, lesser)))
        xx, xy, yy = self._spread(greater * self.greater, lesser * self.lesser)
        s_xx, s_xy, s_yy = self._root
        along_x, along_y = xx * p + xy * q, xy * p + yy * q
        trace = (xx + yy) / w**2
        by_p = -p * trace - 2 / w * (s_xx * along_x + s_xy * along_y)
        by_q = -q * trace - 2 / w * (s_xy * along_x + s_yy * along_y)
        return by_p, by_q, by_r, 2 * by_s, by_t

    def _spread(self, greater: Floats, lesser: Floats) -> Matrix:
        """Return greater e_1 e_1^T + lesser e_2 e_2^T."""
        mean, half = (greater + lesser) / 2, (greater - lesser) / 2
        cosine, sine = self._turn  # of twice the angle of e_1
        return mean + half * cosine, half * sine, mean - half * cosine


def bending_limits(lens: Lens, limits: Limits, fine: bool) -> list[Excess]:
    """Return the excesses of every limit of derivatives that is set, of every free surface."""
    found: list[Excess] = []
    for number, (name, surface) in enumerate(free_surfaces(lens)):
        samples = SurfaceSamples(surface, number, fine)
        if limits.radius:
            found.append(RadiusExcess("radius", samples, limits.radius, (1, -1)))
        if limits.concave_radius:
            hollow = (-1,) if name == "front" else (1,)
            found.append(RadiusExcess("concave_radius", samples, limits.concave_radius, hollow))
        if limits.slope < 90:
            found.append(SlopeExcess(samples, limits.slope))
    return found


def curvature_range(limits: Limits, name: str, room: float = 0.0) -> tuple[float, float]:
    """Return the least and the greatest curvature towards +z that the limits allow the front or the rear,
    1/mm.

    room : of the radii, that is left between them and the limits.
    """
    either, hollow = (1 / (r * (1 + room)) if r else inf for r in (limits.radius, limits.concave_radius))
    if name == "front":
        return max(-either, -hollow), either
    return -either, min(either, hollow)


def _between(s: Matrix, a: Matrix) -> Matrix:
    """Return S A S of symmetric matrices, each as (xx, xy, yy)."""
    (s_xx, s_xy, s_yy), (a_xx, a_xy, a_yy) = s, a
    b_xx, b_xy = a_xx * s_xx + a_xy * s_xy, a_xx * s_xy + a_xy * s_yy
    b_yx, b_yy = a_xy * s_xx + a_yy * s_xy, a_xy * s_xy + a_yy * s_yy
    return s_xx * b_xx + s_xy * b_yx, s_xx * b_xy + s_xy * b_yy, s_xy * b_xy + s_yy * b_yy
