"""Polynomial sags over a rectangle: Chebyshev, Legendre and Zernike terms.

Every sag is kept in tensor-product Chebyshev polynomials, in which values, derivatives and bounds
are well conditioned.  `approximated` turns it into a spline: exactly, but for
rounding, where the degrees of the spline suffice.

Source: L. N. Trefethen, Approximation Theory and Approximation Practice, chapters 3 and 4; V.
Lakshminarayanan and A. Fleck, Zernike polynomials: a guide, J. Mod. Opt. 58 (2011), for the OSA/ANSI
convention.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import isqrt, sqrt

import numpy as np
from numpy.polynomial import chebyshev, legendre
from numpy.typing import ArrayLike
from scipy.special import eval_jacobi

from thbcad.checks import (
    EPS,
    Floats,
    coordinates,
    floats,
    half_widths,
    inside,
    read_only,
    require_integer,
    require_number,
    require_order,
    require_orders,
    row,
)
from thbcad.sags.proven_approximation import cell_maxima, lebesgue_bound, lobatto_nodes, node_slack
from thbcad.values import Value


@dataclass(frozen=True, eq=False)
class PolynomialSag(Value):
    """The sag z(x, y) = sum_mn c_mn T_m(x / h_x) T_n(y / h_y), T_m the Chebyshev polynomials.

    half_width : (h_x, h_y) float, mm
    coefficients : (degree in x + 1, degree in y + 1) float, mm

    Raises ValueError : half-widths that are not positive, coefficients that are not a finite table.

    >>> sag = PolynomialSag.zernike((5.0, 5.0), radius=5.0, terms={(2, 0): 0.1})  # defocus
    >>> round(float(sag(5.0, 0.0) / (0.1 * np.sqrt(3))), 14)  # 2 rho^2 - 1 at the rim
    1.0
    """

    half_width: tuple[float, float]
    coefficients: Floats

    def __init__(self, half_width: ArrayLike, coefficients: ArrayLike) -> None:
        h, c = half_widths(half_width), read_only(coefficients)
        if c.ndim != 2 or c.size == 0 or not np.isfinite(c).all():
            raise ValueError(f"coefficients must be a table of finite numbers, got shape {c.shape}")
        vars(self).update(half_width=h, coefficients=c)

    def __repr__(self) -> str:
        (a, b), (m, n) = self.half_width, self.coefficients.shape
        return f"PolynomialSag({2 * a:g} x {2 * b:g} mm, degree {m - 1, n - 1})"

    @classmethod
    def legendre(cls, half_width: ArrayLike, coefficients: ArrayLike) -> PolynomialSag:
        """Return the sag sum_mn a_mn P_m(x / h_x) P_n(y / h_y) with Legendre polynomials P_m, a in mm."""
        a = floats(coefficients)
        if a.ndim != 2 or a.size == 0:
            raise ValueError(f"coefficients must be a table, got shape {a.shape}")
        s, t = (chebyshev.chebpts1(n) for n in a.shape)
        return cls(half_width, _coefficients(np.asarray(legendre.leggrid2d(s, t, a), dtype=np.float64)))

    @classmethod
    def zernike(
        cls, half_width: ArrayLike, radius: float, terms: Mapping[tuple[int, int], float]
    ) -> PolynomialSag:
        """Return the sag sum a_nm Z_nm(x / radius, y / radius) on a rectangle, which may extend beyond the
        disk.

        terms : {(n, m): a_nm in mm}, see `zernike`; ``osa_orders(j)`` gives the (n, m) of an OSA/ANSI index j
        radius : float, mm, the radius of the disk on which the terms are orthogonal
        """
        require_number("radius", radius, above=0, finite=True)
        h, sizes = half_widths(half_width), floats(list(terms.values()))
        nodes = chebyshev.chebpts1(1 + max((n for n, _ in terms), default=0))
        s, t = (width / radius * nodes for width in h)
        values = sum(
            (a * zernike(n, m, s[:, None], t[None, :]) for (n, m), a in zip(terms, sizes)),
            np.zeros((len(nodes),) * 2),
        )
        return cls(h, _coefficients(values))

    def __str__(self) -> str:
        return f"the polynomial sag of degrees {self.degrees}"

    @property
    def degrees(self) -> tuple[int, int]:
        """Degrees in x and y."""
        return self.coefficients.shape[0] - 1, self.coefficients.shape[1] - 1

    def derivative(self, a: int, b: int) -> PolynomialSag:
        """Return d^(a+b) z / dx^a dy^b, whose values are in mm^(1 - a - b)."""
        c = self.coefficients
        for axis, order in enumerate((a, b)):
            require_order(order)
            by_axis = chebyshev.chebder(c, int(order), scl=1 / self.half_width[axis], axis=axis)
            c = np.asarray(by_axis, dtype=np.float64)
        return PolynomialSag(self.half_width, c)

    def __call__(self, x: ArrayLike, y: ArrayLike, derivative: tuple[int, int] = (0, 0)) -> Floats:
        """Return z or a derivative at points (x, y), of the shape to which x and y broadcast.

        Raises ValueError : points outside the rectangle or NaN, shapes that do not broadcast, an order that
            is not a non-negative integer.
        """
        orders = require_orders(derivative)
        derived = self.derivative(*orders) if any(orders) else self
        a, b = self.half_width
        x, y = coordinates(x=(x, (-a, a)), y=(y, (-b, b)))
        values = np.asarray(chebyshev.chebval2d(x / a, y / b, derived.coefficients), dtype=np.float64)
        return values[()]

    def grid(self, x: ArrayLike, y: ArrayLike, derivative: tuple[int, int] = (0, 0)) -> Floats:
        """Return z or a derivative on the grid x x y, (len(x), len(y)); numbers outside are refused."""
        derived = self.derivative(*require_orders(derivative))
        by_x, by_y = (
            chebyshev.chebvander(a / h, n)
            for a, h, n in zip(self._inside(row("x", x), row("y", y)), self.half_width, derived.degrees)
        )
        return by_x @ derived.coefficients @ by_y.T

    def derivative_bound(self, order: int, axis: int, x: ArrayLike, y: ArrayLike) -> Floats:
        """Return bounds of |d^order z| along an axis on the cells of a grid within the rectangle.

        The derivative is the polynomial that interpolates it at (degree + 1)^2 nodes of a cell, so that
        Lebesgue constants times the greatest value there are a bound.

        x : (n_x + 1,) float, y : (n_y + 1,) float, increasing, mm.  Returns (n_x, n_y) float, mm^(1 - order).
        """
        require_order(order)
        self._inside(x, y)
        orders = (order, 0) if axis == 0 else (0, order)
        derived = self.derivative(*orders)
        p, q = (max(n, 1) for n in derived.degrees)
        at_nodes = cell_maxima(derived.grid(lobatto_nodes(x, p), lobatto_nodes(y, q)), (p, q))
        # coefficients of derivatives are sums of multiples >= 0 of those of z: rounding errs relative to the
        # sums of the sizes
        sizes = PolynomialSag(self.half_width, abs(self.coefficients)).derivative(*orders)
        allowance = 2 * self._roundings() * sizes.coefficients.sum()
        slack = node_slack(x, p)[:, None] * node_slack(y, q)[None, :]
        result: Floats = slack * lebesgue_bound(p) * lebesgue_bound(q) * (at_nodes + allowance)
        return result

    def rounding(self, x: ArrayLike, y: ArrayLike) -> float:
        """Return a bound of the rounding errors of `grid` on the rectangle that the rows x and y span, mm."""
        self._inside(x, y)
        return float(self._roundings() * abs(self.coefficients).sum())

    def _roundings(self) -> float:
        """Return the rounding error of `grid` for coefficients whose sizes add up to 1.

        The three-term recurrence errs by 3/2 m^2 roundings in T_m, the division x / h by m^2 more, the sums
        by m + 2.
        """
        return sum(1.5 * m * m + m + 2 for m in self.degrees) * EPS

    def _inside(self, x: ArrayLike, y: ArrayLike) -> list[Floats]:
        """Return both rows of a grid; refuse numbers outside the rectangle."""
        return [inside(name, a, (-h, h)) for name, a, h in zip("xy", (x, y), self.half_width)]


def zernike(n: int, m: int, x: ArrayLike, y: ArrayLike) -> Floats:
    """Return the Zernike polynomial of degree n and azimuthal frequency m, of mean square 1 over the unit
    disk.

    With x = rho cos(theta), y = rho sin(theta) and the radial polynomial R, R(1) = 1,

        Z_nm = sqrt(2 (n + 1) / (1 + [m = 0])) R_n^|m|(rho) cos(m theta),     sin(|m| theta) for m < 0
        R_n^m = rho^m P_k^(0, m)(2 rho^2 - 1),     k = (n - m) / 2, P a Jacobi polynomial.

    x and y broadcast and may lie outside the disk.

    Raises ValueError : unless n - |m| is even and not negative.
    """
    if n < abs(m) or (n - m) % 2:
        raise ValueError(f"a Zernike term needs |m| <= n with n - m even, got n = {n}, m = {m}")
    x, y = floats(x), floats(y)
    turned = (x + 1j * y) ** abs(m)
    radial = eval_jacobi((n - abs(m)) // 2, 0, abs(m), 2 * (x * x + y * y) - 1)
    result: Floats = sqrt((n + 1) * (1 if m == 0 else 2)) * radial * (turned.real if m >= 0 else turned.imag)
    return result


def osa_orders(j: int) -> tuple[int, int]:
    """Return (n, m) of the OSA/ANSI index j = (n (n + 2) + m) / 2."""
    require_integer("a Zernike index", j, 0)
    n = (isqrt(8 * int(j) + 1) - 1) // 2
    return n, 2 * int(j) - n * (n + 2)


def _coefficients(values: Floats) -> Floats:
    """Return the Chebyshev coefficients of the polynomial with these values at the Chebyshev points, of the
    same shape."""
    by_x, by_y = (chebyshev.chebvander(chebyshev.chebpts1(n), n - 1) for n in values.shape)
    return np.linalg.solve(by_y, np.linalg.solve(by_x, values).T).T
