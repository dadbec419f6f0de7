"""Numbers of a text file, asked for one after the other, with sentences where they are missing or wrong."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite, nan

import numpy as np

from optics.base.runtime import UserError
from thbcad.checks import Floats
from thbcad.texts import NUMBER, number

NO_NUMBERS = ("nan", "inf", "infinity")
MOST_ANGLES = 100_000  # of one kind: every hundredth of a degree would be 36 001


class FileNumbers:
    """The words of a file from some place on."""

    def __init__(self, words: Sequence[str]) -> None:
        self._words, self._next = words, 0

    def number(self, what: str) -> float:
        """Return the next number.

        Raises UserError : the file ends, or something else stands there; it says what was wanted.
        """
        if self._next >= len(self._words):
            raise UserError(f"the file ends before its {what}; it may be truncated")
        word = self._words[self._next]
        self._next += 1
        return parsed(word, what)

    def whole(self, what: str, low: int, high: int) -> int:
        """Return the next number, which must be whole and lie between two others."""
        value = self.number(what)
        if value != int(value) or not low <= value <= high:
            raise UserError(f"its {what} must be a whole number from {low} to {high}, got {value:g}")
        return int(value)

    def row(self, count: int, what: str) -> Floats:
        """Return the next `count` numbers; that they are there is known before memory is taken."""
        if count > self.left:
            raise UserError(
                f"its header promises {count} {what}, and {self.left} numbers are left; it may be truncated"
            )
        words = self._words[self._next : self._next + count]
        self._next += count
        return np.array([parsed(word, what) for word in words])

    @property
    def left(self) -> int:
        """How many words are left."""
        return len(self._words) - self._next

    def ascending(self, count: int) -> Floats:
        """Return the next `count` numbers without taking them; none unless each exceeds the one before."""
        try:
            values = FileNumbers(self._words[self._next : self._next + count]).row(count, "numbers")
        except UserError:
            return np.empty(0)
        return values if (np.diff(values) > 0).all() else np.empty(0)

    def require_end(self) -> None:
        """Raise UserError where words follow that the header does not promise."""
        if self.left:
            first = self._words[self._next]
            if not NUMBER.fullmatch(first):
                raise UserError(f"text follows its last number, from {first[:20]!r} on; delete it")
            more = "1 more number follows" if self.left == 1 else f"{self.left} more numbers follow"
            raise UserError(f"{more} than its header promises; its counts are wrong")


def parsed(word: str, what: str) -> float:
    """Return the finite number that a word is; UserError says what was wanted."""
    try:
        value = nan if word.lower().lstrip("+-") in NO_NUMBERS else number(word)
    except ValueError:
        raise UserError(f"its {what} must be numbers, got {word[:20]!r}") from None
    if not isfinite(value):
        raise UserError(f"its {what} must be finite, got {word[:20]!r}")
    return value
