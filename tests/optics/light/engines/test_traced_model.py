"""The light of traced rays and cells: derivatives in both directions, and nothing kept between calls."""

from itertools import count

import numpy as np
import pytest

from optics.base.runtime import load_backend
from optics.light.engines import ExactEngine, Film
from optics.light.intersections import Hits
from optics.scene.receivers import BSplineWindow
from tests.optics.cases import THREADS, on_threads, roughened, small_system

POINT = {
    "source.kind": "point",
    "source.half_width": [0, 0],
    "source.distance": 40.0,
    "source.half_angle": 12.0,
}
BEYOND = {"target.half_width": [14.0, 6.0], "source.half_width": [12.0, 9.5], "lens.front.radius": 60.0}
BOTH_FREE = {"lens.front.freeform": {"spans": [3, 2], "z_freedom": 1.0}}
CASES = {
    "cells": ({}, None),
    "cells over the borders": (BEYOND, None),
    "cells of a point through two free surfaces": (POINT | BOTH_FREE, None),
    "rays": ({}, BSplineWindow(2)),
    "rays through two free surfaces": (BOTH_FREE, BSplineWindow(2)),
    "far field": ({"target.distance": np.inf, "target.half_width": [12.0, 12.0]}, None),
}


def model_of(folder, backend, changes, window, axes=(), pixels=24, rays=(91, 87)):
    system = small_system(folder, changes)
    lens = roughened(system.base, 0.05, count())
    film = Film(system.target.screen(48 // pixels, 3), rays, window, axes)
    return ExactEngine(backend).model(system.with_lens(lens), film), [sag.coefficients for sag in lens.sags]


HALVES = {f"mirrored in {axes}": ({"target.kind": "tophat"}, None, axes) for axes in ((0,), (1,), (0, 1))}


@pytest.mark.parametrize("name", [*CASES, *HALVES])
def test_forward_is_the_transpose_of_backward(tmp_path, backend, name):
    """w . (J d) == (J' w) . d but for rounding: sums of 1e4 terms of both signs."""
    model, at = model_of(tmp_path, backend, *(CASES | HALVES)[name])
    rng = np.random.default_rng(1)
    directions, weights = [rng.standard_normal(len(c)) for c in at], rng.standard_normal(model.screen.padded)
    image, forward = model.push_forward(at, directions)
    np.testing.assert_allclose(image, model.image(at), rtol=0, atol=1e-12 * image.max())
    backward = model.light(at).pull_back(weights)
    scale = np.linalg.norm(forward) * np.linalg.norm(weights)
    assert scale > 0
    assert np.vdot(forward, weights) == pytest.approx(
        sum(g @ d for g, d in zip(backward, directions)), abs=1e-12 * scale
    )


@pytest.mark.parametrize("name", ["cells", "cells of a point through two free surfaces", "far field"])
def test_forward_agrees_with_differences_of_the_image(tmp_path, backend, name):
    """Central differences extrapolated from two steps err by h^4; pixels' second derivatives have kinks."""
    model, at = model_of(tmp_path, backend, *CASES[name])
    rng = np.random.default_rng(2)
    directions = [rng.standard_normal(len(c)) for c in at]

    def difference(h):
        there, back = (model.image([c + s * d for c, d in zip(at, directions)]) for s in (h, -h))
        return (there - back) / (2 * h)

    h = 2e-6
    wanted = (4 * difference(h) - difference(2 * h)) / 3
    error = np.linalg.norm(model.push_forward(at, directions)[1] - wanted) / np.linalg.norm(wanted)
    assert error < 1e-7


@pytest.mark.parametrize("name", CASES)
def test_the_light_can_be_pulled_back_again_and_again(tmp_path, backend, name):
    model, at = model_of(tmp_path, backend, *CASES[name])
    light, weights = model.light(at), np.random.default_rng(3).standard_normal(model.screen.padded)
    first, second, twice = (light.pull_back(k * weights) for k in (1, 1, 2))
    for one, same, double in zip(first, second, twice):
        np.testing.assert_allclose(same, one, rtol=0, atol=1e-13 * np.abs(one).max())
        np.testing.assert_allclose(double, 2 * one, rtol=0, atol=1e-12 * np.abs(one).max())
    np.testing.assert_array_equal(light.image, model.image(at))


def test_a_pull_back_that_is_stopped_does_not_spoil_the_next(tmp_path, backend, monkeypatch):
    model, at = model_of(tmp_path, backend, {}, None)
    light, bar = model.light(at), bar_of(model)
    (wanted,) = light.pull_back(bar)

    def stopped(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(Hits, "taken_gradients", stopped)
        with pytest.raises(KeyboardInterrupt):
            light.pull_back(bar)
    (found,) = light.pull_back(bar)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-13 * np.abs(wanted).max())


def test_models_used_in_turn_give_the_bytes_of_each_alone(tmp_path, one_thread):
    def made(changes, window):
        return model_of(tmp_path, one_thread, changes, window)

    cases = [CASES["cells"], CASES["rays through two free surfaces"], CASES["cells over the borders"]]
    alone = [results(*made(*case)) for case in cases]
    models = [made(*case) for case in cases]
    lights = [model.light(at) for model, at in models]
    bars = [bar_of(model) for model, _ in models]
    backward = [light.pull_back(bar) for light, bar in zip(lights, bars)]
    for (image, gradients), light, found in zip(alone, lights, backward):
        assert light.image.tobytes() == image.tobytes()
        assert [g.tobytes() for g in found] == [g.tobytes() for g in gradients]


@pytest.fixture
def one_thread(backend):
    threads = backend.dr.thread_count()
    yield load_backend("double", 1)
    load_backend("double", threads)


def bar_of(model):
    return np.random.default_rng(4).standard_normal(model.screen.padded)


def results(model, at):
    light = model.light(at)
    return light.image, light.pull_back(bar_of(model))


@pytest.mark.every(3)
@pytest.mark.parametrize("name", CASES)
def test_light_and_derivatives_are_the_same_on_any_number_of_threads(tmp_path, backend, name):
    """Image, gradient and change along a direction, with 9 and more rays or cells on a pixel."""
    model, at = model_of(tmp_path, backend, *CASES[name], rays=(301, 287))
    rng = np.random.default_rng(1)
    directions, weights = [rng.standard_normal(len(c)) for c in at], rng.standard_normal(model.screen.padded)

    def numbers():
        light = model.light(at)
        found = [light.image, *light.pull_back(weights, 1.0), *model.push_forward(at, directions)]
        return tuple(f.tobytes() for f in found), light.lost

    assert len({on_threads(threads, numbers) for threads in THREADS}) == 1
