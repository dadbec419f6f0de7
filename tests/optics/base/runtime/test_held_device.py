"""The device: one thread works on it at a time, and BLAS takes one thread meanwhile."""

import sys
from threading import Thread

import numpy as np
import pytest
import scipy.linalg  # noqa: F401  it has a BLAS of its own
from threadpoolctl import ThreadpoolController

import optics
from optics.base.runtime import device, held_device


def blas_threads():
    return [library["num_threads"] for library in ThreadpoolController().select(user_api="blas").info()]


@pytest.fixture
def several():
    with ThreadpoolController().limit(limits=2, user_api="blas"):
        yield


def test_blas_takes_one_thread_and_has_its_own_again_behind_it(several):
    assert 2 in blas_threads()
    with device(), device():
        assert set(blas_threads()) == {1}
    assert 2 in blas_threads()
    with pytest.raises(KeyboardInterrupt), device():
        raise KeyboardInterrupt
    assert 2 in blas_threads()


def test_a_second_thread_waits():
    order = []

    def work():
        with device():
            order.append("second")

    with device():
        other = Thread(target=work)
        other.start()
        other.join(0.05)
        order.append("first")
    other.join()
    assert order == ["first", "second"]


def test_a_search_needs_no_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "threadpoolctl", None)
    held_device._blas.cache_clear()
    found = optics.minimise(lambda c: (c @ c, 2 * c), np.array([3.0, 4.0]))
    held_device._blas.cache_clear()
    assert found.loss < 1e-12
