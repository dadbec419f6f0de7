"""The rays of the exact engine: drawn once for all stages that ask for the same, and their precision."""

from dataclasses import replace

import numpy as np
import pytest

from optics.light.engines import DrawnRays, ExactEngine, Film
from optics.scene.receivers import BSplineWindow
from tests.optics.cases import rough, small_system

LED = {"source.kind": "lambertian", "source.half_width": [0.5, 0.5], "source.distance": 12.0}


def film(system, rays=(16, 16), axes=(), fresh=None):
    return Film(system.target.screen(1, 3), rays, BSplineWindow(3), axes, fresh)


@pytest.mark.parametrize("changes", [{}, LED], ids=["beam", "led"])
def test_the_same_rays_are_drawn_once(tmp_path, changes):
    system, drawn = small_system(tmp_path, changes), DrawnRays()
    one, other, again = (drawn(system.source, film(system, fresh=seed)) for seed in (None, (1, 2), None))
    assert again[0] is one[0]
    alone, _ = DrawnRays()(system.source, film(system, fresh=(1, 2)))
    assert np.array_equal(other[0].flux, alone.flux)


@pytest.mark.parametrize(
    "asked", [{"rays": (32, 16)}, {"axes": (0,)}, {"fresh": (1,)}, {"fresh": (2,)}], ids=repr
)
def test_films_that_differ_have_rays_of_their_own(tmp_path, asked):
    """Here what is kept is what a new engine draws, bit for bit."""
    system, drawn = small_system(tmp_path, LED), DrawnRays()
    before, _ = drawn(system.source, film(system))
    drawn(system.source, film(system, fresh=(1,)))
    rays, axes = drawn(system.source, film(system, **asked))
    alone, axes_alone = DrawnRays()(system.source, film(system, **asked))
    assert rays is not before
    assert axes == axes_alone == asked.get("axes", ())
    for name in ("origin", "direction", "flux"):
        np.testing.assert_array_equal(getattr(rays, name), getattr(alone, name))


def test_another_source_has_rays_of_its_own(tmp_path):
    (tmp_path / "wide").mkdir()
    drawn, systems = DrawnRays(), [small_system(tmp_path, LED)]
    systems.append(small_system(tmp_path / "wide", LED | {"source.half_width": [1.0, 1.0]}))
    narrow, wide = (np.ptp(drawn(s.source, film(s))[0].origin[0]) for s in systems)
    assert wide == pytest.approx(2 * narrow)


def slopes(engine, system, film):
    """Return the derivatives of the squares of the pixels, at a rough rear."""
    sag = system.base.rear.sag
    light = engine.model(system, film).light([rough(sag.space)])
    (gradient,) = light.pull_back(2 * light.image)
    return gradient


def test_single_precision_rounds_drawn_rays_far_below_their_noise(tmp_path, backend):
    system = small_system(tmp_path, LED)
    rays = film(system, (256, 256))
    double, single = ExactEngine(backend), ExactEngine(backend, of_drawn=backend.with_precision("single"))
    exact, rounded = slopes(double, system, rays), slopes(single, system, rays)
    others = slopes(double, system, replace(rays, fresh=(5,)))
    noise = np.linalg.norm(others - exact)
    assert 0 < np.linalg.norm(rounded - exact) < 0.01 * noise


@pytest.mark.parametrize("window", [BSplineWindow(3), None], ids=["grid", "cells"])
def test_light_without_noise_keeps_its_precision(tmp_path, backend, window):
    system = small_system(tmp_path)
    same = replace(film(system, (33, 33)), window=window)
    single = ExactEngine(backend, of_drawn=backend.with_precision("single"))
    assert np.array_equal(slopes(single, system, same), slopes(ExactEngine(backend), system, same))


def test_light_from_far_keeps_its_precision(tmp_path, backend):
    """A million millimetres from the source single precision knows points to 0.06 mm."""
    far = {"source.distance": 1e6, "source.half_angle": 1e-3}
    system = small_system(tmp_path, LED | far)
    single = ExactEngine(backend, of_drawn=backend.with_precision("single"))
    rays = film(system, (65, 65))
    assert np.array_equal(slopes(single, system, rays), slopes(ExactEngine(backend), system, rays))
