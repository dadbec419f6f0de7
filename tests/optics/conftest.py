"""Fixtures shared by the optics tests."""

from functools import partial

import pytest

from optics.base.runtime import load_backend
from tests.optics.cases import write_problem


@pytest.fixture(scope="session")
def backend():
    """Dr.Jit in double precision on one thread: the tests themselves run side by side."""
    return load_backend("double", 1)


@pytest.fixture
def problem_file(tmp_path):
    """A function that writes the small problem into the test's folder and returns its path."""
    return partial(write_problem, tmp_path)


@pytest.fixture
def coarse_concentration(monkeypatch):
    """The greatest concentration of light from few cells: it takes most of the time of `check`."""
    monkeypatch.setattr("optics.light.outgoing.concentration.CELLS", 64)
