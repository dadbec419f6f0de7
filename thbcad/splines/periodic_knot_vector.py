"""Periodic B-splines: one period of knots, functions that run across the seam.

The knots go on in both directions by t_(i+n) = t_i + T, where T is the period, and so do the
functions.  All values come from the polar form of `polar_forms`, with indices modulo n.

Source: L. Schumaker, Spline Functions: Basic Theory, section 8.1; L. Piegl and W. Tiller, The
NURBS Book, section 12.2 (unclamping).
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
    floats,
    read_only,
    require_degree,
    require_order,
    require_sorted,
    require_subset,
    require_type,
    uniform_breaks,
)
from thbcad.splines.knot_vector import KnotVector
from thbcad.splines.polar_forms import blossom_rows, greville_abscissae
from thbcad.splines.sparse_operators import csr_rows
from thbcad.values import Value


@dataclass(frozen=True, eq=False)
class PeriodicKnotVector(Value):
    """One period t_0 <= ... <= t_n of knots of degree p, with ``dim = n`` functions.

    t_0 is `start` and t_n is `stop`, and the period is T = stop - start.  `stop` is written once,
    so that the seam is as often a knot as `start` is written.  A knot occurs at most p times.

    Function i is the sum of N[t_(i-p), ..., t_(i+1)](u + k T) over all integers k, as in scipy,
    where the coefficients c of a periodic BSpline are ours with the first p repeated at the end.
    With dim <= p functions a support is longer than the period; the sum takes care of it.

    Raises
    ------
    ValueError : degree outside 1..10; knots that are not finite, not sorted or repeated too
        often, `stop` written twice.

    Examples
    --------
    >>> kv = PeriodicKnotVector.uniform(degree=3, spans=4)
    >>> np.array_equal(kv.collocation([0.25]).toarray(), kv.collocation([7.25]).toarray())
    True
    """

    degree: int
    knots: Floats

    def __init__(self, degree: SupportsIndex, knots: ArrayLike) -> None:
        require_degree(degree)
        p, t = int(degree), read_only(knots)
        if t.ndim != 1 or len(t) < 2:
            raise ValueError(f"knots must be one row of at least 2 numbers, got shape {t.shape}")
        require_sorted(t)
        if t[-2] == t[-1]:
            raise ValueError(
                f"the last knot {t[-1]} must be greater than the one before: a multiple seam is written at "
                "the start"
            )
        same = t[: -p - 1] == t[p:-1]
        if same.any():
            raise ValueError(f"knot {t[: -p - 1][same][0]} occurs more than degree = {p} times")
        vars(self).update(degree=p, knots=t)

    def __repr__(self) -> str:
        return f"PeriodicKnotVector(degree {self.degree}, dim {self.dim})"

    @classmethod
    def uniform(
        cls, degree: SupportsIndex, spans: SupportsIndex, start: float = 0.0, stop: float = 1.0
    ) -> PeriodicKnotVector:
        """Return the periodic knot vector with `spans` equal spans on [start, stop)."""
        return cls(degree, uniform_breaks(spans, start, stop))

    @property
    def dim(self) -> int:
        """Number of periodic B-splines."""
        return len(self.knots) - 1

    @property
    def start(self) -> float:
        """The seam, where the written period starts."""
        return float(self.knots[0])

    @property
    def stop(self) -> float:
        """The seam again, one period later."""
        return float(self.knots[-1])

    @property
    def period(self) -> float:
        """Length of the period, stop - start."""
        return self.stop - self.start

    @cached_property
    def breaks(self) -> Floats:
        """Distinct knots from `start` to `stop`, both included, (spans + 1,)."""
        return read_only(np.unique(self.knots))

    @property
    def spans(self) -> int:
        """Number of non-empty knot spans in a period."""
        return len(self.breaks) - 1

    @cached_property
    def extended(self) -> Floats:
        """The knots t_(-p) ... t_(n+p), (dim + 2 p + 1,): function i lies on entries i ... i + p + 1."""
        t = self.knots
        turn, k = np.divmod(np.arange(-self.degree, self.dim + self.degree + 1), self.dim)
        # measured from the near end of the period, so that the seam is met exactly
        after = self.stop + (turn - 1) * self.period + (t[k] - self.start)
        before = self.start + (turn + 1) * self.period - (self.stop - t[k])
        return read_only(np.where(turn == 0, t[k], np.where(turn > 0, after, before)))

    def greville(self) -> Floats:
        """Return the Greville abscissae g_i = (t_(i-p+1) + ... + t_i) / p, (dim,), which do not decrease.

        The first ones may lie before `start`; `collocation` takes them as they are.
        """
        return greville_abscissae(self.extended[: self.dim + self.degree + 1], self.degree)

    def reduced(self, u: ArrayLike) -> Floats:
        """Return u - k T in [start, stop), the same shape; what lies there already does not change.

        Raises
        ------
        ValueError : u that is not finite.
        """
        u = floats(u)
        if not np.isfinite(u).all():
            raise ValueError(f"parameter {u[~np.isfinite(u)].flat[0]} is not finite")
        moved = np.where(
            (u >= self.start) & (u < self.stop), u, self.start + np.mod(u - self.start, self.period)
        )
        return np.where(moved < self.stop, moved, self.start)

    def collocation(self, u: ArrayLike, derivative: int = 0) -> csr_array[np.float64]:
        """Return the matrix A[k, i] = d^r/du^r N_i(u_k), csr_array (len(u), dim), at any finite u, (len(u),)
        float.

        Derivatives that jump at a knot are those from the right, at the seam too.
        """
        require_order(derivative)
        u = np.atleast_1d(floats(u))
        if u.ndim != 1:
            raise ValueError(f"u must be one row of numbers, got shape {u.shape}")
        u = self.reduced(u)
        return self._polar(u, np.broadcast_to(u[:, None], (len(u), self.degree)), int(derivative))

    def integrals(self) -> Floats:
        """Return the integrals of the functions over one period, (t_(i+1) - t_(i-p)) / (p + 1), (dim,)."""
        p = self.degree
        return (self.extended[p + 1 : p + 1 + self.dim] - self.extended[: self.dim]) / (p + 1)

    def insert(self, knots: ArrayLike) -> PeriodicKnotVector:
        """Return the knot vector with the given knots added, any finite numbers, each in every period."""
        new = self.reduced(np.atleast_1d(floats(knots)))
        return PeriodicKnotVector(
            self.degree, np.r_[np.sort(np.r_[self.knots[:-1], new], kind="stable"), self.stop]
        )

    def bisect(self) -> PeriodicKnotVector:
        """Return the knot vector with one knot more in the middle of every non-empty span."""
        b = self.breaks
        return self.insert(b[:-1] + np.diff(b) / 2)

    def prolongation(self, finer: PeriodicKnotVector) -> csr_array[np.float64]:
        """Return the refinement operator, csr_array (finer.dim, dim), with C_finer = P @ C.

        Row j holds the polar form at the p inner knots of function j of the finer vector.

        Raises
        ------
        ValueError : `finer` is no PeriodicKnotVector, lacks a knot of this vector or has another degree,
            start or stop.
        """
        require_type("finer", finer, PeriodicKnotVector)
        if finer.degree != self.degree:
            raise ValueError(f"degrees differ: {self.degree} and {finer.degree}")
        if (finer.start, finer.stop) != (self.start, self.stop):
            raise ValueError(f"periods differ: [{self.start}, {self.stop}) and [{finer.start}, {finer.stop})")
        require_subset(self.knots[:-1], finer.knots[:-1])
        windows = finer._windows()
        return self._polar(windows[:, 0], windows[:, 1:])

    def clamp(self) -> tuple[KnotVector, csr_array[np.float64]]:
        """Return the clamped knot vector on [start, stop] and the exact operator to its coefficients,
        csr_array (piece.dim, dim)."""
        inner = self.knots[(self.knots > self.start) & (self.knots < self.stop)]
        piece = KnotVector.clamped(self.degree, inner, self.start, self.stop)
        return piece, self._polar(piece.knots[: piece.dim], piece.inner_knots())

    def elevate(self) -> PeriodicKnotVector:
        """Return the knot vector of degree p + 1 whose splines contain those of this one."""
        return PeriodicKnotVector(
            self.degree + 1, np.r_[np.sort(np.r_[self.knots[:-1], self.breaks[:-1]]), self.stop]
        )

    def elevation(self) -> csr_array[np.float64]:
        """Return the degree elevation, csr_array (elevate().dim, dim), by the mean of polar forms of
        `KnotVector.elevation`."""
        windows = self.elevate()._windows()
        start = windows[:, 0]
        arguments = windows[:, 1:]
        return sum(self._polar(start, np.delete(arguments, k, axis=1)) for k in range(self.degree + 1)) / (
            self.degree + 1
        )

    def _windows(self) -> Floats:
        """Return the first p + 1 knots of every function, (dim, p + 1), moved by whole periods until the
        first lies in [start, stop)."""
        p = self.degree
        first = (np.arange(self.dim) - p) % self.dim
        result: Floats = self.extended[p + first[:, None] + np.arange(p + 1)]
        return result

    def _polar(self, at: Floats, arguments: Floats, derivative: int = 0) -> csr_array[np.float64]:
        """Return the polar forms at `arguments`, (n, p), of the pieces that hold `at`, (n,) in [start, stop):
        csr_array (n, dim)."""
        p = self.degree
        span = np.searchsorted(self.knots, at, side="right") - 1
        columns = (span[:, None] + np.arange(p + 1)) % self.dim
        rows = csr_rows(blossom_rows(self.extended, p, span + p, arguments, derivative), columns, self.dim)
        rows.sum_duplicates()
        return rows
