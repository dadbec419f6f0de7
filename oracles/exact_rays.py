"""Rays through quadratic surfaces in 60 decimal digits, and how far rounded results may be from them.

Surfaces are z = c + c_x x + c_y y + a x^2 + b y^2, whose meeting points, normals and refraction need square
roots only. `sensitivity` moves the data - rays, coefficients, index - by a rounding each and adds up what
that does to a result: an error of r times as much is what exact arithmetic makes of data that are wrong by r
roundings.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal, localcontext
from math import comb

import numpy as np
from numpy.typing import ArrayLike, NDArray

from thbcad import Conic, FreeformSurface, KnotVector, Lens, THBSpace, THBSurface

DIGITS = 60
STEP = Decimal(10) ** -30  # of the derivatives by data
BESIDE, MISSED, TOTAL, ARRIVES = range(4)  # fates
Exact = NDArray[np.object_]


@dataclass(frozen=True, eq=False)
class Quadric:
    """z = c + c_x x + c_y y + a x^2 + b y^2 over |x|, |y| <= half; terms : (c, c_x, c_y, a, b), mm."""

    terms: Sequence[float | Decimal]
    half: float

    def surface(self, degree: int = 3, spans: int = 4, share: float = 0.5, depth: int = 0) -> FreeformSurface:
        """Return it as a conic plus a spline: the conic takes `share` of a; `depth` times the cells of a
        corner are refined."""
        c, cx, cy, a, b = self.terms
        conic = share * a
        kv = KnotVector.uniform(degree, spans, -self.half, self.half)
        x, square = kv.greville(), _squares(kv)
        net = (
            c
            + cx * x[:, None]
            + cy * x[None, :]
            + (a - conic) * square[:, None]
            + (b - conic) * square[None, :]
        )
        sag = THBSurface(THBSpace(kv, kv), net.ravel())
        for level in range(depth):
            sag = sag.refine({level: np.argwhere(np.ones((spans, spans)))})
        return FreeformSurface((self.half, self.half), Conic(0.5 / conic if conic else np.inf, -1.0), sag)


@dataclass(frozen=True, eq=False)
class Setup:
    """A lens of two Quadrics, and rays towards a target plane.

    origin, direction : (3, n).  distance : mm behind the rear vertex; inf is the far field, where landing
    points are angles in degrees.
    """

    front: Quadric
    rear: Quadric
    thickness: float
    index: float
    distance: float
    origin: ArrayLike
    direction: ArrayLike

    def lens(self, **spline: float) -> Lens:
        return Lens(self.front.surface(**spline), self.rear.surface(**spline), self.thickness, self.index)

    def scaled(self, factor: float) -> Setup:
        """Return the same in other units."""
        surfaces = (
            Quadric([t * factor**k for t, k in zip(q.terms, (1, 0, 0, -1, -1))], q.half * factor)
            for q in (self.front, self.rear)
        )
        return Setup(
            *surfaces,
            self.thickness * factor,
            self.index,
            self.distance * factor,
            self.origin * factor,
            self.direction,
        )


@dataclass(frozen=True, eq=False)
class Traced:
    """What becomes of rays, each (n,): fate, landing point in mm, share of the flux; zeros unless they
    arrive."""

    fate: NDArray[np.int64]
    x: Exact
    y: Exact
    share: Exact


def exact_trace(setup: Setup) -> Traced:
    """Return the exact results for the data as they are."""
    with localcontext() as context:
        context.prec = DIGITS
        origin, direction = _decimal(setup.origin), _decimal(setup.direction)
        direction = direction / _root(sum(direction * direction))
        index, thickness, distance = (Decimal(a) for a in (setup.index, setup.thickness, setup.distance))
        point, normal, met = _meet(setup.front, origin, direction)
        planes, before = [np.cross(direction, normal, axis=0)], direction
        direction, at_front, entered = _refract(direction, normal, 1 / index)
        point = np.stack([point[0], point[1], point[2] - thickness])
        point, normal, hit = _meet(setup.rear, point, direction)
        planes, before = [*planes, np.cross(direction, normal, axis=0)], direction
        direction, at_rear, passes = _refract(direction, normal, index)
        passes = passes & (direction[2] > 0)
        fate = np.where(met & entered, np.where(hit, np.where(passes, ARRIVES, TOTAL), MISSED), BESIDE)
        arrives = fate == ARRIVES
        across = direction[:2] / np.where(arrives, direction[2], Decimal(1))
        landing = point[:2] + (distance - point[2]) * across if distance.is_finite() else _degrees(across)
        return Traced(
            fate,
            *(
                np.where(arrives, r, Decimal(0))
                for r in (*landing, _passing(at_front, at_rear, planes, before))
            ),
        )


def sensitivity(setup: Setup) -> list[NDArray[np.float64]]:
    """Return by how much x, y (mm) and the share move where every datum and the result itself move by 1 unit
    of roundoff, (n,) each."""
    with localcontext() as context:
        context.prec = DIGITS
        base = exact_trace(setup)
        total = [abs(r).astype(float) for r in (base.x, base.y, base.share)]
        for other in map(exact_trace, _moved(setup, STEP)):
            same = (other.fate == base.fate) & (base.fate == ARRIVES)
            pairs = ((base.x, other.x), (base.y, other.y), (base.share, other.share))
            total = [
                t + np.where(same, abs(b - a) / STEP, 0).astype(float) for t, (a, b) in zip(total, pairs)
            ]
        return total


def fates_nearby(setup: Setup, unit: float) -> NDArray[np.int64]:
    """Return the fates where one datum after the other moves by -unit and unit, (moves, n)."""
    return np.stack(
        [exact_trace(other).fate for sign in (-1, 1) for other in _moved(setup, sign * Decimal(unit))]
    )


def _moved(setup: Setup, step: Decimal) -> list[Setup]:
    """Return the setup with one datum moved: lengths relative to the lens and the ray's coordinates,
    directions and slopes to 1."""
    with localcontext() as context:
        context.prec = DIGITS
        size = Decimal(max(setup.rear.half, setup.thickness))
        origin, direction = _decimal(setup.origin), _decimal(setup.direction)
        far, out = size + abs(origin).max(axis=0), []
        for k in range(3):
            unit = np.array([[Decimal(int(i == k))] for i in range(3)])
            out += [
                replace(setup, origin=origin + step * unit * far),
                replace(setup, direction=direction + step * unit),
            ]
        out += [
            replace(setup, **{name: Decimal(getattr(setup, name)) * (1 + step)})
            for name in ("index", "thickness", "distance")
        ]
        for name in ("front", "rear"):
            quadric = getattr(setup, name)
            for k, scale in enumerate((size, 1, 1, 1 / size, 1 / size)):
                terms = [Decimal(t) for t in quadric.terms]
                terms[k] += step * scale
                out.append(replace(setup, **{name: Quadric(terms, quadric.half)}))
        return out


def difference(exact: Exact, found: NDArray[np.floating]) -> NDArray[np.float64]:
    """Return |found - exact|, taken before anything is rounded."""
    with localcontext() as context:
        context.prec = DIGITS
        return np.array([float(abs(Decimal(float(b)) - a)) for a, b in zip(exact, found)])


def _meet(quadric: Quadric, origin: Exact, direction: Exact) -> tuple[Exact, Exact, NDArray[np.bool_]]:
    """Return (points, normals towards +z, met) where rays fall through the surface, from - A t^2 - B t - C =
    ray height - height."""
    c, cx, cy, a, b = (Decimal(t) for t in quadric.terms)
    (ox, oy, oz), (dx, dy, dz) = origin, direction
    quadratic = a * dx * dx + b * dy * dy
    linear = 2 * (a * ox * dx + b * oy * dy) + cx * dx + cy * dy - dz
    constant = c + cx * ox + cy * oy + a * ox * ox + b * oy * oy - oz
    square = linear * linear - 4 * quadratic * constant
    root = _root(np.maximum(square, Decimal(0)))
    rest, curved = root - linear, quadratic != 0
    t = np.where(
        linear < 0,
        2 * constant / np.where(rest != 0, rest, 1),
        -(root + linear) / np.where(curved, 2 * quadratic, 1),
    )
    x, y, z = origin + t * direction
    half = Decimal(quadric.half)
    met = (square >= 0) & (t >= 0) & (abs(x) <= half) & (abs(y) <= half) & ((linear < 0) | curved)
    normal = np.stack([-cx - 2 * a * x, -cy - 2 * b * y, x * 0 + 1])
    return np.stack([x, y, z]), normal / _root(sum(normal * normal)), met.astype(bool)


def _refract(direction: Exact, normal: Exact, eta: Decimal) -> tuple[Exact, Exact, NDArray[np.bool_]]:
    """Return (directions, transmittances of s and of p, passes): Snell's law as vectors, Fresnel's
    amplitudes."""
    cos_i = sum(direction * normal)
    square = 1 - eta * eta * (1 - cos_i * cos_i)
    passes = ((square > 0) & (cos_i > 0)).astype(bool)
    cos_t = _root(np.where(passes, square, Decimal(1)))
    reflected = [
        (p - q) / np.where(p + q != 0, p + q, 1) for p, q in ((eta * cos_i, cos_t), (cos_i, eta * cos_t))
    ]
    shares = np.stack([np.where(passes, 1 - r * r, Decimal(0)) for r in reflected])
    return eta * direction + (cos_t - eta * cos_i) * normal, shares, passes


def _passing(front: Exact, rear: Exact, planes: Sequence[Exact], between: Exact) -> Exact:
    """Return what two faces pass of unpolarised light, m M + h H cos 2a.

    m, h of the front and M, H of the rear are half the sum and half the difference of the transmittances of s
    and p; a is the angle between the planes of incidence about the direction between.
    """
    (mean, half), (mean_rear, half_rear) = (((s + p) / 2, (s - p) / 2) for s, p in (front, rear))
    along, across = sum(planes[0] * planes[1]), sum(np.cross(*planes, axis=0) * between)
    size = along * along + across * across
    twice = (along * along - across * across) / np.where(size > 0, size, Decimal(1))
    return mean * mean_rear + half * half_rear * twice


def _degrees(tangent: Exact) -> Exact:
    """Return the angles, in degrees, of which these are the tangents."""
    return _arctan(tangent) / _arctan(Decimal(1)) * 45


def _arctangent(tangent: Decimal) -> Decimal:
    """Return x - x^3 / 3 + x^5 / 5 ... of the tangent of an eighth of the angle, times eight."""
    for _ in range(3):
        tangent = tangent / (1 + (1 + tangent * tangent).sqrt())
    total, power, k = Decimal(0), tangent, 1
    while abs(power) > Decimal(10) ** (-DIGITS - 10):
        total += power / k
        power, k = -power * tangent * tangent, k + 2
    return 8 * total


def _squares(kv: KnotVector) -> NDArray[np.float64]:
    """Return the B-spline coefficients of x^2: the mean product of two of the p inner knots of every
    function."""
    inner = np.stack([kv.knots[k : k + kv.dim] for k in range(1, kv.degree + 1)])
    return (inner.sum(axis=0) ** 2 - (inner**2).sum(axis=0)) / 2 / comb(kv.degree, 2)


_decimal: Callable[[ArrayLike], Exact] = np.vectorize(Decimal, otypes=[object])
_arctan: Callable[[ArrayLike | Decimal], Exact] = np.vectorize(_arctangent, otypes=[object])
_root: Callable[[Exact], Exact] = np.vectorize(Decimal.sqrt, otypes=[object])
