"""Equations of the pages as MathML, which browsers set without a program."""

from __future__ import annotations

import re
from html import unescape

from latex2mathml.converter import convert

MARKED = re.compile(r'<(span|div) class="arithmatex">\\([(\[])(.*?)\\[)\]]</\1>', re.DOTALL)
UNKNOWN = re.compile(r"<m[iot][^>]*>(\\[^<]*|&)</m")  # what is left of TeX


def with_equations(html: str) -> str:
    r"""Return a page with MathML in place of each marked \(...\) and \[...\]."""
    return MARKED.sub(lambda found: math(unescape(found[3]), found[2] == "["), html)


def math(tex: str, block: bool = False) -> str:
    """Return TeX as MathML; block : on a line of its own.

    Raises ValueError : a command that the converter does not know.
    """
    known = tex.strip().replace("{aligned}", "{split}")  # the converter has the other name alone
    mathml = convert(known, display="block" if block else "inline")
    unknown = UNKNOWN.search(mathml)
    if unknown:
        raise ValueError(
            f"the equation {tex.strip()!r} has {unknown[1]!r}, which cannot be written as MathML"
        )
    return mathml
