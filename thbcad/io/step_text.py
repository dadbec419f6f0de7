"""The text of STEP files: entities and their parameters, by ISO 10303-21 (the clear text encoding), without
OCCT.

A file is split into entities by one regular expression; an entity is made, and its parameters are read, when
they are asked for. Nothing in the file is executed, and sizes are checked before memory is taken.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

MOST_BYTES = 1 << 28
MOST_ENTITIES = 4_000_000
MOST_NESTED = 16  # lists within lists
NUMBER = r"\d{1,15}+(?!\d)"
REAL = r"[+-]?\d++\.\d*+(?:E[+-]?\d++)?"
STRING = r"'(?>(?:[^']|'')*)'"

# a statement ends with ";", but not within a string; "(?>...)", "++" and "*+" never step back, so that no
# damaged text takes long; "++" and "*+" behind a group are wrong before Python 3.11.5
STATEMENT = rf"(?>(?:[^';]++|{STRING})+);\s*+"
HEAD = re.compile(
    rf"\s*+ISO-10303-21\s*+;\s*+HEADER\s*+;\s*+(?P<statements>(?>(?:(?!ENDSEC\b){STATEMENT})*))"
    r"ENDSEC\s*+;\s*+DATA\s*+;\s*+",
    re.ASCII,
)
HEADER_ENTITY = re.compile(rf"((?>(?:[^';]++|{STRING})+));\s*+", re.ASCII)
ENTITY = re.compile(rf"#({NUMBER})\s*+=\s*+((?>(?:[^';]++|{STRING})+));\s*+", re.ASCII)
POINT = "CARTESIAN_POINT"  # most entities of a file are such
TAIL = re.compile(r"ENDSEC\s*+;\s*+END-ISO-10303-21\s*+;\s*+", re.ASCII)
COMMENT = re.compile(rf"({STRING})|/\*.*?\*/", re.DOTALL)
TEXT_OR_REFERENCE = re.compile(rf"{STRING}|#(\d++)", re.ASCII)
KEYWORD = r"[A-Z_][A-Z0-9_]*+"
# control directives: two or four bytes a character, one byte, a character of the upper half, an alphabet
DIRECTIVE = re.compile(
    r"\\X2\\(?P<two>(?>(?:[0-9A-F]{4})+))\\X0\\|\\X4\\(?P<four>(?>(?:[0-9A-F]{8})+))\\X0\\"
    r"|\\X\\(?P<byte>[0-9A-F]{2})|\\S\\(?P<upper>.)|\\P[A-I]\\|(?P<backslash>\\\\)|[\r\n]",
    re.ASCII,
)
INSTANCE = re.compile(rf"(?:{KEYWORD}|(?P<complex>\())\s*+", re.ASCII)
TOKEN = re.compile(
    rf"(?:(?P<open>\()|(?P<close>\))|(?P<comma>,)|#(?P<reference>{NUMBER})|(?P<real>{REAL})|(?P<integer>[+-]?{NUMBER})"
    rf"|(?P<string>{STRING})|\.(?P<enumeration>{KEYWORD})\.|(?P<keyword>{KEYWORD})|(?P<omitted>\$)|(?P<derived>\*))\s*+",
    re.ASCII,
)
REFERENCES = re.compile(rf"(?>(?:#{NUMBER}\s*+,\s*+)+)#{NUMBER}\s*+\)\s*+", re.ASCII)  # and nothing else


class Reference(int):
    """The number of another entity."""


class Enumeration(str):
    """A name between dots: .T., .F., .MILLI."""


@dataclass(frozen=True)
class Typed:
    """A parameter with its type, such as LENGTH_MEASURE(1.E-7)."""

    keyword: str
    parameters: list[Value]


Value = int | float | str | Reference | Enumeration | Typed | list["Value"] | None  # None: $ or *, not given


def decoded(text: str) -> str:
    """Return what a string between quotes says: its control directives decoded, as ISO 10303-21 section 6.4.3
    has them."""
    return DIRECTIVE.sub(_character, text[1:-1].replace("''", "'"))


def _character(directive: re.Match[str]) -> str:
    """Return the characters of a directive; those that Unicode does not have become U+FFFD."""
    if two := directive["two"]:
        return bytes.fromhex(two).decode("utf-16-be", "replace")
    if four := directive["four"]:
        return bytes.fromhex(four).decode("utf-32-be", "replace")
    if byte := directive["byte"]:
        return chr(int(byte, 16))
    if upper := directive["upper"]:
        return chr(ord(upper) + 128)
    return "\\" if directive["backslash"] else ""


CONVERT: Mapping[str, Callable[[str], Value]] = {
    "reference": Reference,
    "real": float,
    "integer": int,
    "string": decoded,
    "enumeration": Enumeration,
    "omitted": lambda _: None,
    "derived": lambda _: None,
}


@dataclass(frozen=True, eq=False)
class Entity:
    """One entity of a file; `text` is what stands between "=" and ";"."""

    number: int
    text: str

    @cached_property
    def parts(self) -> dict[str, list[Value]]:
        """The parameters of every type that the entity has: one, or several of a complex entity
        `( A(...) B(...) )`.

        Raises ValueError : text that does not follow the grammar.
        """
        return _Parser(self).parts()

    def parameters(self, keyword: str, count: int) -> list[Value]:
        """Return the parameters under a keyword; raise ValueError for another type or number of them."""
        parameters = self.parts.get(keyword)
        if parameters is None:
            raise self.wrong(f" must be a {keyword}, got {' and '.join(self.parts)[:80]}")
        if len(parameters) != count:
            raise self.wrong(f": {keyword} must have {count} parameters, got {len(parameters)}")
        return parameters

    def wrong(self, what: object) -> ValueError:
        """Return the error of an entity that is not as it should be."""
        return ValueError(f"STEP entity #{self.number}{what}")


class Entities(Mapping[int, Entity]):
    """The entities of a file by number, in their order.

    texts : as `Entity.text`.
    """

    def __init__(self, texts: dict[int, str]) -> None:
        self.texts, self._made = texts, dict[int, Entity]()

    def __getitem__(self, number: int) -> Entity:
        if number not in self._made:
            self._made[number] = Entity(number, self.texts[number])
        return self._made[number]

    def __iter__(self) -> Iterator[int]:
        return iter(self.texts)

    def __len__(self) -> int:
        return len(self.texts)

    @cached_property
    def beside_points(self) -> list[tuple[int, str]]:
        """Number and text of those that are no points, which most are."""
        return [row for row in self.texts.items() if not row[1].startswith(POINT)]


def read_part21(path: str | Path) -> Entities:
    """Return the entities of a STEP file by number, in their order.

    Raises OSError : the file cannot be read.
    Raises ValueError : it is no STEP file, not whole, larger than 256 MiB or 4,000,000 entities, or refers to
        entities that it does not hold.
    """
    return read_file(path)[1]


def read_file(path: str | Path) -> tuple[dict[str, list[Value]], Entities]:
    """Return the header of a STEP file, as `header_of_text`, and its entities, as `read_part21`."""
    path = Path(path)
    if path.exists() and not path.is_file():
        raise ValueError(f"{path} is not a file")
    with path.open("rb") as file:
        data = file.read(MOST_BYTES + 1)
    if len(data) > MOST_BYTES:
        raise ValueError(f"{path} is larger than {MOST_BYTES >> 20} MiB, the most that is read")
    try:
        text = data.decode("latin-1")
        return header_of_text(text), entities_of_text(text)
    except ValueError as error:
        raise ValueError(f"{path} is not a whole STEP file: {error}") from None


def header_of_text(text: str) -> dict[str, list[Value]]:
    """Return the parameters of FILE_DESCRIPTION, FILE_NAME, FILE_SCHEMA, ...; raise ValueError as
    `read_part21`."""
    statements = _head(_without_comments(text))["statements"]
    header: dict[str, list[Value]] = {}
    for statement in HEADER_ENTITY.finditer(statements):
        header |= Entity(0, statement[1]).parts
    return header


def _without_comments(text: str) -> str:
    return COMMENT.sub(lambda m: m[1] or " ", text) if "/*" in text else text


def _head(text: str) -> re.Match[str]:
    head = HEAD.match(text)
    if head is None:
        raise ValueError("its head must be ISO-10303-21; HEADER; ... ENDSEC; DATA;")
    return head


def entities_of_text(text: str) -> Entities:
    """Return the entities of a STEP file's text; raise ValueError as `read_part21`."""
    text = _without_comments(text)
    start, match, rows = _head(text).end(), ENTITY.match, list[Sequence[str]]()
    while entity := match(text, start):
        if len(rows) == MOST_ENTITIES:
            raise ValueError(f"it has more than {MOST_ENTITIES} entities")
        rows.append(entity.groups())
        start = entity.end()
    entities = Entities({int(number): body for number, body in rows})
    if len(entities) < len(rows):
        number, _ = Counter(int(number) for number, _ in rows).most_common(1)[0]
        raise ValueError(f"entity #{number} stands twice")
    if not TAIL.fullmatch(text, start):
        raise ValueError(f"it is cut off or damaged after entity #{rows[-1][0] if rows else 0}")
    bodies = (body for body in entities.texts.values() if "#" in body)  # few: most are points
    lacking = {
        int(k[:16]) for body in bodies for k in TEXT_OR_REFERENCE.findall(body) if k
    } - entities.texts.keys()
    if lacking:
        raise ValueError(f"it lacks entity #{min(lacking)}, to which others refer")
    return entities


