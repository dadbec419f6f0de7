"""Numbers that a page quotes from stored rows.

In memory a page carries a mark after each quoted number, or after the number and its unit: the name of the
benchmark, a colon, and the full name of the row (`quotes` puts the marks in and takes them out):

    12.7 s<!-- overview: pearl: process start to verified result -->

The number must be the stored value, rounded to the digits that are shown.  Thousands may be set apart by
blanks ("42 074").  The unit, where one is shown, is that of the row or one of `FACTORS`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from benchmarks.rows.stored_rows import StoredRows
from optics.base.runtime import UserError

NUMBER = r"(?<![\w.,])-?(?:\d{1,3}(?: \d{3})+|\d+(?:\.\d+)?(?:e-?\d+)?)"
MARK = re.compile(rf"(?P<number>{NUMBER})?(?P<unit> ?[^\s\d|<>]+)?<!-- (?P<name>\w+): (?P<row>[^\n]+?) -->")
# (unit of the row, unit shown): factor
FACTORS = {
    ("s", "ms"): 1e3,
    ("ms", "s"): 1e-3,
    ("", "%"): 100.0,
    ("MB", "GB"): 1e-3,
}


@dataclass(frozen=True)
class Quoted:
    """A marked number of a page, and the text that the stored row puts in its place.

    factor : from the unit of the row to the unit shown.
    """

    text: str
    wanted: str
    unit: str
    factor: float
    row: Mapping[str, Any]


def marked_numbers(page: str, stored: Mapping[str, StoredRows]) -> list[Quoted]:
    """Return all marked numbers of a page.

    Raises UserError : a mark without a number, of an unknown benchmark or row, or of another unit.
    """
    return [_quoted(match, stored) for match in MARK.finditer(page)]


def quoted_rows(page: str) -> set[tuple[str, str]]:
    """Return (benchmark, full name of the row) of all marks of a page."""
    return {(match["name"], match["row"]) for match in MARK.finditer(page)}


def refreshed(page: str, stored: Mapping[str, StoredRows]) -> str:
    """Return the page with the stored values in place of its marked numbers, in as many digits as before."""

    def replaced(match: re.Match[str]) -> str:
        return _quoted(match, stored).wanted + match[0][len(match["number"]) :]

    return MARK.sub(replaced, page)


def without_marked_numbers(page: str) -> str:
    """Return the page without its marked numbers, their units and their marks."""
    return MARK.sub("", page)


def _quoted(match: re.Match[str], stored: Mapping[str, StoredRows]) -> Quoted:
    name, key = match["name"], match["row"]
    row = f"{name}: {key}"
    if match["number"] is None:
        raise UserError(f"the mark {row!r} stands behind no number")
    if name not in stored:
        raise UserError(f"the mark {row!r} names a benchmark without stored rows")
    named = [r for full, r in stored[name].named() if full == key]
    if len(named) != 1:
        raise UserError(f"the mark {row!r} names {len(named)} rows of the stored rows, wanted one")
    value, unit = named[0]["value"], named[0]["unit"]
    seen = (match["unit"] or "").strip()
    factor = 1.0 if seen in ("", unit) else FACTORS.get((unit, seen))
    if factor is None:
        raise UserError(f"the mark {row!r} shows the unit {seen!r}, the row has {unit!r}")
    if value is None:
        raise UserError(f"the mark {row!r} names a row without a finite value")
    wanted = rounded(factor * value, match["number"])
    return Quoted(match["number"], wanted, seen or unit, factor, named[0])


def rounded(value: float, like: str) -> str:
    """Return a number with the digits of another one: its decimals, its power of ten, its groups."""
    mantissa, _, exponent = like.partition("e")
    decimals = len(mantissa.partition(".")[2])
    if exponent:
        mantissa, _, exponent = f"{value:.{decimals}e}".partition("e")
        return f"{mantissa}e{int(exponent)}" if value else "0"
    text = f"{value:,.{decimals}f}" if " " in like else f"{value:.{decimals}f}"
    text = text.replace(",", " ")
    return text.removeprefix("-") if float(text.replace(" ", "")) == 0 else text
