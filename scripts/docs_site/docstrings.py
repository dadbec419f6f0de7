"""Docstrings as Markdown: an extension of griffe, which reads the packages without importing them."""

from __future__ import annotations

from typing import Any

from griffe import Alias, Extension, Object

from scripts.docs_site.docstring_text import as_markdown


class Docstrings(Extension):
    """Puts Markdown in place of every docstring of a package."""

    def on_package(self, *, pkg: Object, **_: Any) -> None:
        """Walk through a package that was read."""
        for member in pkg.members.values():
            if isinstance(member, Alias):
                continue
            if member.docstring:
                member.docstring.value = as_markdown(member.docstring.value)
            self.on_package(pkg=member)
