"""Numbers as people read them."""

from __future__ import annotations

MOST_PLAIN = 1e9  # numbers from here on have a power of ten


def plain_number(value: float, digits: int = 4) -> str:
    """Return a number with so many significant digits, and a power of ten only where it is huge or tiny.

    >>> plain_number(1234.5, 2), plain_number(0.01234, 2)
    ('1200', '0.012')
    """
    text = f"{value:.{digits}g}"
    return f"{float(text):.0f}" if "e+" in text and abs(value) < MOST_PLAIN else text
