"""The light of a model through Mitsuba's tensor: the same numbers but for float32, and a whole design."""

import numpy as np
import pytest

pytest.importorskip("mitsuba")

from optics.designing.optimisation import shape_lens, vertex_knots
from optics.exchange.mitsuba.engines import mitsuba_engine
from optics.exchange.mitsuba.integrator import light_integrator
from optics.light.engines import ExactEngine, Film
from optics.scene.problem import load_problem
from optics.scene.receivers import BSplineWindow
from optics.scene.system import System
from tests.optics.cases import rough, small_system
from thbcad.surfaces import THBSurface

pytestmark = pytest.mark.usefixtures("mi")
EPS = 2.0**-24  # to which numbers are rounded in float32
BOTH_FREE = {"lens.front.freeform": {"spans": [3, 2], "z_freedom": 1.0}}
CASES = {
    "cells": ({}, None, ()),
    "mirrored quarter of cells": ({"target.kind": "tophat"}, None, (0, 1)),
    "rays through two free surfaces": (BOTH_FREE, BSplineWindow(2), ()),
}


def models(folder, backend, changes, window, axes):
    """Return the exact model, the rendered one, the coefficients, and weights of pixels and lost light."""
    system = small_system(folder, changes)
    lens = system.base
    lens = lens.with_sags([THBSurface(s.space, rough(s.space, 0.3, k)) for k, s in enumerate(lens.sags)])
    film = Film(system.target.screen(2, 3), (91, 87) if not axes else (91, 91), window, axes)
    engines = ExactEngine(backend), mitsuba_engine("mitsuba-exact", 1)
    bar = np.random.default_rng(4).standard_normal(film.screen.padded)
    return *(e.model(system.with_lens(lens), film) for e in engines), lens, (bar, 0.3)


@pytest.mark.parametrize("name", CASES)
def test_light_and_derivatives_are_exact_but_for_the_tensors_rounding(tmp_path, backend, name):
    """Every weight on its way back is rounded by at most EPS of itself; pixels are completed.

    Sums over the weights lose no more than that of their norms, as long as nothing cancels.
    """
    exact, rendered, lens, bars = models(tmp_path, backend, *CASES[name])
    at = [sag.coefficients for sag in lens.sags]
    light, other = exact.light(at), rendered.light(at)
    assert np.linalg.norm(other.image - light.image) <= EPS**2 * np.linalg.norm(light.image)
    assert other.lost == pytest.approx(light.lost, rel=EPS)
    wanted = light.pull_back(*bars)
    for _ in range(2):  # the second renders again
        for a, b in zip(other.pull_back(*bars), wanted):
            assert np.linalg.norm(a - b) < 1e-6 * np.linalg.norm(b)
    direction = [np.random.default_rng(6).standard_normal(len(c)) for c in at]
    _, forward = rendered.push_forward(at, direction)
    slope = sum(g @ d for g, d in zip(exact.light(at).pull_back(bars[0]), direction))
    assert np.vdot(forward, bars[0]) == pytest.approx(
        slope, abs=EPS * np.linalg.norm(forward) * np.linalg.norm(bars[0])
    )
    knots = [vertex_knots(s.half_width, (20, 21)) for s in (lens.front, lens.rear) if s.sag is not None]
    for a, b in zip(other.pull_back(*bars, knots), exact.light(at).pull_back(*bars, knots)):
        assert np.linalg.norm(a - b) < 1e-12 * np.linalg.norm(b)


def test_a_render_and_its_derivative_trace_once(mi, tmp_path, backend):
    exact, _, lens, _ = models(tmp_path, backend, *CASES["cells"])
    calls = []

    class Counted:
        screen = exact.screen

        def light(self, coefficients):
            calls.append("light")
            return exact.light(coefficients)

    integrator = light_integrator(Counted(), {"rear": lens.rear.sag.coefficients})
    scene = mi.load_dict({"type": "scene", "integrator": integrator, "sensor": {"type": "perspective"}})
    parameters = mi.traverse(scene)
    backend.dr.enable_grad(parameters["integrator.rear_coefficients"])
    backend.dr.backward(backend.dr.sum(mi.render(scene, parameters), axis=None))
    assert calls == ["light"]
    assert backend.dr.grad(parameters["integrator.rear_coefficients"]).numpy().any()
    parameters["integrator.rear_coefficients"] = mi.Float64(lens.rear.sag.coefficients + 0.01)
    parameters.update()
    mi.render(scene, parameters)
    assert calls == ["light"] * 2


def test_a_whole_design_ends_where_that_of_the_exact_engine_does(problem_file, backend):
    """Its film rounds weights by 6e-8; six steps of L-BFGS make more of that."""
    system = System(load_problem(problem_file()))
    engines = ExactEngine(backend), mitsuba_engine("mitsuba-exact", 1)
    states = [shape_lens(system, backend, engine)[1] for engine in engines]
    fits = [min(row.fit for row in state.history) for state in states]
    assert np.array_equal(*(state.sags[0].space.cells for state in states))
    assert fits[1] == pytest.approx(fits[0], abs=1e-4)
