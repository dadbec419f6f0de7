"""Text and numbers of files: what commas mean, what is a number, and what is no text."""

from time import perf_counter

import pytest

from thbcad.texts import LATIN, OtherKind, columns_by_blanks, number, text_of


@pytest.mark.parametrize(
    ("text", "rows"),
    [
        ("1 2 3", [[1, 2, 3]]),
        ("1,2,3", [[1, 2, 3]]),
        ("1, 2, 3", [[1, 2, 3]]),
        ("1.5,2.5,3", [[1.5, 2.5, 3]]),
        ("1,5 2,5 3", [[1.5, 2.5, 3]]),
        ("1,5;2,5;0,3", [[1.5, 2.5, 0.3]]),
        ("1,5\t2,5\t-,3", [[1.5, 2.5, -0.3]]),
        ("12,500 3,250 1,125", [[12.5, 3.25, 1.125]]),
        ("1 2 3\n1,5 2 3", [[1, 2, 3], [1.5, 2, 3]]),
        ("1,5e-3\t2,5D+1\t3d0", [[1.5e-3, 25, 3]]),
        ("1,2,3,4,5,6.5", [[1, 2, 3, 4, 5, 6.5]]),
    ],
)
def test_commas_mean_what_the_other_marks_leave_them(text, rows):
    plain = columns_by_blanks(text, 3)
    assert [[number(word) for word in row.split()] for row in plain.split("\n")] == rows


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("-9,1,-8,4,0,130", "-9,1,-8,4,0,130"),  # one separator for both
        ("1,2,3\n1,2,3,5", "1,2,3"),
        ("12,3 4", "12,3 4"),  # x,y z, or two numbers
        ("1.234,5;2;3", "1.234,5;2;3"),
        ("1,234.5 2 3", "1,234.5 2 3"),
        ("1.5 2,5 3", "2,5"),
        ("1,2,3\n1,5 2 3", "1,5 2 3"),
    ],
)
def test_commas_that_may_mean_two_things_are_refused_by_name(text, shown):
    with pytest.raises(ValueError, match=r"it has commas .* write decimal points") as caught:
        columns_by_blanks(text, 3)
    assert repr(shown) in str(caught.value)


def test_commas_in_names_of_columns_and_remarks_say_nothing():
    assert columns_by_blanks("x, y, z\n1.5 2 3 first, second", 3).split("\n")[1].split()[:3] == [
        "1.5",
        "2",
        "3",
    ]


@pytest.mark.parametrize(
    "word", ["", ".", "1_0", "\u0661", "\uff11", "0x1", "1e", "e5", "nan", "inf", "1,5", "--1"]
)
def test_what_is_no_number_of_ascii_digits_is_refused(word):
    with pytest.raises(ValueError, match="is no number"):
        number(word)


@pytest.mark.parametrize(
    ("start", "kind"),
    [
        (b"\x89PNG\r\n\x1a\n\0", "a PNG picture"),
        (b"\xff\xd8\xff\xe0\0", "a JPEG picture"),
        (b"GIF89a\0", "a GIF picture"),
        (b"PK\3\4\0", "a ZIP archive"),
        (b"\x1f\x8b\x08\0", "a gzip archive"),
        (b"%PDF-1.4\n", "a PDF"),
    ],
)
@pytest.mark.parametrize("older", [None, LATIN])
def test_other_kinds_of_files_are_named(start, kind, older):
    with pytest.raises(OtherKind, match=kind):
        text_of(start + bytes(range(128)), older)


def test_bytes_that_are_no_text_are_refused_and_an_end_byte_within_is_kept():
    with pytest.raises(ValueError, match="it is no text: line 2 holds a byte that is 0"):
        text_of(b"a text\nand a\0zero")
    assert text_of(b"one\x1atwo\r\n\x1a") == "one\x1atwo\n"
    assert text_of("\u2026".encode("cp1252") + b"\n1", LATIN).split("\n") == ["\x85", "1"]  # NEL ends no line


@pytest.mark.parametrize(
    "head", ["05.01.2024, 14:33 Uhr", "225 points, mm", "3D scan of lens, mm", "2 lenses, 1,5 mm thick"]
)
@pytest.mark.parametrize("row", ["1.5 2.5 3", "1,5;2,5;3", "1.5,2.5,3", "1,5\t2,5\t3"])
def test_commas_in_a_head_that_begins_with_a_digit_say_nothing(head, row):
    assert columns_by_blanks(f"{head}\n{row}\n", 3).split("\n")[1].split() == ["1.5", "2.5", "3"]


@pytest.mark.parametrize("start", ["BMW Leuchten M\u00fcnchen", "RIFF GmbH M\u00fcnchen"])
def test_latin_text_that_begins_like_a_picture_is_text(start):
    assert text_of(start.encode(LATIN), LATIN) == start


@pytest.mark.parametrize(
    ("start", "kind"),
    [(b"BM\x36\0\x0c\0\0\0\0\0\x36\0\0\0", "a BMP picture"), (b"RIFF\x24\0\0\0WEBPVP8 ", "a WebP picture")],
)
def test_pictures_with_short_marks_are_named(start, kind):
    with pytest.raises(OtherKind, match=kind):
        text_of(start + b"\xff" * 64, LATIN)


def test_long_words_and_long_endings_take_linear_time():
    begun = perf_counter()
    with pytest.raises(ValueError, match="is no number"):
        number("1" * 200_000 + "x")
    assert text_of(b"\x1a" * 200_000 + b"x") == "\x1a" * 200_000 + "x"
    assert text_of(b"1" + b"\x1a" * 200_000) == "1"
    assert perf_counter() - begun < 2  # quadratic: an hour
