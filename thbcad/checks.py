"""Checks of knots, degrees and orders of derivatives, and read-only arrays."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

MAX_DEGREE = 10


def read_only(array: ArrayLike, dtype: type[np.float64] | type[np.int64] = np.float64) -> NDArray[Any]:
    """Return a contiguous read-only copy of `array`."""
    out = np.array(array, dtype=dtype, order="C")
    out.flags.writeable = False
    return out


def locked(array: NDArray[Any]) -> NDArray[Any]:
    """Return the array itself, read-only from now on."""
    array.flags.writeable = False
    return array


def require_order(derivative: object) -> None:
    """Raise ValueError unless the order of a derivative is a non-negative integer."""
    if isinstance(derivative, bool) or not isinstance(derivative, (int, np.integer)) or derivative < 0:
        raise ValueError(f"derivative must be a non-negative integer, got {derivative!r}")


def require_degree(degree: object) -> None:
    """Raise ValueError unless the degree is an integer from 1 to 10."""
    if isinstance(degree, bool) or not isinstance(degree, (int, np.integer)) or not 1 <= degree <= MAX_DEGREE:
        raise ValueError(f"degree must be an integer from 1 to {MAX_DEGREE}, got {degree!r}")


def require_sorted(knots: NDArray[np.float64]) -> None:
    """Raise ValueError unless the knots are finite and do not decrease."""
    if not np.isfinite(knots).all():
        raise ValueError(f"knots[{int(np.argmin(np.isfinite(knots)))}] is not finite")
    falls = knots[1:] < knots[:-1]
    if falls.any():
        k = int(np.argmax(falls))
        raise ValueError(f"knots must not decrease, got knots[{k}] = {knots[k]} > knots[{k + 1}] = {knots[k + 1]}")
    if knots[-1] / 2 - knots[0] / 2 > np.finfo(np.float64).max / 2:
        raise ValueError(f"knots from {knots[0]:g} to {knots[-1]:g} span more than float64 can hold")


def require_subset(knots: NDArray[np.float64], finer: NDArray[np.float64]) -> None:
    """Raise ValueError unless the sorted row `finer` holds every one of `knots`, as often at least."""
    values, counts = np.unique(knots, return_counts=True)
    lacking = np.searchsorted(finer, values, "right") - np.searchsorted(finer, values, "left") < counts
    if lacking.any():
        raise ValueError(f"the finer knot vector lacks the knot {values[lacking][0]}")


def uniform_breaks(spans: int, start: float, stop: float) -> NDArray[np.float64]:
    """Return the ends of `spans` equal spans on [start, stop], (spans + 1,).

    Raises
    ------
    ValueError : spans that is no positive integer; start that is not less than stop.
    """
    if isinstance(spans, bool) or not isinstance(spans, (int, np.integer)) or spans < 1:
        raise ValueError(f"spans must be an integer of at least 1, got {spans!r}")
    if not start < stop:
        raise ValueError(f"start must be less than stop, got {start} and {stop}")
    breaks = start + (stop - start) * (np.arange(spans + 1) / spans)
    breaks[-1] = stop
    return breaks
