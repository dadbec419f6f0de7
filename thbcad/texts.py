"""Text of files that a user names, and the numbers in it: the one way in which all readers read.

Text is UTF-8 with or without a byte order mark, UTF-16, or the older encoding that a format allows.  Its
lines end with LF, CR LF or CR, and the end byte of DOS (0x1A) after the last one is no part of it.  A number
is written with ASCII digits; its exponent begins with e, E or, as Fortran writes it, with d or D.
"""

import re
from collections.abc import Sequence
from itertools import islice
from string import whitespace

LATIN = "latin-1"  # the older encoding of formats that are older than UTF-8
LINE_END = re.compile(r"\r+\n?")  # CR CR LF is one end: a CR LF that was converted once more
DOS_END, PADDING = "\x1a", "\0" + whitespace
NUMBER = re.compile(r"[-+]?(?:[0-9]++(?:\.[0-9]*+)?|\.[0-9]++)(?:[eEdD][-+]?[0-9]++)?")
FORTRAN = str.maketrans("dD", "ee")
FORTRAN_EXPONENT = re.compile(r"(?<=[0-9.])[dD](?=[-+]?[0-9])")
# the first bytes of files that are no text
KINDS = {
    b"\x89PNG": "a PNG picture",
    b"\xff\xd8\xff": "a JPEG picture",
    b"GIF8": "a GIF picture",
    b"BM": "a BMP picture",
    b"II*\0": "a TIFF picture",
    b"MM\0*": "a TIFF picture",
    b"RIFF": "a WebP picture",
    b"PK\3\4": "a ZIP archive",
    b"\x1f\x8b": "a gzip archive",
    b"%PDF": "a PDF",
}
BLANKS = re.compile(r"[;\s]+")
OTHERS = re.compile(r"[,;\s]+")
# a number with one decimal mark at most: a comma stands before a digit
ONE_MARK = re.compile(
    r"[-+]?(?:[0-9]+(?:\.[0-9]*|,[0-9]+)?|[.,][0-9]+)(?:[ed][-+]?[0-9]+)?|[-+]?nan|[-+]?inf", re.IGNORECASE
)
ROW_WITH_COMMA = re.compile(r"^[ \t]*[-+]?[.,]?[0-9][^\n,]*,[^\n]*$", re.MULTILINE)
JUDGED = 1000  # rows with commas, from which what commas mean is known
ROW_START = re.compile(r"[ \t]*(?:[-+.,*]*[0-9*]|[-+]?(?:nan|inf|null|none)\b)", re.IGNORECASE)
# places where a value is missing, by the mark between columns; a comma that begins a line of numbers apart by
# blanks marks a decimal
EMPTY = {
    "\t": re.compile(r"^(?= *\t)|(?<=\t)(?= *(?:\t|$))", re.MULTILINE),
    ";": re.compile(r"^(?=[^\S\n]*;)|(?<=;)(?=[^\S\n]*(?:;|$))", re.MULTILINE),
    ",": re.compile(
        r"^(?=[^\S\n]*,(?![^\n]*[\w.][^\S\n]+(?:[-+.\w]|,\d)))|(?<=,)(?=[^\S\n]*(?:,|$))", re.MULTILINE
    ),
}
LIKE_A_NUMBER = re.compile(r"[-+]?(?:[.,]?[0-9]|(?:nan|inf)\b)", re.IGNORECASE)


class OtherKind(ValueError):
    """Bytes of a known kind that is no text.  kind : what they are, such as "a PNG picture"."""

    def __init__(self, kind: str) -> None:
        super().__init__(f"it is {kind}, not a text")
        self.kind = kind


def text_of(data: bytes, older: str | None = None) -> str:
    """Return the text of a file's bytes; its lines end with LF.

    older : the encoding of what is not UTF-8, such as LATIN; None where the format allows none.

    Raises OtherKind : a picture, an archive or a PDF.
    Raises ValueError : bytes that are no text in these encodings.
    """
    encoding = _encoding(data)
    try:
        text = data.decode(encoding)
    except UnicodeDecodeError as error:
        _refuse_other_kinds(data)
        if older is None or encoding != "utf-8-sig":
            line = data.count(b"\n", 0, error.start) + 1
            wanted = "UTF-8" if encoding == "utf-8-sig" else "UTF-16"
            raise ValueError(
                f"it is not {wanted} text: line {line} holds the byte 0x{data[error.start]:02x}; "
                "save it as UTF-8"
            ) from None
        text = data.decode(older)
    text = _without_dos_end(LINE_END.sub("\n", text))
    if "\0" in text:
        _refuse_other_kinds(data)
        line = text.count("\n", 0, text.index("\0")) + 1
        raise ValueError(f"it is no text: line {line} holds a byte that is 0")
    if data.startswith(b"%PDF"):
        _refuse_other_kinds(data)
    return text


