"""What a page says of a study: claims with verdicts, tables, pictures, and choices; as Markdown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

VERDICTS = ("holds", "fails", "cannot be judged")


@dataclass(frozen=True)
class Claim:
    """What the thesis says, where, what was found here, and whether it holds.

    verdict : one of VERDICTS; True and False stand for the first two.
    """

    says: str
    where: str
    found: str
    verdict: str | bool

    @property
    def word(self) -> str:
        word = (
            {True: "holds", False: "fails"}.get(self.verdict)
            if isinstance(self.verdict, bool)
            else self.verdict
        )
        if word not in VERDICTS:
            raise ValueError(f"a verdict is one of {', '.join(VERDICTS)}, got {word!r}")
        return word


@dataclass(frozen=True)
class Table:
    """Rows of words and numbers, ready to print."""

    caption: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]


@dataclass(frozen=True)
class Picture:
    """A picture of the page: NAME.png."""

    name: str
    caption: str


@dataclass(frozen=True)
class Choice:
    """Something that the thesis leaves open, or prints wrongly, and what was taken here."""

    open: str
    taken: str


@dataclass(frozen=True)
class Section:
    """One study on the page of its chapter.

    text : paragraphs: what was run.
    """

    number: int
    title: str
    text: Sequence[str]
    claims: Sequence[Claim]
    tables: Sequence[Table] = ()
    pictures: Sequence[Picture] = ()
    choices: Sequence[Choice] = ()


def section_text(section: Section) -> str:
    """Return a section as Markdown."""
    blocks = [f"## {section.number}. {section.title}", *section.text]
    if section.claims:
        rows = [(c.says, c.where, c.found, f"**{c.word}**") for c in section.claims]
        blocks.append(_table(("the thesis says", "where", "found here", "verdict"), rows))
    for table in section.tables:
        blocks += [table.caption, _table(table.head, table.rows)]
    blocks += [f"![{p.caption}]({p.name}.png)\n\n*{p.caption}*" for p in section.pictures]
    return "\n\n".join(blocks) + "\n"


def verdicts_text(sections: Sequence[Section]) -> str:
    """Return one line per claim of all sections, as Markdown."""
    rows = [(str(s.number), c.says, f"**{c.word}**") for s in sections for c in s.claims]
    return _table(("study", "the thesis says", "verdict"), rows) + "\n"


def choices_text(sections: Sequence[Section]) -> str:
    """Return the choices of all sections in one table, as Markdown."""
    rows = [(str(s.number), c.open, c.taken) for s in sections for c in s.choices]
    return _table(("study", "left open or misprinted", "taken here"), rows) + "\n"


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(cell.replace('|', '&#124;') for cell in line)} |" for line in lines)
