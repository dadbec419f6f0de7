"""Coefficients as scripts hold them: one vector of a single free surface, a tuple of vectors of two."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from optics.base.runtime import UserError
from thbcad.checks import Floats, floats, require_real
from thbcad.hierarchy import THBSpace

T = TypeVar("T")
Coefficients: TypeAlias = Floats | tuple[Floats, ...]  # front first
Spaces: TypeAlias = THBSpace | tuple[THBSpace, ...]
NAMES = {1: ("free surface",), 2: ("front", "rear")}


def space_rows(spaces: Spaces, wanted: Sequence[THBSpace]) -> tuple[THBSpace, ...]:
    """Return the spaces as a tuple, front first.

    wanted : the system's own spaces of level 0.

    Raises UserError : another number of spaces, or one over other knots of level 0.
    """
    rows = spaces if isinstance(spaces, tuple) else (spaces,)
    if len(rows) != len(wanted) or not all(isinstance(space, THBSpace) for space in rows):
        raise UserError(f"space must be {_wanted(len(wanted), 'THBSpace')}, got {spaces!r}")
    for name, space, own in zip(NAMES[len(rows)], rows, wanted):
        if (space.kv_u, space.kv_v) != (own.kv_u, own.kv_v):
            raise UserError(
                f"the space of the {name} must refine the problem's own: take system.space(level=0) and "
                "refine it"
            )
    return rows


def vectors(coefficients: object, spaces: Sequence[THBSpace], what: str = "coefficients") -> list[Floats]:
    """Return coefficients as a list of finite vectors, front first.

    Raises UserError : another number or length of vectors, or what is no finite number.
    """
    rows = coefficients if isinstance(coefficients, tuple) else (coefficients,)
    if len(rows) != len(spaces):
        raise UserError(f"{what} must be {_wanted(len(spaces), 'vector')}, got {len(rows)} of them")
    return [_vector(row, s, f"{what} of the {n}") for row, s, n in zip(rows, spaces, NAMES[len(rows)])]


def packed(rows: Sequence[T]) -> T | tuple[T, ...]:
    """Return one vector or surface as it is, several as a tuple."""
    return rows[0] if len(rows) == 1 else tuple(rows)


def image_of(values: ArrayLike, shape: tuple[int, int], what: str) -> Floats:
    """Return finite numbers on pixels.

    Raises UserError : another shape, or what is no finite number.
    """
    image = real_numbers(values, what)
    if image.shape != shape:
        raise UserError(f"{what} must have the shape {shape} of the model's pixels, got {image.shape}")
    return image


def _vector(row: object, space: THBSpace, what: str) -> Floats:
    vector = real_numbers(row, what)
    if vector.shape != (space.dim,):
        raise UserError(
            f"{what} must have the shape ({space.dim},) of its space, got {vector.shape}; "
            "space.prolongation(finer) brings coefficients to a finer space"
        )
    return vector


def real_numbers(values: Any, what: str) -> Floats:
    """Return finite numbers as float64.

    Raises UserError : other values than numbers; complex, masked or infinite ones.
    """
    try:
        require_real(values)
    except ValueError as error:
        raise UserError(f"{what}: {error}") from None
    try:
        array = floats(values)
    except (TypeError, ValueError):
        raise UserError(f"{what} must be numbers, got {type(values).__name__}") from None
    bad = np.count_nonzero(~np.isfinite(array))
    if bad:
        raise UserError(f"{what} must be finite, got {bad} numbers that are not")
    return array


def _wanted(count: int, what: str) -> str:
    return f"a {what}" if count == 1 else f"a tuple of {count} {what}s, front first"
