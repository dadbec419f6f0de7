"""The light of meshes as an engine: all that the exact engine has, but for the error of the mesh."""

import numpy as np
import pytest

pytest.importorskip("mitsuba")

from optics.base.runtime import UserError
from optics.designing.optimisation import shape_lens, vertex_knots
from optics.designing.starts import summed_over_cells
from optics.exchange.mitsuba import engines
from optics.exchange.mitsuba.engines import mitsuba_engine
from optics.light.engines import ExactEngine, Film
from optics.scene.problem import load_problem
from optics.scene.receivers import BSplineWindow
from optics.scene.system import System
from tests.optics.cases import rough, small_system
from thbcad.surfaces import THBSurface

BOTH_FREE = {"lens.front.freeform": {"spans": [3, 2], "z_freedom": 1.0}}
WIDE = {"source.half_width": [14.0, 14.0], "target.half_width": [9.0, 9.0]}
GLOWING = BOTH_FREE | {
    "source.kind": "lambertian",
    "source.half_width": [1.0, 1.0],
    "source.distance": 20.0,
    "source.half_angle": 25.0,
}
CASES = {
    "cells": ({}, None, ()),
    "cells of a beam beyond the rims": (WIDE, None, ()),
    "mirrored quarter of cells": ({"target.kind": "tophat"}, None, (0, 1)),
    "rays through two free surfaces": (BOTH_FREE, BSplineWindow(2), ()),
    "extended source": (GLOWING, BSplineWindow(2), ()),
    "far field": ({"target.distance": np.inf, "target.half_width": [8.0, 8.0]}, None, ()),
}


@pytest.fixture(autouse=True)
def coarse(mi, monkeypatch):
    """Meshes of 161 vertices in each direction."""
    monkeypatch.setattr(engines, "FEWEST", 160)


def models(folder, backend, changes, window, axes):
    """Return the exact model, that of the mesh, the lens and the numbers of pixels with margin."""
    system = small_system(folder, changes)
    lens = system.base
    lens = lens.with_sags([THBSurface(s.space, rough(s.space, 0.1, k)) for k, s in enumerate(lens.sags)])
    film = Film(system.target.screen(4, 3), (91, 87) if not axes else (91, 91), window, axes)
    pair = ExactEngine(backend), mitsuba_engine("mitsuba-mesh", 1)
    return *(e.model(system.with_lens(lens), film) for e in pair), lens


def error(found, wanted):
    found, wanted = (np.concatenate([np.ravel(a) for a in rows]) for rows in (found, wanted))
    return np.linalg.norm(found - wanted) / np.linalg.norm(wanted)


@pytest.mark.every(3)
@pytest.mark.parametrize("name", CASES)
def test_light_and_derivatives_are_near_the_exact_ones(tmp_path, backend, name):
    """Slopes err by h^2 / 8 of their second derivative: 1e-4 of them with 40 vertices per knot span.

    Landing points then err by 1e-3 of a pixel, and so do irradiance and smooth derivatives; single precision
    adds less.  Rays at the rims may count differently where they are lost.
    """
    exact, mesh, lens = models(tmp_path, backend, *CASES[name])
    at = [sag.coefficients for sag in lens.sags]
    bar = np.random.default_rng(4).standard_normal(exact.screen.padded)
    light, other = exact.light(at), mesh.light(at)
    assert error([other.image], [light.image]) < 1e-3
    assert other.lost == pytest.approx(light.lost, rel=1e-3, abs=1e-6)
    assert error(other.pull_back(bar, 0.1), light.pull_back(bar, 0.1)) < 5e-3
    directions = [np.random.default_rng(5).standard_normal(len(c)) for c in at]
    assert error([mesh.push_forward(at, directions)[1]], [exact.push_forward(at, directions)[1]]) < 5e-3


@pytest.mark.parametrize("name", ["cells", "rays through two free surfaces"])
def test_vertex_gradients_mark_the_same_cells(tmp_path, backend, name):
    """Mesh vertices sample the surfaces as rays do: sums over cells differ by the samplings."""
    exact, mesh, lens = models(tmp_path, backend, *CASES[name])
    at, surfaces = [s.coefficients for s in lens.sags], [s for s in (lens.front, lens.rear) if s.sag]
    knots = [vertex_knots(s.half_width, (12, 14)) for s in surfaces]
    bar = np.random.default_rng(4).standard_normal(exact.screen.padded)
    found, wanted = (model.light(at).pull_back(bar, 0.1, knots) for model in (mesh, exact))
    for (kv_x, kv_y), surface, *gradients in zip(knots, surfaces, found, wanted):
        sums = [
            summed_over_cells(surface.sag.space, kv_x.greville(), kv_y.greville(), abs(g)) for g in gradients
        ]
        assert np.corrcoef(*sums)[0, 1] > 0.99


def test_a_light_keeps_its_derivatives_when_the_mesh_moves_on(tmp_path, backend):
    _, mesh, lens = models(tmp_path, backend, *CASES["rays through two free surfaces"])
    at = [sag.coefficients for sag in lens.sags]
    bar = np.random.default_rng(4).standard_normal(mesh.screen.padded)
    alone = mesh.light(at).pull_back(bar, 0.1)
    light = mesh.light(at)
    mesh.light([c + 0.2 for c in at])
    for a, b in zip(light.pull_back(bar, 0.1), alone):
        np.testing.assert_array_equal(a, b)


def test_vertices_follow_the_levels_spans(tmp_path):
    lens = small_system(tmp_path).base
    fine = lens.with_sags([sag.refine({0: [(0, 0)]}) for sag in lens.sags])
    for case, spans in ((lens, 4), (fine, 8)):
        mesh = engines.lens_mesh(case)
        assert (len(mesh.s) - 1) % spans == 0
        assert len(mesh.s) > max(engines.FEWEST, engines.PER_SPAN * spans)


@pytest.mark.slow
def test_a_whole_design_ends_near_that_of_the_exact_engine(problem_file, backend):
    """With 10 vertices per knot span of the last level."""
    system = System(load_problem(problem_file({"optimizer.start": "flat", "optimizer.iterations": [3]})))
    pair = ExactEngine(backend), mitsuba_engine("mitsuba-mesh", 1)
    states = [shape_lens(system, backend, engine)[1] for engine in pair]
    fits = [[row.fit for row in state.history] for state in states]
    assert len({row.level for row in states[1].history}) == 3
    assert min(fits[1]) < 0.8 * fits[1][0]
    assert min(fits[1]) == pytest.approx(min(fits[0]), rel=0.1)


@pytest.mark.parametrize("glass", [{"lens.absorption": 0.02}, {"lens.front.reflectance": 0.1}])
def test_glass_that_absorbs_or_is_coated_is_refused(tmp_path, backend, glass):
    with pytest.raises(UserError, match="clear and bare glass: leave out absorption and the reflectance"):
        models(tmp_path, backend, glass, None, ())
