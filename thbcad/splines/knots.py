"""Rows of knots: where the pieces of splines meet, and how rows of knots make others.

Periodic knots: L. Schumaker, Spline Functions: Basic Theory, section 8.1.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Self, SupportsIndex

import numpy as np
from numpy.typing import ArrayLike

from thbcad.checks import (
    EPS,
    Floats,
    Integers,
    floats,
    inside,
    read_only,
    require_degree,
    require_number,
    require_sorted,
    require_type,
    uniform_breaks,
)
from thbcad.splines.polar_forms import greville_abscissae
from thbcad.values import Value

PERIODIC = 64 * EPS  # of the greatest knot: a period is a few roundings, and bisection adds some


@dataclass(frozen=True, eq=False)
class Knots(Value):
    """Knots t_0 <= ... <= t_m of splines of degree p, of which [t_p, t_(m-p)] is the domain.

    Clamped knots begin and end with p + 1 equal ones; others go on outside the domain.  A knot between the
    first and the last occurs at most p times.
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
        same = t[1 : -p - 1] == t[p + 1 : -1]
        if same.any():
            raise ValueError(
                f"knot {t[1 : -p - 1][same][0]} occurs more than degree = {p} times in the interior"
            )
        if t[p] == t[p + 1] or t[-p - 2] == t[-p - 1]:
            raise ValueError(
                f"the domain [t_p, t_(m-p)] = [{t[p]}, {t[-p - 1]}] must end with spans that are not empty"
            )
        vars(self).update(degree=p, knots=t)

    @classmethod
    def uniform(
        cls, degree: SupportsIndex, spans: SupportsIndex, start: float = 0.0, stop: float = 1.0
    ) -> Self:
        """Return the clamped knot vector with `spans` equal spans on [start, stop]."""
        return cls.clamped(degree, uniform_breaks(spans, start, stop)[1:-1], start, stop)

    @classmethod
    def clamped(cls, degree: SupportsIndex, inner: ArrayLike, start: float, stop: float) -> Self:
        """Return the knot vector on [start, stop] with the given inner knots, (n,), a double knot written
        twice."""
        require_degree(degree)
        p = int(degree)
        return cls(p, np.r_[[start] * (p + 1), floats(inner), [stop] * (p + 1)])

    @classmethod
    def periodic(cls, degree: int, breaks: ArrayLike) -> Self:
        """Return the knots t_(i+n) = t_i + T of a closed spline, whose coefficients `wrapping` makes.

        breaks : (n + 1,), from the seam to the seam, T later; inner ones may be repeated.  The functions run
        across the seam, and `clamp` leads to those that end there.
        """
        require_degree(degree)
        b = floats(breaks)
        if b.ndim != 1 or len(b) < 2:
            raise ValueError(f"breaks must be one row of at least 2 numbers, got shape {b.shape}")
        turn, k = np.divmod(np.arange(-degree, len(b) + degree), len(b) - 1)
        # measured from the near end of the period, so that the seam is met exactly
        after = b[-1] + (turn - 1) * (b[-1] - b[0]) + (b[k] - b[0])
        before = b[0] + (turn + 1) * (b[-1] - b[0]) - (b[-1] - b[k])
        return cls(degree, np.where(turn == 0, b[k], np.where(turn > 0, after, before)))

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
        return float(self.knots[self.degree])

    @property
    def stop(self) -> float:
        """Right end of the domain."""
        return float(self.knots[-self.degree - 1])

    @property
    def is_clamped(self) -> bool:
        """Whether the first and the last p + 1 knots are equal: splines begin and end with their
        coefficients."""
        return bool(self.knots[0] == self.start and self.knots[-1] == self.stop)

    @property
    def is_periodic(self) -> bool:
        """Whether t_(i+n) = t_i + T, but for rounding, where T is the length of the domain."""
        t, n = self.knots, self._period
        off = np.abs(t[n:] - t[:-n] - (self.stop - self.start)).max()
        return not self.is_clamped and bool(off <= PERIODIC * max(abs(t[0]), abs(t[-1])))

    @property
    def _period(self) -> int:
        """The n of periodic knots, those of the domain less one copy of the seam."""
        return self.dim - self.degree + int((self.knots == self.start).sum()) - 1

    @cached_property
    def domain(self) -> tuple[float, float]:
        """Both ends of the domain."""
        return self.start, self.stop

    @cached_property
    def breaks(self) -> Floats:
        """Distinct knots of the domain, (spans + 1,)."""
        return read_only(np.unique(self.knots[self.degree : len(self.knots) - self.degree]))

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
        """Return for each u the index mu with t_mu <= u < t_(mu+1); the end counts to the last span."""
        right = np.searchsorted(self.knots, inside("u", u, self.domain), side="right")
        return np.minimum(right - 1, self.dim - 1)

    def insert(self, knots: ArrayLike) -> Self:
        """Return the knot vector with the given knots added (repeats raise the multiplicity)."""
        new = np.atleast_1d(floats(knots))
        bad = ~((new > self.start) & (new < self.stop))
        if bad.any():
            raise ValueError(
                f"inserted knot {new[bad][0]} lies outside the open domain ({self.start}, {self.stop})"
            )
        return type(self)(self.degree, np.sort(np.r_[self.knots, new], kind="stable"))

    def bisect(self) -> Self:
        """Return the knot vector with one knot more in the middle of every non-empty span.

        Spans outside the domain are cut, too, and the p knots next to it stay: periodic knots stay periodic.
        """
        b = np.unique(self.knots)
        return self._ending_here(self.degree, np.r_[self.knots, b[:-1] + np.diff(b) / 2])

    def merge(self, other: Self) -> Self:
        """Return the knot vector with the knots of both, each as often as in the one that has more of it."""
        require_type("other", other, type(self))
        if (self.degree, self.start, self.stop) != (other.degree, other.start, other.stop):
            raise ValueError(f"knot vectors to merge must agree in degree and ends, got {self} and {other}")
        values = np.unique(np.r_[self.knots, other.knots])
        counts = [
            np.searchsorted(t, values, "right") - np.searchsorted(t, values, "left")
            for t in (self.knots, other.knots)
        ]
        return self._ending_here(self.degree, np.repeat(values, np.maximum(*counts)))

    def rescale(self, start: float, stop: float) -> Self:
        """Return the knot vector mapped linearly onto [start, stop]."""
        for name, end in (("start", start), ("stop", stop)):
            require_number(name, end, finite=True)
        start, stop = float(start), float(stop)
        if (self.start, self.stop) == (start, stop):
            return self
        fraction = (self.knots - self.start) / (self.stop - self.start)
        return type(self)(self.degree, np.where(fraction == 1, stop, start + (stop - start) * fraction))

    def reverse(self) -> Self:
        """Return the knots start + stop - t_(m-i) of splines that run backwards; the ends keep their bits."""
        t = self.start + self.stop - self.knots[::-1]
        ends = self.knots[::-1] == self.stop, self.knots[::-1] == self.start
        return type(self)(self.degree, np.select(ends, (self.start, self.stop), t))

    def elevate(self) -> Self:
        """Return the knot vector of degree p + 1 whose splines contain those of this one."""
        return self._ending_here(self.degree + 1, np.r_[self.knots, np.unique(self.knots)])

    def _ending_here(self, degree: int, knots: Floats) -> Self:
        """Return the knot vector of a degree p with the same domain from knots of which more than p may lie
        beside it."""
        t = np.sort(knots, kind="stable")
        first = np.searchsorted(t, self.start, "right") - 1 - degree
        last = np.searchsorted(t, self.stop, "left") + degree
        return type(self)(degree, t[first : last + 1])
