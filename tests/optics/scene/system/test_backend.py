"""The backend of a system: of double precision, on the threads that its problem asks for."""

import pickle

import numpy as np
import pytest

from tests.optics.cases import on_threads, small_system


def system_on(threads, folder):
    return small_system(folder, {"run.threads": threads})


@pytest.mark.parametrize("precision", ["double", "single"])
def test_it_is_of_double_precision(tmp_path, precision):
    """The problem's precision is that of the design alone."""
    system = small_system(tmp_path, {"run.precision": precision})
    assert system.backend.dtype is np.float64


def test_threads_are_those_of_the_problem_whatever_came_between(tmp_path, backend):
    one, two = (system_on(threads, tmp_path) for threads in (1, 2))

    def asked():
        return [system.backend.dr.thread_count() for system in (one, two, two.sharp, one)]

    assert on_threads(4, asked) == [1, 2, 2, 1]


def test_a_system_that_traced_is_pickled(tmp_path):
    """Nothing of Dr.Jit goes along."""
    system = system_on(1, tmp_path)
    assert system.backend.dr.thread_count() == 1
    assert pickle.loads(pickle.dumps(system)).backend == system.backend
