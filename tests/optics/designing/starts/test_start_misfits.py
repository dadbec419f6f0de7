"""When a transport start is poor."""

import pytest

from optics.designing.starts import StartQuality


@pytest.mark.parametrize(
    ("start", "base", "useless", "poor"),
    [(0.1, 0.9, False, False), (0.29, 0.5, False, False), (0.4, 0.9, False, True), (0.95, 0.9, True, True)],
)
def test_a_start_is_poor_from_a_third_of_the_base_on(start, base, useless, poor):
    found = StartQuality(start, base)
    assert (found.useless, found.poor) == (useless, poor)