def number(word: str) -> float:
    """Return the number that a word is.

    Raises ValueError : it is none; digits of other scripts and `1_000` are none.
    """
    if not NUMBER.fullmatch(word):
        raise ValueError(f"{word[:20]!r} is no number")
    return float(word.translate(FORTRAN))


def columns_by_blanks(text: str, columns: int) -> str:
    """Return a text whose rows of numbers have decimal points, and blanks between the numbers.

    Commas mark decimals where tabs, semicolons or blanks part the columns and every comma stands between
    digits; else they part the columns.  columns : numbers that a row has at least.

    Raises ValueError : commas that may mean both; it names one.
    """
    lines = (found[0].strip() for found in ROW_WITH_COMMA.finditer(text))
    rows = list(islice((line for line in lines if _begins_with_numbers(line, columns)), JUDGED))
    decimal = bool(rows) and _marks_decimals(rows, columns)
    text = text.replace(",", "." if decimal else " ").replace(";", " ").replace("\t", " ")
    return FORTRAN_EXPONENT.sub("e", text)


def column_mark(text: str) -> str:
    """Return the mark that separates the columns of most rows: a tab, a semicolon, or else a comma."""
    by_tabs = [line.strip(" ") for line in text.split("\n") if "\t" in line]
    if 2 * sum("\t\t" not in line and line == line.strip() for line in by_tabs) > len(by_tabs):
        return "\t"
    rows = [line for line in text.split("\n") if ROW_START.match(line)]
    return ";" if 2 * sum(";" in row for row in rows) > len(rows) else ","


def is_damaged_row(words: Sequence[str]) -> bool:
    """Return whether words seem to be a damaged row of numbers, rather than part of a head.

    They are more than two, all begin like a number, and most of them are numbers.
    """
    return (
        len(words) > 2
        and all(map(LIKE_A_NUMBER.match, words))
        and 2 * sum(bool(NUMBER.fullmatch(word)) for word in words) > len(words)
    )


def _begins_with_numbers(line: str, columns: int) -> bool:
    """Return whether a line is a row of numbers, whatever its commas mean, rather than part of a head."""
    words = [word for word in OTHERS.split(line, columns + 1) if word][:columns]
    return len(words) == columns and all(word in ("-", "+") or ONE_MARK.fullmatch(word) for word in words)


def _marks_decimals(rows: Sequence[str], columns: int) -> bool:
    """Return whether the commas of rows, each of which has some, mark decimals rather than part columns.

    Raises ValueError : they may do both.
    """
    decimal, separating = [], []
    for row in rows:
        words = BLANKS.split(row)[:columns]
        if len(words) < columns or not all(map(ONE_MARK.fullmatch, words)):
            separating.append(row)
            marks = re.findall(r"[,;\s]+", row)[: columns - 1]
            if len({"," in mark for mark in marks}) > 1:
                raise ValueError(_ambiguous(row, "between some columns, and other marks between others"))
        elif marked := [word for word in words if "," in word]:
            decimal.append(row)
            if any("." in word for word in words):
                raise ValueError(_ambiguous(marked[0], "as well as decimal points"))
    if decimal and separating:
        raise ValueError(_ambiguous(decimal[0], "within some numbers, and between others"))
    counts = {len(OTHERS.split(row)) for row in separating}
    whole = not any("." in row for row in separating)
    if separating and whole and (len(counts) > 1 or counts.pop() >= 2 * columns):
        raise ValueError(_ambiguous(separating[0], "that may be decimal commas, or part the columns"))
    return bool(decimal)


def _ambiguous(shown: str, what: str) -> str:
    return (
        f"it has commas {what}, such as {shown[:30]!r}; write decimal points, or separate the columns with "
        "tabs"
    )


def _without_dos_end(text: str) -> str:
    """Return a text up to the first of the end bytes of DOS after which only padding follows."""
    content = text.rstrip(DOS_END + PADDING)
    end = text.find(DOS_END, len(content))
    return text if end < 0 else text[:end]


def _encoding(data: bytes) -> str:
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return "utf-16"
    start = data[:64]
    if len(start) > 1 and b"\0" in start:  # UTF-16 without a mark: every other byte of Latin letters is 0
        if not any(start[1::2]):
            return "utf-16-le"
        if not any(start[::2]):
            return "utf-16-be"
    return "utf-8-sig"


def _refuse_other_kinds(data: bytes) -> None:
    for magic, kind in KINDS.items():
        if data.startswith(magic) and not _is_a_word(data):
            raise OtherKind(kind)


def _is_a_word(data: bytes) -> bool:
    """Return whether the first letters of a picture, BM or RIFF, begin a text instead."""
    if data.startswith(b"BM"):
        return b"\0" not in data[2:14]  # the header of a bitmap holds 4 bytes that are 0
    return data.startswith(b"RIFF") and data[8:12] != b"WEBP"
