"""The crescent of an audit is the one whose stored row supports the claim."""

from benchmarks.designs import refinement
from optics.interface.audit import experiments_in
from optics.scene.problem import load_problem


def test_the_crescent_is_that_of_the_bench_of_refinement(tmp_path):
    with experiments_in(tmp_path) as experiments:
        problem = load_problem(experiments.folder / "crescent.toml")
    (wanted,) = (case for name, case in refinement.cases(tmp_path) if name == "crescent")
    assert problem.target == wanted.target
    assert problem.source == wanted.source
    assert problem.optimizer == wanted.optimizer
    assert (problem.refinement.indicator, problem.lens.rear.freeform.max_level) == ("vertex", 5)
