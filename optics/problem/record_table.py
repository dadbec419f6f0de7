"""A record as a small table of HTML, for notebooks."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape


def record_table(caption: str, rows: Mapping[str, str]) -> str:
    """Return plain HTML: a caption, and a row for every name and its text."""
    cells = "".join(f"<tr><th>{escape(name)}</th><td>{escape(text)}</td></tr>" for name, text in rows.items())
    return f"<table><caption>{escape(caption)}</caption>{cells}</table>"
