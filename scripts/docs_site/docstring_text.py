"""A docstring of this project as Markdown."""

from __future__ import annotations

import re

SECTION = re.compile(r"^(\w+)\n-{3,}\n", re.MULTILINE)
CODE = re.compile(r"(`+)(.+?)\1", re.DOTALL)
SPECIAL = re.compile(r"([*_<\[\]$|\\])")


def as_markdown(text: str) -> str:
    """Return a docstring as Markdown: its sections with a bold title, formulas as code."""
    body, *parts = SECTION.split(text)
    sections = [
        f"**{title}**\n\n{_entries(part)}" for title, part in zip(parts[::2], parts[1::2], strict=True)
    ]
    return "\n\n".join([_escaped(body).rstrip(), *sections])


def _entries(part: str) -> str:
    """Return the entries "NAME : meaning" of a section as a list; lines that are indented go on."""
    entries = re.split(r"\n(?=\S)", part.strip())
    return "\n".join("- " + re.sub(r"^(.+?) : ", r"`\1`: ", " ".join(_escaped(e).split())) for e in entries)


def _escaped(text: str) -> str:
    """Return text whose signs mean themselves in Markdown, but in code and in blocks that are indented."""
    lines, block = [], False
    for line in text.split("\n"):
        block = line.startswith("    ") and (block or not lines or not lines[-1].strip())
        lines.append(line if block or not line.strip() else _escaped_line(line))
    return "\n".join(lines)


def _escaped_line(line: str) -> str:
    out, end = [], 0
    for found in CODE.finditer(line):
        out += [SPECIAL.sub(r"\\\1", line[end : found.start()]), f"`{found[2]}`"]
        end = found.end()
    return "".join([*out, SPECIAL.sub(r"\\\1", line[end:])])
