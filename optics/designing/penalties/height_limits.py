"""Limits that heights exceed: thicknesses, envelope, range of heights, mass.

All but the range are linear in the coefficients.  With the gap between equal relative positions of front and
rear, and the volume V, the excesses are

    least thickness t        1 - gap / t           over the rectangle, on the rim, or at x = y = 0
    greatest thickness t     gap / t - 1
    envelope (z0, z1)        (z0 - z) / t on the front, (z - z1) / t on the rear; t the thickness on the axis
    mass M, density rho      rho V / M - 1
    range of heights r       2 |z - m| / r - 1     m makes the mean square of the positive ones least
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite

import numpy as np
from scipy.optimize import brentq
from scipy.sparse import csr_array

from optics.designing.penalties.sample_points import (
    Excess,
    Floats,
    Pull,
    SurfaceSamples,
    free_surfaces,
    simpson,
)
from optics.scene.problem import Limits
from thbcad.lens import FreeformSurface, Lens, mass
from thbcad.splines import KnotVector, gauss_rule, tensor_apply

TIGHT = 1e-14  # of half the range: tolerance of its middle


@dataclass(frozen=True, eq=False)
class _Term:
    """A linear map of the net of one surface, scale a @ net @ b.T, (m, n)."""

    number: int
    scale: float
    a: csr_array
    b: csr_array


@dataclass(frozen=True, eq=False)
class LinearExcess:
    """An excess that is linear in the nets: offset + sum of terms; offset : (m, n)."""

    key: str
    mean: Floats
    offset: Floats
    terms: Sequence[_Term]

    def __call__(self, nets: Sequence[Floats], shift: Floats) -> tuple[Floats, Pull]:
        value = (
            self.offset + shift + sum(t.scale * tensor_apply(t.a, t.b, nets[t.number]) for t in self.terms)
        )
        return value[None], self._pull

    def _pull(self, bar: Floats, slopes: Sequence[Floats]) -> None:
        for t in self.terms:
            slopes[t.number][...] += t.scale * tensor_apply(t.a.T, t.b.T, bar[0])

    def scaled(self, factor: float, plus: float, key: str) -> LinearExcess:
        """Return factor times this excess plus a number, for another limit."""
        terms = [_Term(t.number, factor * t.scale, t.a, t.b) for t in self.terms]
        return LinearExcess(key, self.mean, factor * self.offset + plus, terms)


class RangeExcess:
    """The excess of a surface's range of heights."""

    key = "sag_range"

    def __init__(self, samples: SurfaceSamples, limit: float) -> None:
        self._samples, self._half = samples, limit / 2
        self._conic, self.mean = samples.conic((0, 0)), samples.mean

    def __call__(self, nets: Sequence[Floats], shift: Floats) -> tuple[Floats, Pull]:
        z = self._conic + self._samples.sag(nets[self._samples.number], (0, 0))
        above, below = z / self._half - 1 + shift, -z / self._half - 1 + shift

        def slope(middle: float) -> float:
            """Return half the derivative of the mean square by the negative middle."""
            difference = np.maximum(above - middle, 0) - np.maximum(below + middle, 0)
            return float((self.mean * difference).sum())

        low, high = -float(below.max()), float(above.max())  # nothing is below, nothing above
        middle = brentq(slope, low, high, xtol=TIGHT) if low < high else (low + high) / 2
        return np.stack([above - middle, below + middle]), self._pull

    def _pull(self, bar: Floats, slopes: Sequence[Floats]) -> None:
        number = self._samples.number
        slopes[number][...] += self._samples.pulled((bar[0] - bar[1]) / self._half, (0, 0))


def height_limits(lens: Lens, limits: Limits, density: float, fine: bool) -> list[Excess]:
    """Return the excesses of every limit of heights that is set; density : g/cm^3."""
    found: list[Excess] = []
    least = {"thickness": limits.thickness, "edge_thickness": limits.edge_thickness}
    least["centre_thickness"] = limits.centre_thickness
    for key, limit in least.items():
        if limit:
            found += [gap.scaled(-1 / limit, 1.0, key) for gap in _gaps(lens, key, fine)]
    most = limits.greatest_thickness
    if isfinite(most):
        found += [gap.scaled(1 / most, -1.0, "greatest_thickness") for gap in _gaps(lens, "thickness", fine)]
    for number, (name, surface) in enumerate(free_surfaces(lens)):
        samples = SurfaceSamples(surface, number, fine)
        if isfinite(limits.sag_range):
            found.append(RangeExcess(samples, limits.sag_range))
        found += _envelope(lens, name, surface, samples, limits.envelope)
    if isfinite(limits.mass):
        found.append(_volume(lens).scaled(mass(1.0, density) / limits.mass, -1.0, "mass"))
    return found


