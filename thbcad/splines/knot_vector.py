"""Univariate B-splines: clamped knot vectors and their exact operators.

Source: T. Lyche and K. Moerken, Spline Methods, chapters 2-4; thesis 3.5-3.9 and 3.30-3.35.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import SupportsIndex

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array

from thbcad.checks import (
    Floats,
    Integers,
    floats,
    inside,
    read_only,
    require_degree,
    require_number,
    require_order,
    require_sorted,
    require_subset,
    require_type,
    uniform_breaks,
)
from thbcad.splines.polar_forms import bezier_rows, blossom_rows, greville_abscissae
from thbcad.splines.sparse_operators import band_matrix, banded_least_squares
from thbcad.values import Value


@dataclass(frozen=True, eq=False)
class KnotVector(Value):
    """A clamped knot vector t_0 <= ... <= t_(m) of degree p with ``dim = m - p`` functions.

    The first and the last p + 1 knots are equal; an interior knot occurs at most p times.

    Raises
    ------
    ValueError : degree outside 1..10; knots that are not finite, not sorted, not clamped or
        repeated too often.

    Examples
    --------
    >>> kv = KnotVector.uniform(degree=3, spans=4)
    >>> c = kv.greville() ** 2
    >>> finer = kv.insert([0.3, 0.7])  # the same spline with more knots
    >>> u = [0.1, 0.5, 0.9]
    >>> np.allclose(finer.collocation(u) @ (kv.prolongation(finer) @ c), kv.collocation(u) @ c, rtol=1e-15)
    True
    """

    degree: int
    knots: Floats

    def __init__(self, degree: SupportsIndex, knots: ArrayLike) -> None:
        require_degree(degree)
        p, t = int(degree), read_only(knots)
        if t.ndim != 1 or len(t) < 2 * p + 2:
            raise ValueError(
                f"knots must be one row of at least 2 * degree + 2 = {2 * p + 2} numbers, got shape {t.shape}"
            )
        require_sorted(t)
        if t[p] != t[0] or t[-p - 1] != t[-1] or t[0] == t[-1]:
            raise ValueError(
                f"the first and the last {p + 1} knots must be equal (clamped) and differ from each other"
            )
        same = t[1 : -p - 1] == t[p + 1 : -1]
        if same.any():
            raise ValueError(
                f"knot {t[1 : -p - 1][same][0]} occurs more than degree = {p} times in the interior"
            )
        vars(self).update(degree=p, knots=t)

    @classmethod
    def uniform(
        cls, degree: SupportsIndex, spans: SupportsIndex, start: float = 0.0, stop: float = 1.0
    ) -> KnotVector:
        """Return the clamped knot vector with `spans` equal spans on [start, stop]."""
        return cls.clamped(degree, uniform_breaks(spans, start, stop)[1:-1], start, stop)

    @classmethod
    def clamped(cls, degree: SupportsIndex, inner: ArrayLike, start: float, stop: float) -> KnotVector:
        """Return the knot vector on [start, stop] with the given inner knots, (n,), a double knot written
        twice.

        Raises
        ------
        ValueError : as the class.
        """
        require_degree(degree)
        p = int(degree)
        return cls(p, np.r_[[start] * (p + 1), floats(inner), [stop] * (p + 1)])

    def __repr__(self) -> str:
        return (
            f"KnotVector(degree {self.degree}, {self.spans} spans on [{self.start:g}, {self.stop:g}], "
            f"dim {self.dim})"
        )

    @property
    def dim(self) -> int:
        """Number of B-splines."""
        return len(self.knots) - self.degree - 1

    @property
    def start(self) -> float:
        """Left end of the domain."""
        return float(self.knots[0])

    @property
    def stop(self) -> float:
        """Right end of the domain."""
        return float(self.knots[-1])

    @cached_property
    def domain(self) -> tuple[float, float]:
        """Both ends of the domain."""
        return self.start, self.stop

    @cached_property
    def breaks(self) -> Floats:
        """Distinct knots, (spans + 1,)."""
        return read_only(np.unique(self.knots))

    @property
    def spans(self) -> int:
        """Number of non-empty knot spans."""
        return len(self.breaks) - 1

    def greville(self) -> Floats:
        """Return the Greville abscissae g_i = (t_(i+1) + ... + t_(i+p)) / p, (dim,).

        The spline with these coefficients is the identity (thesis 3.16).
        """
        return greville_abscissae(self.knots, self.degree)

    def inner_knots(self) -> Floats:
        """Return the inner knots t_(i+1) ... t_(i+p) of every function, (dim, p): coefficient i is the polar
        form there."""
        result: Floats = self.knots[np.arange(self.dim)[:, None] + np.arange(1, self.degree + 1)]
        return result

    def span_of(self, u: ArrayLike) -> Integers:
        """Return for each u the index mu with t_mu <= u < t_(mu+1); the end counts to the last span.

        Raises
        ------
        ValueError : u that is NaN or outside [start, stop].
        """
        right = np.searchsorted(self.knots, inside("u", u, self.domain), side="right")
        return np.minimum(right - 1, self.dim - 1)

    def basis(self, u: ArrayLike, derivative: int = 0) -> tuple[Integers, Floats]:
        """Return (first, values): at u only functions first .. first + p differ from zero.

        u : (n,) float.  first : (n,) int.  values : (n, p + 1) float.

        Raises
        ------
        ValueError : u that is no row, NaN or outside the domain; an order that is not a non-negative integer.
        """
        require_order(derivative)
        u = np.atleast_1d(floats(u))
        if u.ndim != 1:
            raise ValueError(f"u must be one row of numbers, got shape {u.shape}")
        span = self.span_of(u)
        arguments = np.broadcast_to(u[:, None], (len(u), self.degree))
        return span - self.degree, blossom_rows(self.knots, self.degree, span, arguments, int(derivative))

    def collocation(self, u: ArrayLike, derivative: int = 0) -> csr_array[np.float64]:
        """Return the matrix A[k, i] = d^r/du^r N_i(u_k), csr_array (len(u), dim).

        Raises
        ------
        ValueError : as `basis`.
        """
        first, values = self.basis(u, derivative)
        return band_matrix(first, values, self.dim)

    def integrals(self) -> Floats:
        """Return the integrals of the B-splines, (t_(i+p+1) - t_i) / (p + 1), (dim,)."""
        return (self.knots[self.degree + 1 :] - self.knots[: self.dim]) / (self.degree + 1)

    def insert(self, knots: ArrayLike) -> KnotVector:
        """Return the knot vector with the given knots added (repeats raise the multiplicity).

        Raises
        ------
        ValueError : a knot outside the open domain, or more than p times in all.
        """
        new = np.atleast_1d(floats(knots))
        bad = ~((new > self.start) & (new < self.stop))
        if bad.any():
            raise ValueError(
                f"inserted knot {new[bad][0]} lies outside the open domain ({self.start}, {self.stop})"
            )
        return KnotVector(self.degree, np.sort(np.r_[self.knots, new], kind="stable"))

    def bisect(self) -> KnotVector:
        """Return the knot vector with one knot more in the middle of every non-empty span."""
        b = self.breaks
        return self.insert(b[:-1] + np.diff(b) / 2)

    def merged(self, other: KnotVector) -> KnotVector:
        """Return the knot vector with the knots of both, each as often as in the one that has it more often.

        Raises
        ------
        ValueError : `other` is no KnotVector or has another degree, start or stop.
        """
        require_type("other", other, KnotVector)
        if (self.degree, self.start, self.stop) != (other.degree, other.start, other.stop):
            raise ValueError(f"knot vectors to merge must agree in degree and ends, got {self} and {other}")
        values = np.unique(np.r_[self.knots, other.knots])
        counts = [
            np.searchsorted(t, values, "right") - np.searchsorted(t, values, "left")
            for t in (self.knots, other.knots)
        ]
        return KnotVector(self.degree, np.repeat(values, np.maximum(*counts)))

    def rescaled(self, start: float, stop: float) -> KnotVector:
        """Return the knot vector mapped linearly onto [start, stop].

        Raises
        ------
        ValueError : start that is not less than stop, or so near that knots coincide.
        """
        for name, end in (("start", start), ("stop", stop)):
            require_number(name, end, finite=True)
        start, stop = float(start), float(stop)
        if (self.start, self.stop) == (start, stop):
            return self
        fraction = (self.knots - self.start) / (self.stop - self.start)
        return KnotVector(self.degree, np.where(fraction == 1, stop, start + (stop - start) * fraction))

    def prolongation(self, finer: KnotVector) -> csr_array[np.float64]:
        """Return the refinement operator, csr_array (finer.dim, dim), with C_finer = P @ C.

        Row j holds the polar form at the knots tau_(j+1) .. tau_(j+p) of the finer vector
        (thesis 3.30-3.35, where R = P.T).

        Raises
        ------
        ValueError : `finer` is no KnotVector, lacks a knot of this vector or has another degree.
        """
        require_type("finer", finer, KnotVector)
        if finer.degree != self.degree:
            raise ValueError(f"degrees differ: {self.degree} and {finer.degree}")
        require_subset(self.knots, finer.knots)
        return self._polar(finer)

    def restriction(self, coarser: KnotVector) -> csr_array[np.float64]:
        """Return Q = (P^T P)^-1 P^T, csr_array (coarser.dim, dim), with P = coarser.prolongation(self): Q @ P
        == identity.

        Q @ c are the coefficients on the coarser knots that come closest to c in least squares.  Q is full:
        it takes coarser.dim * dim numbers.

        Raises
        ------
        ValueError : `coarser` is no KnotVector, has a knot that this vector lacks or another degree.
        """
        require_type("coarser", coarser, KnotVector)
        return csr_array(banded_least_squares(coarser.prolongation(self), self.degree, np.eye(self.dim)))

    def segment(self, start: float, stop: float) -> tuple[KnotVector, csr_array[np.float64]]:
        """Return the clamped knot vector of the piece on [start, stop] and the operator to its coefficients,
        csr_array (piece.dim, dim).

        Splitting at u is the two segments [start, u] and [u, stop].

        Raises
        ------
        ValueError : unless self.start <= start < stop <= self.stop.
        """
        for name, end in (("start", start), ("stop", stop)):
            require_number(name, end)
        if not self.start <= start < stop <= self.stop:
            raise ValueError(
                f"a segment needs {self.start} <= start < stop <= {self.stop}, got {start} and {stop}"
            )
        inner = self.knots[(self.knots > start) & (self.knots < stop)]
        piece = KnotVector.clamped(self.degree, inner, start, stop)
        return piece, self._polar(piece)

    def bezier(self) -> csr_array[np.float64]:
        """Return the Bezier extraction, csr_array (spans (p + 1), dim): Bernstein coefficients of every span
        in turn.

        Coefficient k of the span [a, b] is the polar form at p - k times a and k times b.
        """
        p = self.degree
        span = self.span_of(self.breaks[:-1])
        rows = bezier_rows(self.knots[span + np.arange(1 - p, p + 1)[:, None]])
        return band_matrix(np.repeat(span - p, p + 1), rows.reshape(-1, p + 1), self.dim)

    def _polar(self, piece: KnotVector) -> csr_array[np.float64]:
        """Return the operator to the coefficients on `piece`, clamped knots that hold those of this vector
        there: polar forms at its knots."""
        p = self.degree
        span = self.span_of(piece.knots[: piece.dim])
        return band_matrix(span - p, blossom_rows(self.knots, p, span, piece.inner_knots()), self.dim)

    def elevate(self) -> KnotVector:
        """Return the knot vector of degree p + 1 whose splines contain those of this one.

        Raises
        ------
        ValueError : degree 10 already.
        """
        return KnotVector(self.degree + 1, np.sort(np.concatenate([self.knots, self.breaks])))

    def elevation(self) -> csr_array[np.float64]:
        """Return the degree elevation, csr_array (elevate().dim, dim).

        The polar form of degree p + 1 is the mean of those of degree p over the arguments with
        one left out:  F[a_1, ..., a_(p+1)] = 1/(p + 1) sum_k f[..., a_(k-1), a_(k+1), ...].

        Raises
        ------
        ValueError : degree 10 already.
        """
        p = self.degree
        finer = self.elevate()
        span = self.span_of(finer.knots[: finer.dim])
        arguments = finer.inner_knots()
        rows = sum(
            (blossom_rows(self.knots, p, span, np.delete(arguments, k, axis=1)) for k in range(p + 1)),
            np.zeros((finer.dim, p + 1)),
        )
        return band_matrix(span - p, rows / (p + 1), self.dim)


UNIT = KnotVector(1, np.array([0.0, 0.0, 1.0, 1.0]))  # of straight lines over [0, 1]
