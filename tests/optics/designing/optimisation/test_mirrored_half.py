"""One half of the light does where problem, lens and mesh are their own mirror images."""

import numpy as np
import pytest

from optics.designing.optimisation import stage_objective, stages
from optics.light.engines import ExactEngine
from optics.light.measuring import Mirrors, mirror_axes
from tests.optics.cases import small_system

GLOWING = {"source.kind": "lambertian", "source.half_width": [0.5, 0.4], "source.distance": 2.0}
CASES = {
    "glowing area": GLOWING | {"optimizer.window": "bspline", "optimizer.start": "flat"},
    "parallel beam": {},
    "point": {
        "source.kind": "point",
        "source.half_width": [0, 0],
        "source.distance": 40.0,
        "source.half_angle": 12.0,
    },
}


def evaluations(folder, backend, changes, axes=None):
    """Return (axes, Evaluations with one half and with all light, gradients averaged) at a symmetric lens."""
    system = small_system(folder, changes | {"target.kind": "tophat"})
    stage = stages(system, False)[-1]
    sags = [sag.refine({0: sag.space.cells[:, 1:]}) for sag in system.base.sags]
    lens = system.base.with_sags(sags)
    found = mirror_axes(system.target.irradiance(system.target.screen(), 1.0), system.source.profile)
    chosen = found if axes is None else axes
    mirrors, rng = [Mirrors(sag.space, found) for sag in sags], np.random.default_rng(3)
    c = [m.of_coefficients(0.01 * rng.normal(size=s.space.dim)) for m, s in zip(mirrors, sags)]
    target = system.target.irradiance(stage.screen, 0.9)
    both = [
        stage_objective(system.with_lens(lens), stage, target, ExactEngine(backend), a)(c)
        for a in (chosen, ())
    ]
    averaged = [[m.of_coefficients(g) for m, g in zip(mirrors, e.gradients)] for e in both]
    return chosen, both, averaged


@pytest.mark.parametrize("axes", [(0,), (1,), (0, 1)], ids=str)
def test_half_of_the_rays_gives_the_same_loss_and_gradient(tmp_path, backend, axes):
    _, (half, whole), (gradients, others) = evaluations(tmp_path, backend, CASES["glowing area"], axes)
    assert half.loss == pytest.approx(whole.loss, rel=1e-12)
    assert half.fit == pytest.approx(whole.fit, rel=1e-12)
    for gradient, other in zip(gradients, others):
        assert np.linalg.norm(gradient - other) < 1e-12 * np.linalg.norm(other)


@pytest.mark.parametrize(("name", "away"), [("parallel beam", 0.02), ("point", 1e-12)])
def test_half_of_the_cells_gives_the_same_loss_but_for_their_diagonals(tmp_path, backend, name, away):
    """A mirrored cell of a beam is cut along the other diagonal, which changes its light in the second order;
    those of a cone are cut along mirrored ones."""
    axes, (half, whole), _ = evaluations(tmp_path, backend, CASES[name])
    assert tuple(axes) == (0, 1)
    assert half.loss == pytest.approx(whole.loss, rel=away)
    if name == "parallel beam":
        assert half.loss != pytest.approx(whole.loss, rel=1e-9)
    assert any((g != h).any() for g, h in zip(half.gradients, whole.gradients))  # one half was traced
