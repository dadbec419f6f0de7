"""Mitsuba on one thread, as the backend of the tests is."""

import pytest

from optics.exchange.mitsuba.loading import load_mitsuba


@pytest.fixture
def mi(backend):
    """Mitsuba on one thread; afterwards variant and threads are as before."""
    threads = backend.dr.thread_count()
    yield load_mitsuba(threads=1)
    load_mitsuba(threads=threads)
