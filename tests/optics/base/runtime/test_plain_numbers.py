"""Numbers as people read them."""

import pytest

from optics.base.runtime import plain_number


@pytest.mark.parametrize(
    ("value", "text"),
    [(1234.5, "1200"), (-734.0, "-730"), (99.6, "100"), (0.01234, "0.012"), (2e12, "2e+12"), (3e-9, "3e-09")],
)
def test_only_huge_and_tiny_numbers_have_a_power_of_ten(value, text):
    assert plain_number(value, 2) == text
