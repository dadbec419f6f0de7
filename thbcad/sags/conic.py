"""Conic sections of revolution about z."""

from dataclasses import dataclass
from math import factorial
from typing import Any, TypeVar

import numpy as np
from numpy.polynomial import Legendre
from numpy.typing import ArrayLike

from thbcad.checks import (
    EPS,
    Floats,
    floats,
    require_number,
    require_order,
    require_orders,
    require_type,
    row,
)
from thbcad.splines import QUADRATIC, NURBSCurve

GREATEST = 1e40  # of radius, 1 / radius and conic constant: their products and powers are finite
Coordinate = TypeVar("Coordinate", float, Floats)


@dataclass(frozen=True)
class Conic:
    """The conic z = c r^2 / (1 + sqrt(1 - (1 + K) c^2 r^2)), c = 1 / radius (thesis 3.2).

    radius : float, mm; inf is a plane.  constant : float, K = -1 is a paraboloid.

    Raises ValueError : radius 0, NaN or beyond 1e-40 to 1e40 in size; a constant that is not finite or beyond
        1e40.

    >>> sphere, parabola = Conic(10.0), Conic(10.0, -1.0)
    >>> round(float(sphere(6.0, 0.0)), 12), round(float(parabola(6.0, 0.0)), 12)  # 10 - 8 and 6^2 / 20
    (2.0, 1.8)
    """

    radius: float = np.inf
    constant: float = 0.0

    def __post_init__(self) -> None:
        for name, quantity in (("radius", "radius"), ("constant", "conic constant")):
            require_number(quantity, getattr(self, name), finite=name == "constant")
            object.__setattr__(self, name, float(getattr(self, name)))
        if self.is_plane:
            object.__setattr__(self, "radius", np.inf)
        if self.radius == 0:
            raise ValueError(f"radius must be a number other than 0, got {self.radius}")
        if not self.is_plane and not 1 / GREATEST <= abs(self.radius) <= GREATEST:
            raise ValueError(
                f"radius must be {1 / GREATEST:g} to {GREATEST:g} in size or inf, got {self.radius}"
            )
        if abs(self.constant) > GREATEST:
            raise ValueError(f"conic constant must be at most {GREATEST:g} in size, got {self.constant}")

    def __str__(self) -> str:
        return f"the conic with radius {self.radius} and K {self.constant}"

    @property
    def is_plane(self) -> bool:
        return bool(np.isinf(self.radius))

    @property
    def is_paraboloid(self) -> bool:
        """True where the conic is a polynomial of degree 2: planes and K = -1."""
        return self.is_plane or self.constant == -1.0

    def require(self, half_width: tuple[float, float]) -> None:
        """Raise ValueError unless the conic is defined on the whole rectangle."""
        if self._square(half_width[0] * half_width[0] + half_width[1] * half_width[1]) <= 0:
            corner = np.hypot(*half_width)
            limit = abs(self.radius) / np.sqrt(1 + self.constant)
            raise ValueError(
                f"the conic (radius {self.radius}, K {self.constant}) ends at r = {limit:.6g} mm, "
                f"but the corner of the aperture lies at r = {corner:.6g} mm"
            )

    def __call__(self, x: ArrayLike, y: ArrayLike, derivative: tuple[int, int] = (0, 0)) -> Floats:
        """Return d^(a+b) z / dx^a dy^b for derivative (a, b) of any order, of the shape to which x and y
        broadcast, mm.

        Raises ValueError : points beyond the end of the conic or NaN, an order that is not a non-negative
            integer.
        """
        x, y, orders = floats(x), floats(y), require_orders(derivative)
        r2 = x * x + y * y
        w = self._square(r2)
        if w.size and not w.min() >= 0:
            self._require(r2, w)
            w = np.maximum(w, 0.0)
        return self._derived(x, y, r2, w, orders)

    def _require(self, r2: Floats, w: Floats) -> None:
        """Raise ValueError unless all w >= 0, but for their rounding."""
        bad = ~np.asarray(w >= -4 * EPS)
        if bad.any():
            r = float(np.sqrt(np.asarray(r2)[bad][0]))
            end = float(abs(self.radius) / np.sqrt(1 + self.constant)) if self.constant > -1 else np.inf
            raise ValueError(f"r = {r} lies outside the domain [0.0, {end}]")

    def formula(self, x: Any, y: Any, derivative: tuple[int, int] = (0, 0)) -> Any:
        """Return the same without a look at the numbers: NaN beyond the end, complex for complex ones, and of
        arrays of other libraries theirs."""
        r2 = x * x + y * y
        return self._derived(x, y, r2, self._square(r2), require_orders(derivative))

    def _derived(
        self, x: Coordinate, y: Coordinate, r2: Coordinate, w: Coordinate, orders: tuple[int, int]
    ) -> Coordinate:
        c = 1.0 / self.radius
        result: Coordinate
        if orders == (0, 0):
            result = c * r2 / (1 + np.sqrt(w))
        elif orders == (1, 0):
            result = c * x / np.sqrt(w) + 0 * y
        elif orders == (0, 1):
            result = c * y / np.sqrt(w) + 0 * x
        else:
            m, n = orders
            result = c * factorial(m) * factorial(n) * self._taylor(x, y, w, m, n)
        return result

    def grid(self, x: ArrayLike, y: ArrayLike, derivative: tuple[int, int] = (0, 0)) -> Floats:
        """Return z or a derivative on the grid x x y, (len(x), len(y)).

        Raises ValueError : a grid that extends beyond the end of the conic.
        """
        x, y = row("x", x), row("y", y)
        return self(x[:, None], y[None, :], derivative)

    def _square(self, r2: Coordinate) -> Coordinate:
        """Return w = 1 - (1 + K) c^2 r^2; every root is taken of this very number.

        For K > -1 it falls with r^2, rounding included: where it is positive in the farthest corner of a
        rectangle, it is so everywhere.
        """
        c = 1.0 / self.radius
        return 1 - (1 + self.constant) * c * c * r2

    def _taylor(self, x: Coordinate, y: Coordinate, w: Coordinate, a: int, b: int) -> Coordinate:
        """Return the Taylor coefficient z_ab / c, a + b >= 1, of z(x + s, y + t) = sum z_ij s^i t^j.

        With g^2 = w = 1 + q r^2, q = -(1 + K) c^2, the identity 2 w g_s = w_s g gives the
        coefficients g_ij in turn; z = (1 - g) c / -q makes z_ij = c g_ij / q for i + j >= 1.
        """
        q = -(1 + self.constant) / self.radius**2
        g = {(0, 0): np.sqrt(w)}
        scaled = {}
        for i, j in [(0, j) for j in range(1, b + 1)] + [
            (i, j) for i in range(1, a + 1) for j in range(b + 1)
        ]:
            # the identity in t for the first column, in s for all others
            k, along, before, twice = (i, x, (i - 1, j), (i - 2, j)) if i else (j, y, (i, j - 1), (i, j - 2))
            total = (3 - 2 * k) * along * g[before] + (3 - k) * g.get(twice, 0.0)
            if i:
                total = total - k * (2 * y * g.get((i, j - 1), 0.0) + g.get((i, j - 2), 0.0))
            scaled[i, j] = total / (k * w)
            g[i, j] = q * scaled[i, j]
        result: Coordinate = scaled[a, b]
        return result

    def derivative_bound(self, order: int, axis: int, x: ArrayLike, y: ArrayLike) -> Floats:
        """Return bounds of |d^n z / dx^n| (axis 0) or |d^n z / dy^n| (axis 1) on the cells of a grid.

        K >= -1: every Taylor coefficient in x of order n >= 1 is non-negative for x >= 0 and grows with
        |x| and |y|: the corner of the cell farthest from the axis holds the maximum.
        K < -1: with B = 1 + b^2 y^2, b^2 = -(1 + K) c^2, w = B + b^2 x^2 and the Legendre polynomial P,

            |d^n z / dx^n| = (n - 2)! |c| b^(n-2) B w^(-(n+1)/2) |P'_(n-1)(b x / sqrt(w))|,

        whose factors are bounded one by one.

        order : int n >= 2.  x : (n_x + 1,) float, y : (n_y + 1,) float, increasing, mm.
        Returns (n_x, n_y) float, mm^(1 - n).

        Source: NIST Digital Library of Mathematical Functions 18.12.4 (generating function), with 18.7.9 and
        18.9.19.
        """
        require_order(order)
        if order < 2:
            raise ValueError(f"order must be at least 2, got {order}")
        if axis == 1:
            return self.derivative_bound(order, 0, y, x).T
        (near, far), (low, high) = _distances(x), _distances(y)
        if self.constant >= -1:
            far = far[:, None]
            high = high[None, :]
            w = self._square(far * far + high * high)
            # the terms are all positive; what matters is the rounding of w, at most 8 EPS / w of it, in
            # w^(1/2 - n)
            corner: Floats = abs(self.formula(far, high, (order, 0)))
            return corner * (1 + 16 * order * EPS / w)
        return self._hyperboloid_bound(
            order, (near[:, None], far[:, None]), (low[None, :], high[None, :])
        ) * (1 + 16 * order * EPS)

    def _hyperboloid_bound(self, n: int, x: tuple[Floats, Floats], y: tuple[Floats, Floats]) -> Floats:
        """Return the bound for K < -1 where |x| and |y| lie between the given numbers."""
        b2 = -(1 + self.constant) / self.radius**2
        (near, far), (low, high) = (tuple(b2 * a**2 for a in pair) for pair in (x, y))
        # B w^(-(n+1)/2) is greatest at B = 2 b^2 x^2 / (n - 1) with the least x, or at the end next to it
        height = np.clip(2 * near / (n - 1), 1 + low, 1 + high)
        slope = Legendre.basis(n - 1).deriv()
        first = np.sqrt(near / (1 + high + near))
        last = np.sqrt(far / (1 + low + far))
        positions = [first, last, *(np.clip(root, first, last) for root in slope.deriv().roots())]
        # n^4 is a bound of the second derivative of P and of the growth of rounding errors in its first
        steepest = np.max([abs(slope(position)) for position in positions], axis=0) + 2 * n**4 * EPS
        result: Floats = (
            factorial(n - 2)
            / abs(self.radius)
            * b2 ** (n / 2 - 1)
            * height
            * (height + near) ** (-(n + 1) / 2)
            * steepest
        )
        return result

    def rounding(self, x: ArrayLike, y: ArrayLike) -> float:
        """Return a bound of the rounding errors of the values on the rectangle that the rows x and y span,
        mm.

        The error of the root g is at most that of its argument, 4 EPS |1 - g^2|, over 2 g; the
        other operations add up to 6 EPS.  Both are greatest in the farthest corner.
        """
        far, high = (float(abs(np.asarray(a)).max()) for a in (x, y))
        root = np.sqrt(self._square(far * far + high * high))
        return float(EPS * abs(self.formula(far, high)) * (6 + 2 * abs(1 - root) / root))


