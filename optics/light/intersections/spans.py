"""The spans of a knot vector on the device: where points lie, and its functions there as polynomials."""

from __future__ import annotations

from functools import lru_cache
from math import factorial

import numpy as np
from scipy.sparse import csr_array

from optics.base.runtime import Backend, DrArray
from thbcad.checks import Floats
from thbcad.splines import KnotVector

MOST_BINS = 1 << 16
ROUNDING = 1e-9  # of a bin: breaks that lie so close to its ends are taken for the ends


class Cells:
    """The spans between breaks, found by bins of equal width.

    A bin knows the span in which it begins; as many steps as breaks lie within a bin lead on from there.
     Breaks of a dyadic mesh lie on the ends of bins and need no step.  A point on a break may be given to
     either side.

    breaks : (n + 1,) float, increasing.
    """

    def __init__(self, backend: Backend, breaks: Floats) -> None:
        self._backend, self._count = backend, len(breaks) - 1
        reach = breaks[-1] - breaks[0]
        bins = int(min(round(reach / np.diff(breaks).min()), MOST_BINS))
        ends = breaks[0] + reach / bins * np.arange(bins + 1)
        room = ROUNDING * reach / bins
        first = np.searchsorted(breaks, ends[:-1] + room, "right") - 1
        self._steps = int((np.searchsorted(breaks, ends[1:] - room, "left") - 1 - first).max())
        self._first, self._breaks = backend.Index(first.astype(np.uint32)), backend.array(breaks)
        self._low, self._rate, self._last = map(backend.opaque, (breaks[0], bins / reach, bins - 1))

    def __call__(self, position: DrArray) -> DrArray:
        """Return the numbers of the spans in which points lie, the first and the last for points beside them,
        the first for NaN."""
        dr, Float, Index = self._backend.dr, self._backend.Float, self._backend.Index
        along = (position - self._low) * self._rate
        at = Index(
            dr.select(along > 0, dr.minimum(along, self._last), 0)
        )  # 0 for what is no number: clip keeps it
        cell = dr.gather(Index, self._first, at)
        for _ in range(self._steps):
            passed = (position >= dr.gather(Float, self._breaks, cell + 1)) & (cell + 1 < self._count)
            cell = dr.select(passed, cell + 1, cell)
        return cell


class SpanFunctions:
    """The functions of a knot vector that are not zero on a span, as polynomials of it.

    powers : of the knot vector, see `power_map`.
    """

    def __init__(self, backend: Backend, kv: KnotVector, powers: csr_array) -> None:
        self._backend, self._order = backend, kv.degree + 1
        first, _ = kv.basis((kv.breaks[1:] + kv.breaks[:-1]) / 2)
        self._first = backend.Index(first.astype(np.uint32))
        self._powers = backend.array(powers.data)

    def __call__(
        self, span: DrArray, s: DrArray, rate: DrArray
    ) -> tuple[DrArray, list[tuple[DrArray, DrArray]]]:
        """Return the number of the first, and value and slope of each from there on.

        s : in [-1, 1] on the span.  rate : its derivative.
        """
        dr, Float, n = self._backend.dr, self._backend.Float, self._order
        out = []
        for k in range(n):
            value, slope = Float(0), Float(0)
            for power in reversed(range(n)):
                c = dr.gather(Float, self._powers, (span * n + power) * n + k)
                value, slope = value * s + c, slope * s + value
            out.append((value, slope * rate))
        return dr.gather(self._backend.Index, self._first, span), out


@lru_cache(maxsize=4)  # of a front and a rear, traced again and again
def power_map(kv: KnotVector) -> csr_array:
    """Return the matrix from spline coefficients to coefficients of s^k, s in [-1, 1] on each span.

    Row span * (p + 1) + k holds the k-th derivative at the span's middle, times (h / 2)^k / k!.  About the
    middle the moduli of the coefficients sum to at most (1 + sqrt 2)^p times the greatest value, about an end
    to (1 + sqrt 2)^(2 p) times.
    """
    p, half = kv.degree, np.diff(kv.breaks) / 2
    middle = (kv.breaks[1:] + kv.breaks[:-1]) / 2
    rows, columns, values = [], [], []
    for k in range(p + 1):
        first, basis = kv.basis(middle, k)
        rows.append(np.repeat(np.arange(len(middle)) * (p + 1) + k, p + 1))
        columns.append((first[:, None] + np.arange(p + 1)).ravel())
        values.append((basis * (half**k / factorial(k))[:, None]).ravel())
    entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
    return csr_array(entries, shape=(len(middle) * (p + 1), kv.dim))
