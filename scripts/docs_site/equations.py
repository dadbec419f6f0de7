"""Equations of the pages as MathML, which browsers set without a program."""

from __future__ import annotations

import re
from html import unescape

from latex2mathml.converter import convert

MARKED = re.compile(r'<(span|div) class="arithmatex">\\([(\[])(.*?)\\[)\]]</\1>', re.DOTALL)


def with_equations(html: str) -> str:
    r"""Return a page with MathML in place of each marked \(...\) and \[...\]."""
    return MARKED.sub(lambda found: math(unescape(found[3]), found[2] == "["), html)


def math(tex: str, block: bool = False) -> str:
    """Return TeX as MathML; block : on a line of its own."""
    return convert(tex.strip(), display="block" if block else "inline")
