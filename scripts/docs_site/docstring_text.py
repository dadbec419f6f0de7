"""A docstring of this project as Markdown."""

from __future__ import annotations

import re

SECTION = re.compile(r"^(\w+)\n-{3,}\n", re.MULTILINE)
CODE = re.compile(r"(`+)(.+?)\1", re.DOTALL)
ARGUMENT = re.compile(r"([*\w\\]+(?:, [*\w\\]+)*) : ")
RAISES = re.compile(r"^Raises (?=\w+(?:, \w+)* : )", re.MULTILINE)
NEXT_LINE = re.compile(r"\n(?=\S)")
NEXT_ARGUMENT = re.compile(r"(?:\n|  )(?=[*\w]+(?:, [*\w]+)* : )")
SPECIAL = re.compile(r"([*_\[\]$\\])")


def as_markdown(text: str) -> str:
    """Return a docstring as Markdown: arguments and sections as lists, formulas and examples as code."""
    body, *parts = SECTION.split(text)
    sections = [
        f"**{title}**\n\n{_session(part) if title == 'Examples' else _list(NEXT_LINE.split(part.strip()))}"
        for title, part in zip(parts[::2], parts[1::2], strict=True)
    ]
    return "\n\n".join([*map(_paragraph, body.strip().split("\n\n")), *sections])


def _session(text: str) -> str:
    """Return what was typed and printed as a block of code."""
    return f"```pycon\n{text.strip()}\n```"


def _paragraph(text: str) -> str:
    """Return a paragraph; "NAME : meaning" begins a list of arguments, after "Raises" one of errors."""
    if RAISES.match(text):
        return f"**Raises**\n\n{_list(NEXT_LINE.split(RAISES.sub('', text)))}"
    return _list(NEXT_ARGUMENT.split(text)) if ARGUMENT.match(text) else _escaped(text)


def _list(entries: list[str]) -> str:
    """Return entries "NAME : meaning" as a list; lines that are indented go on."""
    lines = [" ".join(_escaped_line(entry).split()) for entry in entries]
    return "\n".join("- " + ARGUMENT.sub(lambda found: f"`{_plain(found[1])}`: ", line) for line in lines)


def _plain(text: str) -> str:
    """Return text without the strokes that keep its signs."""
    return text.replace("\\", "")


def _escaped(text: str) -> str:
    """Return text whose signs mean themselves in Markdown, but in code and in blocks that are indented."""
    lines: list[str] = []
    block = False
    for line in text.split("\n"):
        block = line.startswith("    ") and (block or not lines)
        lines.append(line if block or not line.strip() else _escaped_line(line))
    return "\n".join(lines)


def _escaped_line(line: str) -> str:
    out, end = [], 0
    for found in CODE.finditer(line):
        out += [_text(line[end : found.start()]), f"`{found[2]}`"]
        end = found.end()
    return "".join([*out, _text(line[end:])])


def _text(text: str) -> str:
    """Return what stands outside code: a stroke before signs of Markdown, an entity for that of HTML."""
    return SPECIAL.sub(r"\\\1", text).replace("<", "&lt;")
