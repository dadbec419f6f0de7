"""A hierarchical mesh beside the uniform one of its finest level, for a target whose detail is local."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from optics.interface.api import Design, design
from optics.scene.problem import load_problem

EQUAL = 1.05  # errors within 5 % count as equal


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
    """Design a problem twice, refined by its own indicator and uniformly, and compare both."""
    problem = load_problem(path)
    refined, plain = design(problem), design(problem.with_(**{"refinement.alpha": [0.0]}))
    return MeshComparison(
        refined.metrics["dof"], uniform_functions(plain), refined.metrics["rel_l2"], plain.metrics["rel_l2"]
    )


def uniform_functions(made: Design) -> int:
    """Return how many functions the uniform mesh of a design's finest level has, with those without light."""
    (sag,) = made.lens.sags
    spans = [(len(kv.breaks) - 1) << (sag.space.levels - 1) for kv in (sag.space.kv_u, sag.space.kv_v)]
    return (spans[0] + sag.space.kv_u.degree) * (spans[1] + sag.space.kv_v.degree)
