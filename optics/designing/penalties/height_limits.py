"""Limits that heights exceed: thicknesses, envelope, range of heights, mass.

All but the range are linear in the coefficients.  With the gap between equal relative positions of front and
rear, and the volume V, the excesses are

    least thickness t        1 - gap / t           inside the outline, on the rim, or at x = y = 0
    greatest thickness t     gap / t - 1
    envelope (z0, z1)        (z0 - z) / t on the front, (z - z1) / t on the rear; t the thickness on the axis
    mass M, density rho      rho V / M - 1
    range of heights r       2 |z - m| / r - 1     m makes the mean square of the positive ones least
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import isfinite

import numpy as np
from scipy.optimize import brentq
from scipy.sparse import csr_array

from optics.designing.penalties.sample_points import (
    Excess,
    Pull,
    SurfaceSamples,
    free_surfaces,
    simpson,
    within,
)
from optics.scene.problem import Limits
from thbcad.checks import Floats
from thbcad.lens import FreeformSurface, Lens, mass
from thbcad.outlines import Outline, area_rule
from thbcad.splines import KnotVector, gauss_rule, tensor_apply

TIGHT = 1e-14  # of half the range: tolerance of its middle


@dataclass(frozen=True, eq=False)
class _Term:
    """A linear map of the net of one surface, scale a @ net @ b.T, (m, n)."""

    number: int
    scale: float
    a: csr_array
    b: csr_array

    def __call__(self, net: Floats) -> Floats:
        return self.scale * tensor_apply(self.a, self.b, net)

    def pulled(self, bar: Floats) -> Floats:
        """Return the adjoint, applied to numbers (m, n)."""
        return self.scale * tensor_apply(self.a.T, self.b.T, bar)


@dataclass(frozen=True, eq=False)
class _PointTerm(_Term):
    """The same at points in a row: those of the diagonal, (1, n)."""

    def __call__(self, net: Floats) -> Floats:
        return self.scale * ((self.a @ net) * self.b.toarray()).sum(axis=1)[None]

    def pulled(self, bar: Floats) -> Floats:
        return self.scale * (self.a.T @ (bar[0][:, None] * self.b.toarray()))


@dataclass(frozen=True, eq=False)
class _SumTerm:
    """The sum of a net times weights, (1, 1)."""

    number: int
    scale: float
    weights: Floats

    def __call__(self, net: Floats) -> Floats:
        return np.full((1, 1), self.scale * float((self.weights * net).sum()))

    def pulled(self, bar: Floats) -> Floats:
        """Return the adjoint, applied to a number."""
        return self.scale * bar[0, 0] * self.weights


@dataclass(frozen=True, eq=False)
class LinearExcess:
    """An excess that is linear in the nets: offset + sum of terms; offset : (m, n)."""

    key: str
    mean: Floats
    offset: Floats
    terms: Sequence[_Term | _SumTerm]

    def __call__(self, nets: Sequence[Floats], shift: Floats) -> tuple[Floats, Pull]:
        value = self.offset + shift + sum(term(nets[term.number]) for term in self.terms)
        return value[None], self._pull

    def _pull(self, bar: Floats, slopes: Sequence[Floats]) -> None:
        for term in self.terms:
            slopes[term.number][...] += term.pulled(bar[0])

    def scaled(self, factor: float, plus: float, key: str) -> LinearExcess:
        """Return factor times this excess plus a number, for another limit."""
        terms = [replace(t, scale=factor * t.scale) for t in self.terms]
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


def height_limits(
    lens: Lens, limits: Limits, density: float, made: tuple[int, float], fine: bool
) -> list[Excess]:
    """Return the excesses of every limit of heights that is set; density, made : as of `Part`."""
    found: list[Excess] = []
    for key in ("thickness", "edge_thickness", "centre_thickness"):
        if limit := getattr(limits, key):
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
        (count, more), share = made, mass(1.0, density) / limits.mass
        found.append(_volume(lens).scaled(count * share, more * share - 1.0, "mass"))
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
    spaces = [sag.space.embedding for sag in lens.sags]
    finest = max(range(len(spaces)), key=lambda k: spaces[k].kv_u.dim * spaces[k].kv_v.dim)
    half = lens.free_surfaces[finest].half_width
    (x, wx), (y, wy) = (simpson(kv, fine) for kv in (spaces[finest].kv_u, spaces[finest].kv_v))
    x, y = x / half[0], y / half[1]
    ends, both, one = np.array([-1.0, 1.0]), np.array([0.5, 0.5]), np.ones(1)
    rules = {
        "thickness": [(x, wx, y, wy)],
        "edge_thickness": [(x, wx, ends, both), (ends, both, y, wy)],
        "centre_thickness": [(np.zeros(1), one, np.zeros(1), one)],
    }
    found, unit = list[LinearExcess](), lens.rear.outline.scaled((1.0, 1.0))
    if key == "edge_thickness" and not unit.is_rectangle:
        s, t = _corner_rim(unit, len(x) + len(y))
        found.append(_gap(lens, s, t, np.full((1, len(s)), 1 / len(s)), in_row=True))
    if key != "edge_thickness" or not unit.is_ellipse:
        found += [_gap(lens, s, t, within(unit, s, t, np.outer(ws, wt))) for s, ws, t, wt in rules[key]]
    return found


def _corner_rim(unit: Outline, count: int) -> tuple[Floats, Floats]:
    """Return points on the rim of the corners of an outline, 2 * count + 4 of them."""
    turn = np.linspace(0, np.pi / 2, count // 2 + 1)
    s, t = (1 - c + c * f(turn) for c, f in zip(unit.corners, (np.cos, np.sin)))
    return np.concatenate([s, s, -s, -s]), np.concatenate([t, -t, t, -t])


def _gap(lens: Lens, s: Floats, t: Floats, mean: Floats, in_row: bool = False) -> LinearExcess:
    """Return the gap in mm between equal relative positions s and t, from -1 to 1: on a grid, or in a row."""
    offset, terms = np.full(mean.shape, lens.thickness), list[_Term]()
    for sign, surface in ((-1.0, lens.front), (1.0, lens.rear)):
        x, y = s * surface.half_width[0], t * surface.half_width[1]
        offset += sign * surface.conic(x if in_row else x[:, None], y[None, :])
        if surface.sag is not None:
            kind = _PointTerm if in_row else _Term
            terms.append(kind(len(terms), sign, *_operators(surface, x, y)))
    return LinearExcess("", mean, offset, terms)


def _operators(surface: FreeformSurface, x: Floats, y: Floats) -> tuple[csr_array, csr_array]:
    assert surface.sag is not None
    embedding = surface.sag.space.embedding
    return embedding.kv_u.collocation(x), embedding.kv_v.collocation(y)


def _volume(lens: Lens) -> LinearExcess:
    """Return the volume in mm^3: that of the lens, and the integrals of `volume_between` over the changes."""
    terms: list[_Term | _SumTerm] = []
    offset = lens.volume()
    for name, surface in free_surfaces(lens):
        assert surface.sag is not None
        embedding = surface.sag.space.embedding
        number, net = len({t.number for t in terms}), embedding.coefficients(surface.sag.coefficients)
        if not surface.outline.is_rectangle:
            weights = _weights_inside(lens, name, surface, embedding.kv_u, embedding.kv_v)
            terms.append(_SumTerm(number, 1.0, weights))
            offset -= float((weights * net).sum())
            continue
        for a, b in _integrals(lens, name, embedding.kv_u, embedding.kv_v):
            terms.append(_Term(number, 1.0, csr_array(a[None]), csr_array(b[None])))
            offset -= float(a @ net @ b)
    return LinearExcess("", np.ones((1, 1)), np.full((1, 1), offset), terms)


def _integrals(lens: Lens, name: str, kv_x: KnotVector, kv_y: KnotVector) -> list[tuple[Floats, Floats]]:
    """Return pairs of rows a, b: the volume changes by the sum of a @ net @ b with the net of a surface.

    See `thbcad.sags.volume_between`: with the share k = 1 - w of the front, w of the rear, the Jacobian of
    the solid holds +-a b z - k a b' t z_t - k a' b s z_s, derivatives by the relative positions s and t.
    """
    rules = []
    for kv, h in zip((kv_x, kv_y), getattr(lens, name).half_width):
        x, weights = gauss_rule(kv.breaks, kv.degree // 2 + 2)
        x = np.clip(x, kv.start, kv.stop)
        plain = kv.collocation(x).T @ (weights / h)
        rules.append((plain, kv.collocation(x, 1).T @ (weights * x / h)))  # x d/dx is s d/ds
    (plain_x, turned_x), (plain_y, turned_y) = rules
    rows = []
    for plain, by_y, by_x in _factors(lens, name):
        rows.append((plain * plain_x, plain_y))
        rows.append((by_y * plain_x, turned_y))
        rows.append((by_x * turned_x, plain_y))
    return rows


def _factors(lens: Lens, name: str) -> Iterator[tuple[float, float, float]]:
    """Yield what z, t z_t and s z_s of a surface are multiplied by in the Jacobian, by Gauss's rule in w."""
    (af, bf), (ar, br) = lens.front.half_width, lens.rear.half_width
    sign = -1.0 if name == "front" else 1.0
    for w, weight in zip(*gauss_rule(np.array([0.0, 1.0]), 2)):
        a, b, k = (1 - w) * af + w * ar, (1 - w) * bf + w * br, 1 - w if name == "front" else w
        yield weight * sign * a * b, -weight * k * a * (br - bf), -weight * k * b * (ar - af)


def _weights_inside(
    lens: Lens, name: str, surface: FreeformSurface, kv_x: KnotVector, kv_y: KnotVector
) -> Floats:
    """Return weights: the volume inside the outline changes by their sum times a change of the net."""
    x, y, area = area_rule(surface.outline, kv_x.breaks, kv_y.breaks, kv_x.degree + kv_y.degree)
    x, y = np.clip(x, kv_x.start, kv_x.stop), np.clip(y, kv_y.start, kv_y.stop)
    part = area / np.prod(surface.half_width)
    plain_x, plain_y = kv_x.collocation(x), kv_y.collocation(y)
    integrals = (
        plain_x.T @ (part[:, None] * plain_y),
        plain_x.T @ ((part * y)[:, None] * kv_y.collocation(y, 1)),
        kv_x.collocation(x, 1).T @ ((part * x)[:, None] * plain_y),
    )
    factors = np.sum(list(_factors(lens, name)), axis=0)
    return sum((f * m.toarray() for f, m in zip(factors, integrals)), np.zeros((kv_x.dim, kv_y.dim)))
