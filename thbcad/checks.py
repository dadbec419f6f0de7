"""Checks of numbers, rows and knots, and read-only arrays."""

from __future__ import annotations

from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

EPS = float(np.finfo(np.float64).eps)
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


def require_integer(name: str, value: object, least: int, most: int | None = None) -> None:
    """Raise ValueError unless the value is an integer, no bool, from `least` to `most`."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < least or (most is not None and value > most):
        bounds = "a non-negative integer" if least == 0 else f"an integer of at least {least}"
        if most is not None:
            bounds = f"an integer from {least} to {most}"
        raise ValueError(f"{name} must be {bounds}, got {value!r}")


def require_number(name: str, value: object, least: float = -np.inf, above: float = -np.inf, finite: bool = False) -> None:
    """Raise ValueError unless the value is a real number, no bool or NaN, of at least `least` and greater than `above`."""
    good = isinstance(value, Real) and not isinstance(value, bool) and value >= least and (value > above or above == -np.inf)
    if not good or (finite and not abs(value) < np.inf):
        kind = "finite number" if finite else "number"
        wanted = f"a {kind} of at least {least:g}" if least > -np.inf else f"a positive {kind}" if above == 0 else f"a {kind}"
        raise ValueError(f"{name} must be {wanted}, got {value!r}")


def require_order(derivative: object) -> None:
    """Raise ValueError unless the order of a derivative is a non-negative integer."""
    require_integer("derivative", derivative, 0)


def require_degree(degree: object) -> None:
    """Raise ValueError unless the degree is an integer from 1 to 10."""
    require_integer("degree", degree, 1, MAX_DEGREE)


def half_widths(half_width: tuple[float, float]) -> tuple[float, float]:
    """Return the half-widths of a rectangle as two floats; raise ValueError unless they are positive and finite."""
    h = tuple(float(w) for w in half_width)
    if len(h) != 2 or not all(np.isfinite(w) and w > 0 for w in h):
        raise ValueError(f"half_width must be two positive numbers, got {half_width}")
    return h


def points(u: ArrayLike, v: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return scattered points as two rows, (n,) each; raise ValueError unless they are of equal length."""
    u, v = (np.atleast_1d(np.asarray(x, dtype=np.float64)) for x in (u, v))
    if u.shape != v.shape or u.ndim != 1:
        raise ValueError(f"u and v must be two rows of equal length, got shapes {u.shape} and {v.shape}")
    return u, v


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
    require_integer("spans", spans, 1)
    if not start < stop:
        raise ValueError(f"start must be less than stop, got {start} and {stop}")
    breaks = start + (stop - start) * (np.arange(spans + 1) / spans)
    breaks[-1] = stop
    return breaks
