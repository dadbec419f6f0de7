"""The help that the parsers print, on the page of commands."""

from __future__ import annotations

from optics.interface.commands import parsers


def with_help(page: str) -> str:
    """Return the page of commands with the help that the program prints at the end of each section.

    Raises ValueError : a command has no section.
    """
    introduction, *sections = page.split("\n## ")
    known = parsers()[1]
    titles = [section.partition("\n")[0] for section in sections]
    missing = [name for name in known if name not in titles]
    if missing:
        raise ValueError(f"docs/commands.md has no section '## {missing[0]}'; add it")
    told = [
        s + (_help(t, known[t].format_help()) if t in known else "")
        for t, s in zip(titles, sections, strict=True)
    ]
    return "\n## ".join([introduction, *told])


def _help(name: str, text: str) -> str:
    """Return help as a block that opens on a click."""
    lines = ["```", *text.splitlines(), "```"]
    shown = "\n".join(f"    {line}".rstrip() for line in lines)
    return f'\n\n??? note "thbcad {name} --help"\n\n{shown}\n'
