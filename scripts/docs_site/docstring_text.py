"""A docstring of this project as Markdown."""

from __future__ import annotations

import re

CODE = re.compile(r"(`+)(.+?)\1", re.DOTALL)
ARGUMENT = re.compile(r"([*\w\\]+(?:, [*\w\\]+)*) : ")
RAISES = re.compile(r"^Raises (?=\w+(?:, \w+)* : )", re.MULTILINE)
NEXT_LINE = re.compile(r"\n(?=\S)")
NEXT_ARGUMENT = re.compile(r"(?:\n|  )(?=[*\w]+(?:, [*\w]+)* : )")
SPECIAL = re.compile(r"([*_\[\]$\\])")


def as_markdown(text: str) -> str:
    """Return a docstring as Markdown: arguments and errors as lists, formulas and the examples at its end as
    code."""
    body, examples, session = text.partition("\n\n>>> ")
    parts = [_paragraph(part) for part in body.strip().split("\n\n")]
    if examples:
        parts.append(f"**Examples**\n\n```pycon\n>>> {session.strip()}\n```")
    return "\n\n".join(parts)


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
