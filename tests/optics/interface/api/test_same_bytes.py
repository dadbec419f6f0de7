"""Designs: the same bytes on any number of threads, and again."""

import pytest

import optics
from tests.cases import ROOT
from tests.optics.cases import THREADS, on_threads, write_problem
from thbcad import write_lens

GLOWING = {
    "source.kind": "lambertian",
    "source.half_width": [0.5, 0.5],
    "source.half_angle": 30.0,
}
POINT = {"source.kind": "point", "source.half_angle": 40.0, "source.distance": 8.0}
FEW = {"target.pixels": [64, 64], "lens.rear.freeform.max_level": 2, "optimizer.iterations": [5]}
FEWER = {
    "target.pixels": [32, 32],
    "lens.rear.freeform.max_level": 1,
    "optimizer.iterations": [3],
    "optimizer.finish": 2,
    "optimizer.rays_per_pixel": 6.0,
}
EXAMPLES = {
    "pearl": FEW,
    "point": FEW,
    "extended": FEWER,
    "extended_two": FEWER | {"lens.front.freeform.max_level": 1},
}


def designed(problem, threads, folder):
    """Return the bytes of the file of the lens that a problem is solved by."""
    design = on_threads(threads, optics.design, problem.with_(**{"run.threads": threads}))
    write_lens(design.lens, folder / "lens.json")
    return (folder / "lens.json").read_bytes()


@pytest.mark.every(2)
@pytest.mark.parametrize(
    "changes",
    [{}, GLOWING, pytest.param(POINT, marks=pytest.mark.slow)],
    ids=["parallel", "extended", "point"],
)
def test_a_small_design_has_the_same_bytes_on_one_and_two_threads(tmp_path, changes):
    """Of 32^2 pixels, with enough rays for several threads."""
    few = {"target.pixels": [32, 32], "lens.rear.freeform.max_level": 1, "optimizer.iterations": [3]}
    problem = optics.load_problem(write_problem(tmp_path, few | {"optimizer.rays_per_pixel": 8.0} | changes))
    assert len({designed(problem, threads, tmp_path) for threads in (1, 2)}) == 1


@pytest.mark.slow
@pytest.mark.parametrize("name", EXAMPLES)
def test_examples_have_the_same_bytes_on_any_number_of_threads_and_again(tmp_path, name):
    """With fewer pixels and levels."""
    problem = optics.load_problem(ROOT / "examples" / f"{name}.toml").with_(**EXAMPLES[name])
    assert len({designed(problem, threads, tmp_path) for threads in (*THREADS, 2)}) == 1
