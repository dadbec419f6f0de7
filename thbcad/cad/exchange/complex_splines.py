"""Splines in the text of a STEP file, in the one form of each that OCCT knows.

ISO 10303-21 lets a spline stand as a complex entity `(BOUNDED_SURFACE() B_SPLINE_SURFACE(...) ...)`, with
weights or without; OCCT reads one only with weights.
"""

from __future__ import annotations

import re

from thbcad.io import rewritten

COMPLEX_SPLINE = re.compile(rb"=\s*+\([^;]*?\bB_SPLINE_(?:SURFACE|CURVE)\b")
TOKEN = re.compile(r"'(?:[^']|'')*+'|\(|\)|[A-Z_][A-Z0-9_]*+", re.ASCII)


def common_splines(data: bytes) -> bytes:
    """Return a STEP file with its splines as OCCT reads them, the same bytes where they are so already.

    Complex entities without weights become simple ones, `B_SPLINE_SURFACE_WITH_KNOTS(name, ...)`; those with
    weights stay.  No digit changes, and a damaged file stays damaged.
    """
    if COMPLEX_SPLINE.search(data) is None:
        return data
    return rewritten(data.decode("latin-1"), _common).encode("latin-1")


def _common(body: str) -> str:
    """Return a complex spline without weights as a simple entity; another entity stays."""
    if not body.startswith("(") or "B_SPLINE_" not in body:
        return body
    parts = _parts(body)
    for base in ("B_SPLINE_SURFACE", "B_SPLINE_CURVE"):
        with_knots = f"{base}_WITH_KNOTS"
        if base in parts and with_knots in parts and f"RATIONAL_{base}" not in parts:
            name = parts.get("REPRESENTATION_ITEM") or "''"
            return f"{with_knots}({name},{parts[base]},{parts[with_knots]})"
    return body


def _parts(body: str) -> dict[str, str]:
    """Return the text of the parameters of every type of a complex entity; none of a damaged one."""
    parts: dict[str, str] = {}
    depth = opened = 0
    keyword = ""
    for token in TOKEN.finditer(body):
        if token[0] == "(":
            depth += 1
            opened = token.end() if depth == 2 else opened
        elif token[0] == ")":
            if depth == 2:
                parts[keyword] = body[opened : token.start()].rstrip()
            depth -= 1
        elif depth == 1:
            keyword = token[0]
    return parts if depth == 0 else {}
