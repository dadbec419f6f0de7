"""Which problem it is: by its values and by the bytes of its files."""

import tracemalloc
from dataclasses import replace

from optics.exchange.results.identity import _set_keys, differing_keys, fingerprint, run_id
from optics.scene.problem import load_problem
from optics.scene.system import System
from tests.optics.cases import small_problem

SIZE = 1 << 24  # bytes, as of a small ray file


def test_a_file_counts_by_its_bytes_and_is_never_held_whole(problem_file, tmp_path):
    problem, other = load_problem(problem_file()), tmp_path / "other.png"
    changed = replace(problem, target=replace(problem.target, image=str(other)))
    other.write_bytes(bytes(SIZE))
    tracemalloc.start()
    first = fingerprint(changed)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < SIZE / 8
    other.write_bytes(bytes(SIZE - 1) + b"1")
    assert len({first, fingerprint(changed), fingerprint(problem)}) == 3


def test_keys_that_came_later_leave_the_run_id_as_it_was(problem_file):
    """The hash is that of the version before `source.unit`, whose precision was double by default."""
    problem = load_problem(problem_file()).with_(**{"verify.rays": 33, "run.precision": "double"})
    lens = System(problem).base
    assert run_id(problem, lens) == "1ca1a9730572330eb49721c6fad71e922a5425bceb900ba9ab7b2d9a9c657a64"
    assert run_id(problem.with_(**{"source.unit": "W"}), lens) == run_id(problem, lens)
    assert run_id(problem.with_(**{"source.unit": "lm"}), lens) != run_id(problem, lens)


def test_a_problem_written_twice_differs_in_nothing(problem_file, tmp_path):
    problem, again = load_problem(problem_file()), small_problem(tmp_path, {"run.threads": 3})
    assert list(differing_keys(problem, again)) == []


def test_keys_of_materials_at_their_defaults_change_no_run_id(tmp_path):
    """Nor does a material that is a label: the lens keeps its index."""
    problem = small_problem(tmp_path)
    lens = System(problem).base
    keys = ("lens.indices", "lens.absorptions", "source.spectrum")
    named = problem.with_(**dict.fromkeys(keys, ()), **{"lens.absorption": 0})
    assert run_id(named, System(named).base) == run_id(problem, lens)
    text = _set_keys(problem)
    assert not any(key in text for key in (*keys, "lens.absorption"))
