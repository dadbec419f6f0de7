"""What a page says of a study: claims with verdicts, tables, pictures, and choices; as Markdown."""

from __future__ import annotations

from collections.abc import Callable, Sequence
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
    """Something that the thesis leaves open, and what was taken here."""

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
    if section.choices:
        blocks.append(
            _table(("left open in the thesis", "taken here"), [(c.open, c.taken) for c in section.choices])
        )
    blocks += [f"![{p.name}]({p.name}.png)\n\n*{p.caption}*" for p in section.pictures]
    return "\n\n".join(blocks) + "\n"


def verdicts_text(sections: Sequence[Section], page: Callable[[int], str]) -> str:
    """Return how many claims of each section hold and fail, as Markdown; page : of a section's number."""
    rows = []
    for section in sections:
        words = [claim.word for claim in section.claims]
        link = f"[{section.title}]({page(section.number)})"
        rows.append((str(section.number), link, *(str(words.count(word)) for word in VERDICTS)))
    return _table(("study", "on", *VERDICTS), rows) + "\n"


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    first, *others = (
        f"| {' | '.join(cell.replace('|', '&#124;') for cell in line)} |" for line in (head, *rows)
    )
    return "\n".join([first, "|---" * len(head) + "|", *others])
