"""In which span of a knot vector points lie."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from optics.runtime import Backend, DrArray

MOST_BINS = 1 << 16
ROUNDING = 1e-9  # of a bin: breaks that lie so close to its ends are taken for the ends


class Cells:
    """The spans between breaks, found by bins of equal width.

    A bin knows the span in which it begins; as many steps as breaks lie within a bin lead on from there.
     Breaks of a dyadic mesh lie on the ends of bins and need no step.  A point on a break may be given to
     either side.

    breaks : (n + 1,) float, increasing.
    """

    def __init__(self, backend: Backend, breaks: NDArray[np.float64]) -> None:
        dr, self._backend, self._count = backend.dr, backend, len(breaks) - 1
        reach = breaks[-1] - breaks[0]
        bins = int(min(round(reach / np.diff(breaks).min()), MOST_BINS))
        ends = breaks[0] + reach / bins * np.arange(bins + 1)
        room = ROUNDING * reach / bins
        first = np.searchsorted(breaks, ends[:-1] + room, "right") - 1
        self._steps = int((np.searchsorted(breaks, ends[1:] - room, "left") - 1 - first).max())
        self._first, self._breaks = backend.Index(first.astype(np.uint32)), backend.array(breaks)
        # opaque numbers, so that every mesh runs the same compiled kernel
        self._low, self._rate, self._last = (
            dr.opaque(backend.Float, v) for v in (breaks[0], bins / reach, bins - 1)
        )

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