def _envelope(
    lens: Lens, name: str, surface: FreeformSurface, samples: SurfaceSamples, ends: tuple[float, float]
) -> list[Excess]:
    """Return the excess of a surface over its end of the envelope, if there is one."""
    vertex, end, sign = (0.0, ends[0], -1.0) if name == "front" else (lens.thickness, ends[1], 1.0)
    if not isfinite(end):
        return []
    scale = sign / lens.thickness
    term = _Term(samples.number, scale, *_operators(surface, samples.x, samples.y))
    offset = scale * (vertex + samples.conic((0, 0)) - end)
    return [LinearExcess("envelope", samples.mean, offset, [term])]


def _gaps(lens: Lens, key: str, fine: bool) -> list[LinearExcess]:
    """Return the gap in mm at points of the finest sag: everywhere, on pairs of sides, or in the centre."""
    free = [surface for _, surface in free_surfaces(lens)]
    spaces = [s.sag.space.embedding for s in free if s.sag is not None]
    finest = max(range(len(free)), key=lambda k: spaces[k].kv_u.dim * spaces[k].kv_v.dim)
    half = free[finest].half_width
    (x, wx), (y, wy) = (simpson(kv, fine) for kv in (spaces[finest].kv_u, spaces[finest].kv_v))
    x, y = x / half[0], y / half[1]
    ends, both, one = np.array([-1.0, 1.0]), np.array([0.5, 0.5]), np.ones(1)
    rules = {
        "thickness": [(x, wx, y, wy)],
        "edge_thickness": [(x, wx, ends, both), (ends, both, y, wy)],
        "centre_thickness": [(np.zeros(1), one, np.zeros(1), one)],
    }
    return [_gap(lens, s, t, np.outer(ws, wt)) for s, ws, t, wt in rules[key]]


def _gap(lens: Lens, s: Floats, t: Floats, mean: Floats) -> LinearExcess:
    """Return the gap in mm between equal relative positions s and t, from -1 to 1."""
    offset, terms = np.full(mean.shape, lens.thickness), list[_Term]()
    for sign, surface in ((-1.0, lens.front), (1.0, lens.rear)):
        x, y = s * surface.half_width[0], t * surface.half_width[1]
        offset += sign * surface.conic(x[:, None], y[None, :])
        if surface.sag is not None:
            terms.append(_Term(len(terms), sign, *_operators(surface, x, y)))
    return LinearExcess("", mean, offset, terms)


def _operators(surface: FreeformSurface, x: Floats, y: Floats) -> tuple[csr_array, csr_array]:
    assert surface.sag is not None
    embedding = surface.sag.space.embedding
    return embedding.kv_u.collocation(x), embedding.kv_v.collocation(y)


def _volume(lens: Lens) -> LinearExcess:
    """Return the volume in mm^3: that of the lens, and the integrals of `volume_between` over the changes."""
    terms: list[_Term] = []
    offset = lens.volume()
    for name, surface in free_surfaces(lens):
        assert surface.sag is not None
        embedding = surface.sag.space.embedding
        number, net = len({t.number for t in terms}), embedding.coefficients(surface.sag.coefficients)
        for a, b in _integrals(lens, name, embedding.kv_u, embedding.kv_v):
            terms.append(_Term(number, 1.0, csr_array(a[None]), csr_array(b[None])))
            offset -= float(a @ net @ b)
    return LinearExcess("", np.ones((1, 1)), np.full((1, 1), offset), terms)


def _integrals(lens: Lens, name: str, kv_x: KnotVector, kv_y: KnotVector) -> list[tuple[Floats, Floats]]:
    """Return pairs of rows a, b: the volume changes by the sum of a @ net @ b with the net of a surface.

    See `thbcad.sags.volume_between`: with the share k = 1 - w of the front, w of the rear, the Jacobian of
    the solid holds +-a b z - k a b' t z_t - k a' b s z_s, derivatives by the relative positions s and t.
    """
    (af, bf), (ar, br) = lens.front.half_width, lens.rear.half_width
    sign, half = (-1.0, (af, bf)) if name == "front" else (1.0, (ar, br))
    rules = []
    for kv, h in zip((kv_x, kv_y), half):
        x, weights = gauss_rule(kv.breaks, kv.degree // 2 + 2)
        x = np.clip(x, kv.start, kv.stop)
        plain = kv.collocation(x).T @ (weights / h)
        rules.append((plain, kv.collocation(x, 1).T @ (weights * x / h)))  # x d/dx is s d/ds
    (plain_x, turned_x), (plain_y, turned_y) = rules
    rows = []
    for w, weight in zip(*gauss_rule(np.array([0.0, 1.0]), 2)):
        a, b, k = (1 - w) * af + w * ar, (1 - w) * bf + w * br, 1 - w if name == "front" else w
        rows.append((weight * sign * a * b * plain_x, plain_y))
        rows.append((-weight * k * a * (br - bf) * plain_x, turned_y))
        rows.append((-weight * k * b * (ar - af) * turned_x, plain_y))
    return rows
