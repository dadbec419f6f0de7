"""A refined mesh beside the uniform one of its finest level."""

from types import SimpleNamespace

import pytest

from optics.interface.audit.local_refinement import EQUAL, compare_meshes, uniform_functions
from tests.cases import EXAMPLES
from thbcad import KnotVector, THBSpace, THBSurface

MODULE = "optics.interface.audit.local_refinement"
PATH = EXAMPLES / "tophat_square.toml"


def test_functions_of_a_uniform_mesh_are_those_of_its_tensor_product():
    coarse = THBSpace(KnotVector.uniform(3, 7), KnotVector.uniform(3, 5))
    sag = THBSurface(coarse, [0.0] * coarse.dim).refine({0: [(0, 0)]}).refine({1: [(0, 0)]})
    assert sag.space.levels == 3
    made = SimpleNamespace(lens=SimpleNamespace(sags=(sag,)))
    assert uniform_functions(made) == (7 * 4 + 3) * (5 * 4 + 3) == coarse.uniform(2).dim


@pytest.fixture
def errors(monkeypatch):
    """Errors by alpha, which a test gives; the finer mesh has 200 functions, the coarser one 100."""
    given = {}

    def design(problem):
        (alpha,) = problem.refinement.alpha
        return SimpleNamespace(metrics={"dof": {1.0: 100, 0.5: 200}.get(alpha), "rel_l2": given[alpha]})

    monkeypatch.setattr(f"{MODULE}.design", design)
    monkeypatch.setattr(f"{MODULE}.uniform_functions", lambda _: 1000)
    return given


@pytest.mark.parametrize(
    ("coarse", "fine", "share", "as_good"),
    [(0.02 * EQUAL, None, 0.1, True), (0.022, 0.019, 0.2, True), (0.022, 0.022, 0.2, False)],
)
def test_the_coarsest_mesh_that_is_as_good_counts(coarse, fine, share, as_good, errors):
    errors |= {0.0: 0.02, 1.0: coarse, 0.5: fine}
    found = compare_meshes(PATH)
    assert (found.share, found.as_good) == (share, as_good)
