"""Which problem it is: by its values and by the bytes of its files."""

import tracemalloc
from dataclasses import replace

from optics.exchange.results.identity import fingerprint
from optics.scene.problem import load_problem

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
