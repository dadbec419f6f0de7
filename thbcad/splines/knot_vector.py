"""Univariate B-splines: knot vectors, clamped or not, and their exact operators.

Source: T. Lyche and K. Moerken, Spline Methods, chapters 2-4; thesis 3.5-3.9 and 3.30-3.35.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array

from thbcad.checks import (
    Floats,
    Integers,
    lacking,
    require_number,
    require_order,
    require_subset,
    require_type,
    row,
)
from thbcad.splines.knots import Knots
from thbcad.splines.polar_forms import bezier_rows, blossom_rows
from thbcad.splines.sparse_operators import band_matrix, banded_least_squares, csr_rows


class KnotVector(Knots):
    """A knot vector t_0 <= ... <= t_m of degree p with ``dim = m - p`` functions on [t_p, t_(m-p)].

    Clamped knots begin and end with p + 1 equal ones; others go on outside the domain.  A knot between the
    first and the last occurs at most p times.

    Raises ValueError : degree outside 1..10; knots that are not finite, not sorted or repeated too often; a
        function that vanishes on the domain.

    >>> kv = KnotVector.uniform(degree=3, spans=4)
    >>> c = kv.greville() ** 2
    >>> finer = kv.insert([0.3, 0.7])  # the same spline with more knots
    >>> u = [0.1, 0.5, 0.9]
    >>> np.allclose(finer.collocation(u) @ (kv.prolongation(finer) @ c), kv.collocation(u) @ c, rtol=1e-15)
    True
    """

    def basis(self, u: ArrayLike, derivative: int = 0) -> tuple[Integers, Floats]:
        """Return (first, values): at u only functions first .. first + p differ from zero.

        u : (n,) float.  first : (n,) int.  values : (n, p + 1) float.

        Raises ValueError : u that is no row, NaN or outside the domain; an order that is not a non-negative
            integer.
        """
        require_order(derivative)
        u = row("u", u)
        span = self.span_of(u)
        arguments = np.broadcast_to(u[:, None], (len(u), self.degree))
        return span - self.degree, blossom_rows(self.knots, self.degree, span, arguments, int(derivative))

    def collocation(self, u: ArrayLike, derivative: int = 0) -> csr_array[np.float64]:
        """Return the matrix A[k, i] = d^r/du^r N_i(u_k), csr_array (len(u), dim).

        Raises ValueError : as `basis`.
        """
        first, values = self.basis(u, derivative)
        return band_matrix(first, values, self.dim)

    def integrals(self) -> Floats:
        """Return the integrals of the B-splines over the domain, (dim,): (t_(i+p+1) - t_i) / (p + 1) where
        clamped."""
        if not self.is_clamped:
            kv, operator = self.clamp()
            values: Floats = operator.T @ kv.integrals()
            return values
        return (self.knots[self.degree + 1 :] - self.knots[: self.dim]) / (self.degree + 1)

    def prolongation(self, finer: KnotVector) -> csr_array[np.float64]:
        """Return the refinement operator, csr_array (finer.dim, dim), with C_finer = P @ C.

        Row j holds the polar form at the knots tau_(j+1) .. tau_(j+p) of the finer vector
        (thesis 3.30-3.35, where R = P.T).  Knots outside the domain may be any; where those of `finer` refine
        ours, no entry is negative.

        Raises ValueError : `finer` is no KnotVector, lacks a knot of this vector or has another degree or
            domain.
        """
        require_type("finer", finer, KnotVector)
        if finer.degree != self.degree:
            raise ValueError(f"degrees differ: {self.degree} and {finer.degree}")
        if (finer.start, finer.stop) != (self.start, self.stop):
            raise ValueError(f"the finer knot vector must have the same domain, got {self} and {finer}")
        p = self.degree
        require_subset(self.knots[p:-p], finer.knots[p:-p])
        return self._polar(finer)

    def restriction(self, coarser: KnotVector) -> csr_array[np.float64]:
        """Return Q = (P^T P)^-1 P^T, csr_array (coarser.dim, dim), with P = coarser.prolongation(self): Q @ P
        == identity.

        Q @ c are the coefficients on the coarser knots that come closest to c in least squares.  Q is full:
        it takes coarser.dim * dim numbers.

        Raises ValueError : `coarser` is no KnotVector, has a knot that this vector lacks or another degree.
        """
        require_type("coarser", coarser, KnotVector)
        return csr_array(banded_least_squares(coarser.prolongation(self), self.degree, np.eye(self.dim)))

    def segment(self, start: float, stop: float) -> tuple[KnotVector, csr_array[np.float64]]:
        """Return the clamped knot vector of the piece on [start, stop] and the operator to its coefficients,
        csr_array (piece.dim, dim).

        Splitting at u is the two segments [start, u] and [u, stop].

        Raises ValueError : unless self.start <= start < stop <= self.stop.
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

    def clamp(self) -> tuple[KnotVector, csr_array[np.float64]]:
        """Return the clamped knot vector of the same splines on the domain and the operator to it, csr_array
        (dim, dim)."""
        return self.segment(self.start, self.stop)

    def wrapping(self) -> csr_array[np.float64]:
        """Return W, csr_array (dim, n) of ones, with C = W @ c, C_i = c_(i mod n), of closed splines.

        They go on across the seam with p - 1 derivatives, or p - m where its multiplicity is m, as after
        `elevate`.

        Raises ValueError : knots that are not periodic.
        """
        if not self.is_periodic:
            raise ValueError(f"periodic knots have t_(i+n) = t_i + T, see KnotVector.periodic; got {self}")
        return csr_rows(np.ones(self.dim), np.arange(self.dim) % self._period, self._period)

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
        """Return the operator to the coefficients on `piece`, whose domain lies in ours and has its knots:
        polar forms at its own."""
        knots, span = self._spans_of(piece)
        return self._banded(span, blossom_rows(knots, self.degree, span, piece.inner_knots()))

    def _spans_of(self, finer: KnotVector) -> tuple[Floats, Integers]:
        """Return our knots after p more, and the span of them in which each function of `finer` begins.

        Where the finer vector's knots outside the domain refine ours, its coefficients are convex
        combinations of ours, as in the Oslo algorithm; else they go on from the domain's first span.
        """
        p, begins = self.degree, finer.knots[: finer.dim]
        outer = self.knots[(self.knots > finer.knots[0]) & (self.knots <= finer.start)]
        if lacking(outer, finer.knots).size:
            begins = np.maximum(begins, finer.start)
        knots = np.concatenate([self.knots[0] - np.arange(p, 0, -1) * (self.stop - self.start), self.knots])
        return knots, np.minimum(np.searchsorted(knots, begins, "right") - 1, p + self.dim - 1)

    def _banded(self, span: Integers, rows: Floats) -> csr_array:
        """Return the operator with `rows` of polar forms in spans of `_spans_of`; no function of the p more
        knots counts."""
        p = self.degree
        return band_matrix(span - p, rows, p + self.dim)[:, p:]

    def derivative(self) -> tuple[KnotVector, csr_array]:
        """Return the knot vector of degree p - 1 of derivatives and the operator to them, csr_array (dim - 1,
        dim): c'_i = p (c_(i+1) - c_i) / (t_(i+p+1) - t_(i+1)).

        Raises ValueError : degree 1, or a knot of multiplicity p: derivatives jump.
        """
        p, t = self.degree, self.knots
        if p == 1:
            raise ValueError("splines of degree 1 have derivatives with jumps, which are no splines here")
        kv = KnotVector(p - 1, t[1:-1])
        slopes = p / (t[p + 1 : -1] - t[1 : -p - 1])
        return kv, band_matrix(np.arange(kv.dim), np.stack([-slopes, slopes], axis=1), self.dim)

    def elevation(self) -> csr_array[np.float64]:
        """Return the degree elevation, csr_array (elevate().dim, dim).

        The polar form of degree p + 1 is the mean of those of degree p over the arguments with
        one left out:  F[a_1, ..., a_(p+1)] = 1/(p + 1) sum_k f[..., a_(k-1), a_(k+1), ...].

        Raises ValueError : degree 10 already.
        """
        p = self.degree
        finer = self.elevate()
        knots, span = self._spans_of(finer)
        arguments = finer.inner_knots()
        rows = sum(
            (blossom_rows(knots, p, span, np.delete(arguments, k, axis=1)) for k in range(p + 1)),
            np.zeros((finer.dim, p + 1)),
        )
        return self._banded(span, rows / (p + 1))


UNIT = KnotVector(1, np.array([0.0, 0.0, 1.0, 1.0]))  # of straight lines over [0, 1]
QUADRATIC = KnotVector(2, np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0]))  # of conic sections over [0, 1]
