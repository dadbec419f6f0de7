"""The gradient of the objective of exact pixels: the light of mapped cells, with every charge."""

from dataclasses import replace

import numpy as np
import pytest

from optics.designing.optimisation.objective import Objective
from optics.designing.penalties import Part, shape_penalty
from optics.light.engines import TracedModel
from optics.light.measuring import MappedCells
from optics.scene.problem import Limits
from optics.scene.receivers import Screen
from optics.scene.sources import Profile, beam_cells, cone_cells
from tests.optics.cases import PLANE, TARGET_Z, coefficients, rough, small_lens, small_space, tracer_to
from tests.optics.designing.optimisation.cases import (
    ANGLES,
    BOTH,
    REAR,
    SCREEN,
    SPHEROID,
    WIDE,
    asked_for,
    of_vector,
)
from thbcad.hierarchy import THBSpace
from thbcad.sags import Conic
from thbcad.splines import KnotVector
from thbcad.surfaces import THBSurface

BEAM = beam_cells((9.5, 8.0), 1.0, (10.0, 10.0), (83, 79))
NARROW = beam_cells((3.0, 4.0), 1.0, (5.0, 5.0), (83, 79), Profile("gaussian"))
CONE = cone_cells(2.0, 1.0, 40.0, 1.0, (83, 79))
LARGE, NEAR = Screen((60.0, 60.0), (48, 48), 8), Screen((125.0, 125.0), (48, 48), 8)


def both_of(front, space):
    """Return the small lens with a rough THB sag on its rear, and one on its front where that is curved."""
    lens = small_lens(front, SPHEROID, rough(space, 0.02), space=space)
    other = THBSpace(*(KnotVector.uniform(3, 5, -10.0, 10.0) for _ in "xy"))
    return lens if front is PLANE else _with_front(lens, other)


def _with_front(lens, space):
    return replace(lens, front=lens.front.with_sag(THBSurface(space, rough(space, 0.02, 8))))


CASES = {
    "beam, THB rear": (both_of(PLANE, small_space()), BEAM, TARGET_Z, SCREEN),
    "beam, curved front, both": (both_of(Conic(60.0), small_space()), BEAM, TARGET_Z, SCREEN),
    "beam, hollow lens, both": (BOTH, NARROW, 1005.0, NEAR),
    "point, rear": (REAR, CONE, 1005.0, WIDE),
    "point, both": (BOTH, CONE, 1005.0, WIDE),
    "beam, both, far": (BOTH, NARROW, np.inf, ANGLES),
    "point, both, far": (BOTH, CONE, np.inf, ANGLES),
}
CHARGES = {"fit": (0.0, 0.0, False), "all charges": (100.0, 0.5, True)}


def made_objective(backend, case, charges):
    lens, cells, target_z, screen = case
    lost, dark, shaped = charges
    rays = cells.rays()
    tracer = tracer_to(backend, lens, rays, target_z, 0.02, proven=False)
    target = asked_for(screen)
    target[: screen.shape[0] // 4] = 0.0  # what is dark there is charged
    shape = shape_penalty([Part(lens, Limits(radius=20.0, thickness=1.0))], roughness=0.1) if shaped else None
    mapped = MappedCells(backend, screen, cells.emitted, rays.flux, cells.turned)
    return Objective(TracedModel(backend, tracer, screen, mapped), target, lost, dark, shape), tracer


def worst(function, at, gradient, step, count=8):
    """Return the greatest error of g . d over random unit directions, relative to |g| / sqrt(n); differences
    of two steps extrapolated, so that they err by h^4."""
    rng, errors = np.random.default_rng(11), []
    for _ in range(count):
        d = rng.standard_normal(len(at))
        d /= np.linalg.norm(d)
        one, two = ((function(at + h * d)[0] - function(at - h * d)[0]) / (2 * h) for h in (step, 2 * step))
        errors.append(abs((4 * one - two) / 3 - gradient @ d))
    return max(errors) / (np.linalg.norm(gradient) / np.sqrt(len(at)))


CHARGED = "beam, THB rear", "point, both", "beam, both, far"  # in `make test`


@pytest.mark.every(3)
@pytest.mark.parametrize(
    ("case", "charges"),
    [
        pytest.param(CASES[case], CHARGES[word], id=f"{case}-{word}", marks=() if often else pytest.mark.slow)
        for case in CASES
        for word, often in (("fit", True), ("all charges", case in CHARGED))
    ],
)
def test_the_gradient_is_that_of_the_loss(backend, case, charges):
    """No corner meets a rim and no triangle is laid along an edge, so that the loss is smooth but for second
    derivatives, which jump where corners cross pixel lines: a share h / pixel of all corners does, each with
    its own sign.  With h = 1e-5 mm that leaves 1e-6 of the gradient at most, and rounding 1e-16 / h.
    """
    objective, _ = made_objective(backend, case, charges)
    spaces = [sag.space for sag in case[0].sags]
    function, at = of_vector(objective, *spaces), np.concatenate(coefficients(case[0]))
    loss, gradient = function(at)
    assert loss > 0.01
    assert worst(function, at, gradient, 1e-5) < 1e-6
    ends = np.cumsum([space.dim for space in spaces])
    assert all(np.linalg.norm(g) > 1e-3 * np.linalg.norm(gradient) for g in np.split(gradient, ends[:-1]))


def test_the_loss_is_the_formula(backend):
    """|E - T|^2 / |T|^2 on the target itself, not on what a window makes of it, and a charge per corner."""
    case = CASES["beam, THB rear"]
    objective, tracer = made_objective(backend, case, (7.0, 0.0, False))
    found = objective(coefficients(case[0]))
    _, landing = tracer.trace(coefficients(case[0]))
    target = asked_for(SCREEN)
    target[:12] = 0.0
    cells = MappedCells(backend, SCREEN, BEAM.emitted, BEAM.rays().flux)
    image = cells(landing.x, landing.y, landing.flux, landing.definite).numpy()
    image = image.reshape(SCREEN.padded, order="F")
    fit = np.sum((image - SCREEN.pad(target)) ** 2) / np.sum(target**2)
    assert found.fit == pytest.approx(np.sqrt(fit), rel=1e-12)
    beside = [np.maximum(np.abs(c.numpy()) - 20.0, 0) ** 2 for c in (landing.x, landing.y)]
    lost = 7.0 * np.sum(landing.flux.numpy() * sum(beside)) / (400 * target.sum() * SCREEN.pixel_area)
    assert found.loss == pytest.approx(fit + lost, rel=1e-12)
    np.testing.assert_allclose(
        objective.image(coefficients(case[0])), SCREEN.crop(image), rtol=0, atol=1e-13 * image.max()
    )


def test_the_gradient_holds_where_light_misses_the_rear(backend):
    """A rear that light overfills, whose rim fades softly: corners of cells beyond the rim meet the plane
    that touches the surface there, so that the loss is as smooth as elsewhere, and the tolerance that of
    `test_the_gradient_is_that_of_the_loss`."""
    lens = small_lens(Conic(-25.0), SPHEROID, rear_half_width=(8.0, 8.0))
    case = lens, beam_cells((9.5, 9.5), 1.0, (10.0, 10.0), (61, 59)), TARGET_Z, LARGE
    objective, tracer = made_objective(backend, case, (100.0, 0.0, False))
    at = rough(lens.rear.sag.space, 0.02)
    (hits,), _ = tracer.trace([at])
    assert 0.2 < hits.hit.numpy().mean() < 0.9
    function = of_vector(objective, lens.rear.sag.space)
    _, gradient = function(at)
    assert worst(function, at, gradient, 1e-5) < 1e-6
