"""The amounts of tolerances that arguments and a file name, and the limits that light must keep."""

from __future__ import annotations

import reprlib
from argparse import Namespace
from collections.abc import Mapping, Sequence
from math import inf
from pathlib import Path
from typing import Any, NamedTuple

from optics.base.runtime import UserError, read_at_most
from thbcad.texts import text_of
from thbcad.toml import toml_tables

LARGEST_FILE = 1 << 20  # bytes of a file of amounts
FORM = ".form"  # ends the name of a form error, such as rear.form, in nm rms


class Amounts(NamedTuple):
    """Other amounts than the usual ones, by name.  forms : of "front" and "rear", nm rms; None is usual."""

    tolerances: dict[str, Any]
    forms: dict[str, Any] | None


def amounts_of(options: Namespace) -> Amounts:
    """Return the amounts of --tolerances and --set; of two for a name, --set's last one holds.

    Raises UserError : no number, or a file that cannot be read.
    """
    named = _of_file(options.tolerances) | dict(map(_amount, options.set))
    forms = {name.removesuffix(FORM): named.pop(name) for name in [*named] if name.endswith(FORM)}
    return Amounts(named, forms or None)


def periods_of(text: str) -> tuple[float, float]:
    """Return the shortest and the longest period of "SHORTEST:LONGEST", mm.

    Raises UserError : another text.
    """
    try:
        short, long = map(float, text.split(":"))
    except ValueError:
        raise UserError(f"--periods takes SHORTEST:LONGEST in mm, such as 2:20, got {text!r}") from None
    return short, long


def limits_of(texts: Sequence[str]) -> dict[str, float] | None:
    """Return the limits of --limit by name, None where there are none; a bare number is a rise of rel_l2.  A
    number that ends in % is so many hundredths.

    Raises UserError : no number.
    """
    limits = {}
    for text in texts:
        name, equals, value = (part.strip() for part in text.rpartition("="))
        try:
            number = float(value.removesuffix("%"))
            limits[name if equals else "rise"] = number / 100 if value.endswith("%") else number
        except ValueError:
            raise UserError(
                "--limit takes a rise of rel_l2, such as 0.01 or 1%, or NAME=VALUE, as min_over_mean=0.7, "
                f"got {text!r}"
            ) from None
    return limits or None


def _amount(text: str) -> tuple[str, float]:
    """Return name and amount of "NAME=AMOUNT"."""
    name, _, value = (part.strip() for part in text.partition("="))
    try:
        return name, float(value)
    except ValueError:
        raise UserError(
            f"--set takes NAME=AMOUNT with a number, such as lens.decentre=0.02, got {text!r}"
        ) from None


def _of_file(path: str | None) -> dict[str, Any]:
    """Return the amounts of a TOML file by name."""
    if path is None:
        return {}
    file = Path(path)
    data = read_at_most(file, LARGEST_FILE, pipes=True)
    try:
        amounts = dict(_flat(toml_tables(text_of(data))))
    except ValueError as error:
        raise UserError(f"{file} is no TOML: {error}") from None
    for name, amount in amounts.items():
        number = isinstance(amount, int | float) and not isinstance(amount, bool)
        if not (number and 0 <= amount < inf):
            raise UserError(
                f"{file}: {name} must be a number from 0, got {reprlib.repr(amount)}; a file of amounts has "
                "lines such as lens.decentre = 0.02"
            )
    return amounts


def _flat(table: Mapping[str, Any], prefix: str = "") -> list[tuple[str, Any]]:
    """Return the values of nested tables by dotted name."""
    rows = []
    for key, value in table.items():
        rows += _flat(value, f"{prefix}{key}.") if isinstance(value, Mapping) else [(prefix + key, value)]
    return rows
