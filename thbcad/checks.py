"""Checks of numbers, coordinates and knots, and read-only arrays."""

from collections.abc import Sequence
from math import log10, trunc
from numbers import Real
from operator import index
from pathlib import Path
from typing import Any, SupportsIndex

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Bools = NDArray[np.bool_]

EPS = float(np.finfo(np.float64).eps)
MAX_DEGREE = 10
MOST_BITS = 1023  # of an integer that float64 holds for certain
LONGEST_SHOWN = 80  # characters of a value in a message
MOST_SPANS = 10_000_000
GREATEST_HALF_WIDTH = 1e100  # its square is finite
GREATEST_KNOT = 1e300  # sums of knots and of periods are finite


def read_only(array: ArrayLike, dtype: type[np.float64] | type[np.int64] = np.float64) -> NDArray[Any]:
    """Return a contiguous read-only copy of `array`."""
    require_real(array)
    try:
        out = np.array(array, dtype=dtype, order="C")
    except OverflowError:
        raise ValueError(f"numbers must be ones that {dtype.__name__} can hold") from None
    except ValueError as error:  # of numpy, with the whole text that is no number
        raise ValueError(shortened(str(error))) from None
    out.flags.writeable = False
    return out


def locked(array: NDArray[Any]) -> NDArray[Any]:
    """Return the array itself, read-only from now on."""
    array.flags.writeable = False
    return array


def require_type(name: str, value: object, *types: type) -> None:
    """Raise ValueError unless the value is of one of these types."""
    if not isinstance(value, types):
        raise ValueError(
            f"{name} must be a {' or '.join(each.__name__ for each in types)}, got {type(value).__name__}"
        )


def require_suffix(path: str | Path, *suffixes: str) -> str:
    """Return the suffix of a file in lower case; raise ValueError for one that is not among `suffixes`."""
    suffix = Path(path).suffix.lower()
    if suffix not in suffixes:
        *others, last = suffixes
        raise ValueError(f"{path} must end in {', '.join(others)} or {last}")
    return suffix


def require_unmasked(array: object) -> None:
    """Raise ValueError for a masked array with masked numbers, and for lists that hold such arrays."""
    if masked := _masked(array):
        raise ValueError(f"numbers must not be masked, got {masked} masked; leave them out or fill them")


def _masked(array: object) -> int:
    """Return how many numbers are masked."""
    if isinstance(array, list | tuple):
        return sum(_masked(row) for row in array if isinstance(row, np.ma.MaskedArray | list | tuple))
    return int(np.sum(array.mask)) if isinstance(array, np.ma.MaskedArray) else 0


def require_real(array: ArrayLike) -> None:
    """Raise ValueError for complex and for masked numbers, for dates, and for records with fields."""
    require_unmasked(array)
    names = getattr(getattr(array, "dtype", None), "names", None)
    if names:  # numpy would take one of a single field for its numbers
        raise ValueError(f"numbers must be plain, got records with the fields {', '.join(names)}; take one")
    if np.iscomplexobj(array) or getattr(array, "dtype", np.dtype(float)).kind in "mM":
        raise ValueError(f"numbers must be real, got {np.asarray(array).dtype}")


def floats(array: ArrayLike) -> Floats:
    """Return numbers as float64, without a copy where they are."""
    if isinstance(array, float) or (type(array) is np.ndarray and array.dtype == np.float64):
        return np.asarray(array)  # neither masked nor complex
    require_real(array)
    try:
        return np.asarray(array, dtype=np.float64)
    except OverflowError:
        raise ValueError("numbers must be ones that float64 can hold") from None
    except ValueError as error:  # of numpy, with the whole text that is no number
        raise ValueError(shortened(str(error))) from None


def require_integer(name: str, value: object, least: int, most: int | None = None) -> None:
    """Raise ValueError unless the value is an integer, no bool, from `least` to `most`."""
    try:
        number = least - 1 if isinstance(value, bool) else index(value)  # type: ignore[arg-type]
    except TypeError:
        number = least - 1
    if number < least or (most is not None and number > most):
        bounds = "a non-negative integer" if least == 0 else f"an integer of at least {least}"
        if most is not None:
            bounds = f"an integer from {least} to {most}"
        raise ValueError(f"{name} must be {bounds}, got {shown(value)}")


def require_number(
    name: str, value: object, least: float = -np.inf, above: float = -np.inf, finite: bool = False
) -> None:
    """Raise ValueError unless the value is a real number that float64 can hold, no bool or NaN, of at least
    `least` and greater than `above`."""
    number = _float64(name, value)
    good = number >= least and (number > above or above == -np.inf)
    if not good or (finite and not abs(number) < np.inf):
        noun = "finite number" if finite else "number"
        wanted = f"a positive {noun}" if above == 0 else f"a {noun}"
        wanted += (
            f" of at least {least:g}"
            if least > -np.inf
            else f" greater than {above:g}"
            if above > -np.inf and above
            else ""
        )
        raise ValueError(f"{name} must be {wanted}, got {shortened(str(value))}")


def _float64(name: str, value: Any) -> float:
    """Return a real number as float64, NaN for anything else and for bools; raise ValueError for an integer
    beyond it."""
    if not isinstance(value, Real) or isinstance(value, bool):
        return np.nan
    try:
        return float(value)
    except OverflowError:
        raise ValueError(
            f"{name} must be a number that float64 can hold, got {shown(trunc(value))}"
        ) from None


