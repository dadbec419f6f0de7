"""TOML as tables, in time and memory that grow with the text alone.

The standard library takes the square of a key's parts, and a level of its stack for every bracket.
"""

import re
import tomllib
from typing import Any

MOST_PARTS = 16  # of a dotted key
MOST_DEPTH = 16  # of brackets and braces within each other

# what holds dots and brackets that say nothing; one that does not end goes on to the end of its line or text.
# The last of the quotes that end several lines may be preceded by two of their own
_QUOTED = re.compile(
    r'"""(?>(?:\\.|(?!""").)*)"{0,5}|\'\'\'(?>(?:(?!\'\'\').)*)\'{0,5}'
    r'|"(?>(?:\\.|[^"\\\n])*)"?|\'[^\'\n]*+\'?|#[^\n]*+',
    re.DOTALL,
)
_LONG_KEY = re.compile(r"(?:\.[^.,=\n\[\]{}]*+)" + f"{{{MOST_PARTS}}}")
_BRACKET = re.compile(r"[\[\]{}]")


def toml_tables(text: str) -> dict[str, Any]:
    """Return the tables of a TOML text.

    Raises ValueError : no TOML; a key of more than 16 parts, values nested more than 16 deep.
    """
    bare = _QUOTED.sub(lambda quoted: "_" + "\n" * quoted[0].count("\n"), text)
    long = _LONG_KEY.search(bare)
    if long:
        raise ValueError(f"a key has more than {MOST_PARTS} parts ({_place(bare, long)})")
    depth = 0
    for bracket in _BRACKET.finditer(bare):
        depth = depth + 1 if bracket[0] in "[{" else max(depth - 1, 0)
        if depth > MOST_DEPTH:
            raise ValueError(f"values are nested more than {MOST_DEPTH} deep ({_place(bare, bracket)})")
    return tomllib.loads(text)


def _place(text: str, found: re.Match[str]) -> str:
    return f"at line {text.count(chr(10), 0, found.start()) + 1}"