def _distances(breaks: ArrayLike) -> tuple[Floats, Floats]:
    """Return the least and the greatest distance from 0 of every interval of a row of breaks."""
    a, b = np.asarray(breaks, dtype=np.float64)[:-1], np.asarray(breaks, dtype=np.float64)[1:]
    return np.maximum(np.maximum(a, -b), 0), np.maximum(abs(a), abs(b))


def meridian(conic: Conic, radius: float) -> NURBSCurve:
    """Return the points (r, z) of a lens conic from its vertex to r = `radius`, exactly, over [0, 1].

    With s = sqrt(1 - (1 + K) c^2 r^2) the points are (0, 0), (r / (1 + s), 0), (r, z(r)) and the
    weights 1, 1, 2 / (1 + s): the conic r^2 = 2 R z - (1 + K) z^2 cut by the lines z = t r, with
    t proportional to u.  This covers all K and planes; s = 0 is the equator of a sphere.

    radius : float, mm.

    Raises ValueError : radius not positive, or beyond the end of the conic.
    """
    require_type("conic", conic, Conic)
    require_number("radius", radius, above=0, finite=True)
    square = 1 - (1 + conic.constant) * (radius / conic.radius) ** 2
    if square < 0:
        limit = abs(conic.radius) / np.sqrt(1 + conic.constant)
        raise ValueError(
            f"the conic (radius {conic.radius}, K {conic.constant}) ends at r = {limit:.6g} mm, before r = "
            f"{radius:.6g} mm"
        )
    divisor = 1 + np.sqrt(square)
    points = [[0.0, 0.0], [radius / divisor, 0.0], [radius, radius**2 / (conic.radius * divisor)]]
    return NURBSCurve(QUADRATIC, np.array(points), np.array([1.0, 1.0, 2 / divisor]))
