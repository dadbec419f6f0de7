"""Rows of numbers in text: missing values keep their column, and damaged rows are refused."""

import numpy as np
import pytest

from optics.base.runtime import UserError
from optics.tolerancing.metrology.measured_text import number_rows

NAN = np.nan


@pytest.mark.parametrize(
    ("text", "last"),
    [
        ("1.5,2.5,3.5,0.0\n,2.0,3.5,0.1", [NAN, 2.0, 3.5]),
        ("1\t2\t3\n1\t2\t3\n\t2\t3", [NAN, 2, 3]),
        ("1,5;2,5;3,5\n;2,5;3", [NAN, 2.5, 3]),
        ("1,5;2,5;3,5\n1;;3", [1, NAN, 3]),
        ("1,5;2,5;3,5\n,5;,25;2", [0.5, 0.25, 2]),  # decimal commas without a zero
        ("1,5 2,5 3,5\n,5 2,5 3", [0.5, 2.5, 3]),
        ("1 2 3\n1 2 None", [1, 2, NAN]),
        ("1 2 3\n1 2 NULL", [1, 2, NAN]),
        ("1 2 3\n1 - 3", [1, NAN, 3]),
        ("1.5,2,3\n1.5,-,2", [1.5, NAN, 2]),
        ('"x","y","z"\n"1.5","2.5","3.5"\n"1.5","","-3.5"', [1.5, NAN, -3.5]),
        ("; x; y; z\n1 2 3", [1, 2, 3]),
        ("05.01.2024, 14:33 Uhr\n1 2 3", [1, 2, 3]),
    ],
)
def test_missing_values_keep_their_column(text, last):
    np.testing.assert_array_equal(number_rows(text, "n")[-1], last)


@pytest.mark.parametrize("row", ["1.0 2.0 3.0.0", "1 2 3x", "1.5 0 2..5"])
def test_a_damaged_first_row_is_no_head(row):
    with pytest.raises(UserError, match=r"line 2 of n holds '1.* it is a remark"):
        number_rows(f"x y z\n{row}\n1 2 3\n", "n")
