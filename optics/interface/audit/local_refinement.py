"""A hierarchical mesh beside the uniform one of its finest level, for a target whose detail is local."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from optics.interface.api import Design, design
from optics.scene.problem import load_problem

EQUAL = 1.05  # errors within 5 % count as equal
ALPHA = "refinement.alpha"  # the key; 0 refines everywhere
ALPHAS = (1.0, 0.5)  # from the coarsest mesh on


class MeshComparison(NamedTuple):
    """Functions and errors (rel_l2) of a refined and a uniform mesh with the same finest level.

    uniform : functions of the tensor-product space of that level.
    """

    refined: int
    uniform: int
    error: float
    uniform_error: float

    @property
    def share(self) -> float:
        """Functions of the refined mesh / functions of the uniform one."""
        return self.refined / self.uniform

    @property
    def as_good(self) -> bool:
        """Whether the error of the refined mesh is at most EQUAL times that of the uniform one."""
        return self.error <= EQUAL * self.uniform_error


def compare_meshes(path: Path) -> MeshComparison:
    """Design a problem on a uniform mesh and on refined ones, and compare the coarsest one that is as good.

    Rounding changes the errors of such designs by several per cent, so a finer mesh is tried where the first
    one is not as good.
    """
    problem = load_problem(path)
    uniform = design(problem.with_(**{ALPHA: [0.0]}))
    count, error = uniform_functions(uniform), uniform.metrics["rel_l2"]
    for alpha in ALPHAS:
        refined = design(problem.with_(**{ALPHA: [alpha]})).metrics
        found = MeshComparison(refined["dof"], count, refined["rel_l2"], error)
        if found.as_good:
            break
    return found


def uniform_functions(made: Design) -> int:
    """Return how many functions the uniform mesh of a design's finest level has, with those without light."""
    (sag,) = made.lens.sags
    spans = [(len(kv.breaks) - 1) << (sag.space.levels - 1) for kv in (sag.space.kv_u, sag.space.kv_v)]
    return (spans[0] + sag.space.kv_u.degree) * (spans[1] + sag.space.kv_v.degree)
