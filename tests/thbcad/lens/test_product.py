"""Names and material of a product: what is kept and what is refused."""

import re

import pytest
from hypothesis import given, strategies as st

from thbcad.lens.product import Product


def test_the_default_names_the_solid_only():
    assert Product() == Product("lens", "", "", "", 0.0, None)


def test_numbers_become_floats():
    product = Product(material="PMMA", density=1, index=2)
    assert [type(product.density), type(product.index)] == [float, float]


@pytest.mark.parametrize("text", ["Ü ß é", "O'Brien", "a\\b", "透镜", "😀", "#1=2.5;", "x" * 500])
@pytest.mark.parametrize("key", ["name", "author", "organization", "material"])
def test_one_line_of_any_script_is_kept(key, text):
    assert getattr(Product(**{key: text}), key) == text


@given(st.text(st.characters(categories=["L", "N", "P", "S"]), min_size=1))
def test_letters_numbers_and_symbols_are_kept(text):
    assert Product(text).name == text


@pytest.mark.parametrize("sign", ["\n", "\r", "\t", "\0", "\x7f", "\x85", "\u2028", "\u2029", "\ud800"])
def test_control_characters_are_refused(sign):
    with pytest.raises(
        ValueError, match=re.escape(f"author must be one line without control characters, got {sign!r}")
    ):
        Product(author=f"a{sign}b")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"name": ""}, "name must not be empty"),
        ({"name": 5}, "name must be a string, got int"),
        ({"organization": None}, "organization must be a string, got NoneType"),
        ({"material": "PMMA "}, "material must not begin or end with a blank, got 'PMMA '"),
        ({"material": "PMMA", "density": -1.0}, "density must be a finite number of at least 0, got -1.0"),
        (
            {"material": "PMMA", "density": float("inf")},
            "density must be a finite number of at least 0, got inf",
        ),
        ({"material": "PMMA", "index": 0.0}, "index must be a positive finite number, got 0.0"),
        ({"material": "PMMA", "index": "1.5"}, "index must be a positive finite number, got 1.5"),
        (
            {"density": 1.2},
            r"material must be named for a density or an index, got 1.2 g/cm\^3 and index None",
        ),
        ({"index": 1.5}, r"material must be named for a density or an index, got 0 g/cm\^3 and index 1.5"),
    ],
)
def test_what_makes_no_sense_is_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        Product(**arguments)
