"""What tracing leaves out: the list agrees with what the tracer does, and results stay."""

import numpy as np
import pytest
from scipy.integrate import quad

from optics.designing.optimisation import Objective, stage_window, stages
from optics.light.engines import TracedModel
from optics.light.intersections import KnownHits
from optics.scene.problem import load_problem
from optics.scene.receivers import BSplineWindow, GaussianWindow
from optics.scene.sources import single_rays
from optics.scene.system import System
from optics.scene.system.tracing_skips import gaussian_tail
from oracles.light_formulas import window_value
from tests.optics.cases import rough, target_z, tracer_to

LAMBERTIAN = {
    "source.kind": "lambertian",
    "source.half_width": [0.5, 0.5],
    "source.distance": 2.0,
    "optimizer.window": "bspline",
}
PROBLEMS = {
    "plane front": ({}, {"meeting points", "front", "gradients"}),
    "wide beam": ({"source.half_width": [15.0, 12.0]}, {"meeting points", "front", "gradients", "aperture"}),
    "curved front": (
        {"lens.front.radius": 200.0},
        {"front", "gradients", "converged rays", "first meetings"},
    ),
    "free front": (
        {"lens.front.freeform": {"spans": [3, 3], "max_level": 1}},
        {"converged rays", "first meetings"},
    ),
    "spread light": (LAMBERTIAN, {"front", "gradients", "converged rays", "first meetings"}),
    "one level": (
        {"lens.rear.freeform.max_level": 0, "optimizer.window": "gaussian"},
        {"meeting points", "front", "gradients"},
    ),
}
ALWAYS, NEVER = {"edges", "camera", "taps", "compilation", "blur", "wavelengths"}, {"fresnel"}


@pytest.fixture(params=PROBLEMS, ids=str)
def case(request, problem_file):
    """(problem, names of the skips that apply)"""
    changes, applying = PROBLEMS[request.param]
    deep = set() if request.param == "one level" else {"levels"}
    return load_problem(problem_file(changes)), applying | ALWAYS | deep


def test_skips_are_decided_by_the_problem(case):
    problem, applying = case
    found = System(problem).skips
    assert {s.name for s in found if s.applies} == applying
    assert len({s.name for s in found}) == len(found) == 14
    assert not NEVER & {s.name for s in found if s.applies}
    assert [s.line.startswith("skips ") for s in found] == [s.applies for s in found]


def test_the_tracer_leaves_out_what_is_listed(backend, case):
    problem, applying = case
    lens, rays = System(problem).base, System(problem).source.rays((16, 16))
    tracer = tracer_to(backend, lens, rays, target_z(problem))
    hits, _ = tracer.trace([sag.coefficients for sag in lens.sags])
    assert isinstance(tracer._surfaces[1].hits, KnownHits) == ("meeting points" in applying)
    assert (len(hits) == 1) == ("gradients" in applying)
    if problem.source.kind == "collimated":
        whole = problem.source.half_width[0] * (1 - 1 / 16)
        assert (rays.x.max() < whole) == ("aperture" in applying)
    (line,) = [s.what for s in System(problem).skips if s.name == "taps"]
    exact = stages(System(problem), False)[-1].exact
    taps = stage_window(problem, True).taps
    assert ("edge of a cell" in line) == exact
    assert (f"{taps} x {taps}" in line) == (not exact)


def test_known_meeting_points_change_nothing(backend, problem_file):
    """The one skip that takes another way: loss and gradient at a rough state keep to its tolerance."""
    problem = load_problem(problem_file())
    lens, beam = System(problem).base, System(problem).source.rays((65, 65))
    c = [rough(lens.rear.sag.space)]
    screen = System(problem).target.screen()
    target = System(problem).target.irradiance(screen, 0.9)
    tracers = (tracer_to(backend, lens, rays, target_z(problem)) for rays in (beam, single_rays(beam, lens)))
    found, by_search = (
        Objective(TracedModel(backend, t, screen, BSplineWindow(3)), target, 1.0)(c) for t in tracers
    )
    (gradient,), (other,) = found.gradients, by_search.gradients
    (skip,) = [s for s in System(problem).skips if s.name == "meeting points"]
    assert found.loss == pytest.approx(by_search.loss, rel=skip.tolerance)
    assert np.linalg.norm(gradient - other) < skip.tolerance * np.linalg.norm(other)
    assert (gradient != other).any()  # indeed two ways


@pytest.mark.parametrize("cut", [2.0, 3.0, 4.0])
def test_the_gaussians_tail_bounds_what_the_cut_changes(cut):
    """Twice the L1 distance of the windows of one direction, by quadrature."""

    def distance(s):
        return abs(
            float(window_value(GaussianWindow(1.0, cut), s)) - np.exp(-(s**2) / 2) / np.sqrt(2 * np.pi)
        )

    change = 2 * 2 * (quad(distance, 0, cut, limit=200)[0] + quad(distance, cut, 12)[0])
    assert gaussian_tail(cut) / 3 < change <= gaussian_tail(cut)
