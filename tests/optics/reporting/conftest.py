"""Fixtures shared by the tests of pictures."""

import pytest

from tests.optics.cases import small_system


@pytest.fixture
def made(tmp_path):
    """A function from changes of the small problem to their system."""

    def make(changes):
        return small_system(tmp_path, changes)

    return make
