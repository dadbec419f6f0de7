"""Checkpoints and records of any numbers: all bits come back, and what was cut is refused."""

import json

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st
from hypothesis.extra.numpy import arrays

from optics.base.runtime import UserError
from optics.designing.optimisation import Row, State
from optics.exchange.results import ResultFolder, read_checkpoint, write_checkpoint
from optics.scene.problem import load_problem
from optics.scene.system import System
from tests.cases import examples
from tests.optics.cases import small_space, store_result, write_problem
from thbcad.surfaces import THBSurface

FINITE = st.floats(allow_nan=False, allow_infinity=False)
COUNTS = st.integers(0, 10**6)
ROWS = st.builds(Row, COUNTS, COUNTS, COUNTS, FINITE, FINITE, FINITE, COUNTS, st.none() | FINITE)
SPACE = small_space()
SHARED = settings(suppress_health_check=[HealthCheck.function_scoped_fixture])


@pytest.fixture(scope="module")
def problem(tmp_path_factory):
    return load_problem(write_problem(tmp_path_factory.mktemp("problem")))


@SHARED
@given(
    coefficients=arrays(np.float64, SPACE.dim, elements=FINITE),
    history=st.lists(ROWS, max_size=4),
    notes=st.lists(st.text(max_size=20), max_size=3),
)
def test_any_state_comes_back_from_a_checkpoint(problem, tmp_path, coefficients, history, notes):
    path = tmp_path / "checkpoint.json"
    state = State(False, 0, (THBSurface(SPACE, coefficients),), tuple(history))
    write_checkpoint(path, problem, problem, state, notes)
    found, said = read_checkpoint(path, System(problem))
    assert found.sags[0].coefficients.tobytes() == coefficients.tobytes()
    assert (found.history, said) == (state.history, notes)


@SHARED
@given(share=st.floats(0, 0.999))
def test_a_checkpoint_that_was_cut_is_refused(problem, tmp_path, share):
    path = tmp_path / "checkpoint.json"
    write_checkpoint(path, problem, problem, State(False, 0, (THBSurface(SPACE, np.zeros(SPACE.dim)),)))
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    with pytest.raises(UserError, match="cannot resume"):
        read_checkpoint(path, System(problem))


@pytest.fixture(scope="module")
def result(problem, tmp_path_factory):
    return store_result(tmp_path_factory.mktemp("result") / "out", problem, System(problem).base)


@examples(20)
@given(share=st.floats(0, 0.999))
def test_a_record_that_was_cut_is_refused(result, share):
    path = result.path / "result.json"
    data = path.read_bytes()
    try:
        path.write_bytes(data[: int(share * (len(data) - 2))])  # the last two bytes are } and a line's end
        with pytest.raises(UserError):
            ResultFolder(result.path).read()
    finally:
        path.write_bytes(data)


@examples(20)
@given(run_id=st.text(max_size=64))
def test_a_record_of_another_run_is_refused(result, run_id):
    path = result.path / "result.json"
    data = path.read_bytes()
    try:
        path.write_text(json.dumps(json.loads(data) | {"run_id": run_id}))
        with pytest.raises(UserError):
            ResultFolder(result.path).read()
    finally:
        path.write_bytes(data)
