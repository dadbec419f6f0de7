"""Several values for a key, as KEY=VALUES of a command line."""

from __future__ import annotations

from decimal import Decimal, InvalidOperation
from math import isfinite
from pathlib import Path
from typing import Any

from optics.base.runtime import UserError
from optics.scene.problem import Problem, assignment

MOST_VALUES = 100_000  # of one key
FILE_KEYS = ("target.image", "source.image", "source.file")  # whose values are paths


def value_list(text: str, folder: Path) -> tuple[str, list[Any]]:
    """Return key and values of a text "KEY=START:STOP:COUNT" or "KEY=[VALUE, ...]".

    Both ends of a range belong to it.  A list is TOML, or JSON without null.

    folder : what relative paths of files start from.

    Raises
    ------
    UserError : no "=", an unknown key, values that are neither, such as a list of texts without quotes.
    """
    name, _, value = (part.strip() for part in text.partition("="))
    parts = value.split(":")
    try:
        ends = [Decimal(part.strip()) for part in parts] if len(parts) == 3 else []
    except InvalidOperation:
        ends = []
    if ends:
        assignment(f"{name}=[]", Problem)  # refuses an unknown key
        return name, _range(name, *ends)
    name, found = assignment(text, Problem)
    if found == value and value.startswith("["):
        raise UserError(f'{value} is no list for {name}: put texts in quotes, such as {name}=["a", "b"]')
    values = found if isinstance(found, list) else [found]
    if name in FILE_KEYS:
        values = [str((folder / one).absolute()) if isinstance(one, str) and one else one for one in values]
    return name, values


def _range(name: str, start: Decimal, stop: Decimal, count: Decimal) -> list[Any]:
    """Return evenly spaced numbers, both ends included; whole ones where all of them are written so."""
    if not count.is_finite() or count != count.to_integral_value() or not 1 <= count <= MOST_VALUES:
        raise UserError(f"{name}: the count of a range must be from 1 to {MOST_VALUES}, got {count}")
    if not all(end.is_finite() and isfinite(float(end)) for end in (start, stop)):
        raise UserError(f"{name}: both ends of a range must be finite, got {start}:{stop}")
    if count == 1 and start != stop:
        raise UserError(f"{name}: a range of one value must begin and end with it, got {start}:{stop}:1")
    steps = max(int(count) - 1, 1)
    values = [start + (stop - start) * k / steps for k in range(int(count))]
    if all(value == value.to_integral_value() for value in values) and all(
        "." not in str(e) for e in (start, stop)
    ):
        return [int(value) for value in values]
    return [float(value) for value in values]