def shown(value: object) -> str:
    """Return a value for a message: its repr, of a long one the beginning, of an integer beyond float64 how
    long it is.

    >>> shown("round"), shown(10**400), shown("A" * 100_000)[-24:]
    ("'round'", 'an integer of about 400 digits', "A... (100002 characters)")
    """
    if isinstance(value, int) and value.bit_length() > MOST_BITS:
        return f"an integer of about {log10(abs(value)):.0f} digits"
    try:
        return shortened(repr(value))
    except ValueError:  # of a collection with an integer of more digits than Python writes
        return f"a {type(value).__name__} with an integer of too many digits to show"


def shortened(text: str) -> str:
    """Return a text for a message, of a long one the beginning."""
    return text if len(text) <= LONGEST_SHOWN else f"{text[:LONGEST_SHOWN]}... ({len(text)} characters)"


def require_order(derivative: object) -> None:
    """Raise ValueError unless the order of a derivative is a non-negative integer."""
    require_integer("derivative", derivative, 0)


def require_orders(derivative: object) -> tuple[int, int]:
    """Return the orders (a, b) of a partial derivative; raise ValueError unless they are two non-negative
    integers."""
    if not isinstance(derivative, Sequence | np.ndarray) or len(derivative) != 2:
        raise ValueError(f"derivative must be a pair (a, b) of orders, got {shown(derivative)}")
    for order in derivative:
        require_order(order)
    return int(derivative[0]), int(derivative[1])


def require_degree(degree: object) -> None:
    """Raise ValueError unless the degree is an integer from 1 to 10."""
    require_integer("degree", degree, 1, MAX_DEGREE)


def half_widths(half_width: Any) -> tuple[float, float]:
    """Return the half-widths of a rectangle as two floats; raise ValueError unless they are positive and
    finite."""
    pair = isinstance(half_width, Sequence | np.ndarray) and len(half_width) == 2
    if not pair or not all(0 < _float64("half_width", w) <= GREATEST_HALF_WIDTH for w in half_width):
        got = " and ".join(map(shown, half_width)) if pair else shortened(str(half_width))
        raise ValueError(
            f"half_width must be two positive numbers of at most {GREATEST_HALF_WIDTH:g}, got {got}"
        )
    return float(half_width[0]), float(half_width[1])


def row(name: str, x: ArrayLike) -> Floats:
    """Return numbers as float64, (n,), or (1,) for a single one; raise ValueError where they are no row."""
    x = np.atleast_1d(floats(x))
    if x.ndim != 1:
        raise ValueError(f"{name} must be one row of numbers, got shape {x.shape}")
    return x


def inside(name: str, x: ArrayLike, domain: tuple[float, float]) -> Floats:
    """Return a coordinate as float64, of any shape."""
    (start, stop), x = domain, floats(x)
    least, most = (x.min(), x.max()) if x.ndim and x.size else (x, x)
    if x.size and not (start <= least and most <= stop):
        bad = x[~((x >= start) & (x <= stop))].flat[0]
        raise ValueError(f"{name} = {bad} lies outside the domain [{start}, {stop}]")
    return x


def coordinates(**given: tuple[ArrayLike, tuple[float, float]]) -> tuple[Floats, ...]:
    """Return coordinates, given by name with their domains, as arrays of the one shape to which they
    broadcast."""
    found = tuple(inside(name, x, domain) for name, (x, domain) in given.items())
    if len({x.shape for x in found}) == 1:
        return found
    try:
        return tuple(np.broadcast_arrays(*found))
    except ValueError:
        shapes = " and ".join(str(x.shape) for x in found)
        raise ValueError(f"{' and '.join(given)} must have shapes that broadcast, got {shapes}") from None


def require_sorted(knots: Floats) -> None:
    """Raise ValueError unless the knots are finite and do not decrease."""
    if not np.isfinite(knots).all():
        raise ValueError(f"knots[{int(np.argmin(np.isfinite(knots)))}] is not finite")
    falls = knots[1:] < knots[:-1]
    if falls.any():
        k = int(np.argmax(falls))
        raise ValueError(
            f"knots must not decrease, got knots[{k}] = {knots[k]} > knots[{k + 1}] = {knots[k + 1]}"
        )
    if max(abs(knots[0]), abs(knots[-1])) > GREATEST_KNOT:
        raise ValueError(
            f"knots must lie between -{GREATEST_KNOT:g} and {GREATEST_KNOT:g}, got {knots[0]:g} to "
            f"{knots[-1]:g}"
        )


def require_subset(knots: Floats, finer: Floats) -> None:
    """Raise ValueError unless the sorted row `finer` holds every one of `knots`, as often at least."""
    missing = lacking(knots, finer)
    if missing.size:
        raise ValueError(f"the finer knot vector lacks the knot {missing[0]}")


def lacking(knots: Floats, finer: Floats) -> Floats:
    """Return which of `knots` the sorted row `finer` does not hold, or not as often."""
    values, counts = np.unique(knots, return_counts=True)
    found = np.searchsorted(finer, values, "right") - np.searchsorted(finer, values, "left")
    return np.asarray(values[found < counts])


def uniform_breaks(spans: SupportsIndex, start: float, stop: float) -> Floats:
    """Return the ends of `spans` equal spans on [start, stop], (spans + 1,)."""
    require_integer("spans", spans, 1, MOST_SPANS)
    for name, end in (("start", start), ("stop", stop)):
        require_number(name, end, finite=True)
    count, start, stop = int(spans), float(start), float(stop)  # of integers differences may overflow
    if not start < stop:
        raise ValueError(f"start must be less than stop, got {start} and {stop}")
    breaks = start + (stop - start) * (np.arange(count + 1) / count)
    breaks[-1] = stop
    return breaks
