"""Little-endian records at the head of a file, and rows of numbers behind them, with sizes checked first."""

from __future__ import annotations

from collections.abc import Container, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from optics.base.runtime import UserError
from optics.scene.ray_files.ray_set import UNIT_LENGTH

Single = NDArray[np.float32]


def packed_type(fields: Mapping[str, str]) -> np.dtype[Any]:
    """Return the type of a record without gaps, from the numpy types of its fields in their order."""
    return np.dtype([*fields.items()]).newbyteorder("<")


def record(data: memoryview, kind: np.dtype[Any], path: Path) -> dict[str, Any]:
    """Return the record at the head of a file, by the names of its fields.

    Raises UserError : the file is shorter.
    """
    if len(data) < kind.itemsize:
        raise UserError(
            f"{path} ends in its header, after {len(data)} of {kind.itemsize} bytes; it may be truncated"
        )
    row = np.frombuffer(data[: kind.itemsize], kind)[0]
    assert kind.names is not None
    return {name: row[name].tolist() for name in kind.names}


def require_known(head: Mapping[str, Any], values: Mapping[str, Container[Any]], path: Path) -> None:
    """Raise UserError where a field of a header has none of the values that it may have."""
    for key, known in values.items():
        if head[key] not in known:
            raise UserError(f"{path} has an unknown {key.replace('_', ' ')} {head[key]} in its header")


def rows(data: memoryview, start: int, count: int, columns: int) -> Single:
    """Return rows of numbers in single precision, (count, columns); the file is known to hold them."""
    stop = start + 4 * count * columns
    return np.frombuffer(data[start:stop], "<f4").reshape(count, columns).astype(np.float32, copy=False)


def require_rows(path: Path, data: memoryview, start: int, count: int, columns: int) -> None:
    """Raise UserError unless a file holds the rays that its header promises, no fewer and no more.

    What follows them may be anything but a ray: programs add a trailer.
    """
    stop = start + 4 * count * columns
    if stop > len(data):
        raise UserError(
            f"{path} is too short for what its header says: {count} rays of {4 * columns} bytes behind"
            f" {start} bytes need {stop} bytes, it has {len(data)}; it may be truncated"
        )
    more = (len(data) - stop) // (4 * columns)
    if more and are_rays(rows(data, stop, 1, columns)):
        raise UserError(
            f"{path} is too long for what its header says: {count} rays, and {more} more behind them; "
            "mend the count in its header"
        )


def are_rays(table: Single) -> bool:
    """Return whether rows of numbers, which begin with position and direction, have unit directions."""
    with np.errstate(all="ignore"):  # what is no direction may be any number
        length = np.linalg.norm(table[:, 3:6].astype(np.float64), axis=1)
    return bool((np.abs(length - 1) <= UNIT_LENGTH).all())
