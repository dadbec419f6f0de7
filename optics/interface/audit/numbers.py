"""Numbers as an audit writes them."""

from __future__ import annotations

RAISED = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")


def loops(ratio: float) -> str:
    """Return a number of calibration loops with two digits."""
    return f"{ratio:.0f}" if ratio >= 10 else f"{ratio:.2g}"


def percent(share: float) -> str:
    """Return a share in per cent with two digits, such as "0.083 %"."""
    return f"{100 * share:.2g} %"


def power(value: float, unit: str = "") -> str:
    """Return a small number with one digit and a power of ten, such as "2 × 10⁻¹⁴ mm"."""
    digit, _, exponent = f"{value:.0e}".partition("e")
    number = f"10{str(int(exponent)).translate(RAISED)}"
    shown = "0" if value == 0 else number if digit == "1" else f"{digit} × {number}"
    return f"{shown} {unit}".rstrip()