def rewritten(text: str, change: Callable[[str], str]) -> str:
    """Return the text of a STEP file, without its comments, with what stands between "=" and ";" changed; one
    that is damaged keeps all that follows the damage."""
    text = _without_comments(text)
    head = HEAD.match(text)
    place = head.end() if head else len(text)
    pieces = [text[:place]]
    while entity := ENTITY.match(text, place):
        pieces += [text[place : entity.start(2)], change(entity[2]), text[entity.end(2) : entity.end()]]
        place = entity.end()
    return "".join([*pieces, text[place:]])


def having(entities: Entities, keyword: str) -> list[Entity]:
    """Return the entities of one type other than points, in their order."""
    rows = (entities[number] for number, text in entities.beside_points if keyword in text)
    return [e for e in rows if keyword in e.parts]


class _Parser:
    """The grammar of one entity, over its tokens."""

    def __init__(self, entity: Entity) -> None:
        self._number = entity.number
        self._text = entity.text
        self._place = 0

    def parts(self) -> dict[str, list[Value]]:
        first = INSTANCE.match(self._text)
        if first is None:
            raise self._wrong()
        parts: dict[str, list[Value]] = {}
        if first["complex"]:
            self._place = first.end()
        while True:
            kind, keyword = self._next()
            if kind == "close" and first["complex"] and parts:
                break
            if kind != "keyword" or keyword in parts:
                raise self._wrong()
            parts[keyword] = self._list(0)
            if not first["complex"]:
                break
        if self._place != len(self._text):
            raise self._wrong()
        return parts

    def _list(self, depth: int) -> list[Value]:
        """Return the parameters that stand between "(" and ")"."""
        if depth > MOST_NESTED or self._next()[0] != "open":
            raise self._wrong()
        return self._rest(depth)

    def _rest(self, depth: int) -> list[Value]:
        """Return the parameters up to ")", behind "("."""
        if row := REFERENCES.match(self._text, self._place):  # nets of poles are made of such lists
            self._place = row.end()
            return [Reference(number) for number in re.findall(r"\d++", row[0], re.ASCII)]
        values: list[Value] = []
        kind, text = self._next()
        if kind == "close":
            return values
        while True:
            if kind == "open" and depth < MOST_NESTED:
                values.append(self._rest(depth + 1))
            elif kind == "keyword":
                values.append(Typed(text, self._list(depth + 1)))
            elif kind in CONVERT:
                values.append(CONVERT[kind](text))
            else:
                raise self._wrong()
            kind, text = self._next()
            if kind == "close":
                return values
            if kind != "comma":
                raise self._wrong()
            kind, text = self._next()

    def _next(self) -> tuple[str, str]:
        token = TOKEN.match(self._text, self._place)
        if token is None or token.lastgroup is None:
            raise self._wrong()
        self._place = token.end()
        return token.lastgroup, token[token.lastgroup]

    def _wrong(self) -> ValueError:
        what = f"STEP entity #{self._number}" if self._number else "the header"
        return ValueError(
            f"{what} does not follow the grammar at character {self._place}: {self._text[:60]!r}"
        )
