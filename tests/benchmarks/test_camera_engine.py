"""The particle tracer with screen and camera as an engine: light and derivatives within their noise."""

from functools import partial

import numpy as np
import pytest

pytest.importorskip("mitsuba")

from benchmarks.designs.camera_engine import camera_engine, wide_screen
from optics.base.runtime import UserError, load_backend
from optics.designing.optimisation import shape_lens
from optics.exchange.mitsuba import LensMesh, load_mitsuba
from optics.light.engines import ExactEngine, Film
from optics.scene.receivers import GaussianWindow, Screen
from oracles.error_measures import relative
from tests.optics.cases import rough, small_system
from thbcad.surfaces import THBSurface

SIGMA = 0.5  # of the window in pixels: in a derivative along a direction each pixel it covers is a kernel
STUDY = {
    "target.pixels": [12, 12],
    "optimizer.window": "gaussian",
    "optimizer.sigma": SIGMA,
    "optimizer.rays_per_pixel": 16,
}


@pytest.fixture(scope="module")
def backend():
    return load_backend("double", 1)


@pytest.fixture(autouse=True)
def mi(backend, monkeypatch):
    """Mitsuba on one thread, and meshes of 97 vertices in each direction."""
    small = partial(LensMesh.uniform, counts=(97, 97))
    monkeypatch.setattr("benchmarks.designs.camera_engine.lens_mesh", small)
    threads = backend.dr.thread_count()
    yield load_mitsuba(threads=1)
    load_mitsuba(threads=threads)


def models(folder, backend, changes=None):
    """Return the exact model, that of the camera, and coefficients without symmetry."""
    system = small_system(folder, STUDY | (changes or {}))
    lens = system.base
    lens = lens.with_sags([THBSurface(s.space, rough(s.space, 0.1, k)) for k, s in enumerate(lens.sags)])
    film = Film(system.target.screen(1, 2), (121, 121), GaussianWindow(SIGMA))
    engines = ExactEngine(backend), camera_engine(1)
    return *(e.model(system.with_lens(lens), film) for e in engines), [sag.coefficients for sag in lens.sags]


@pytest.mark.slow
def test_light_and_derivatives_are_exact_but_for_noise(tmp_path, backend):
    """64 paths per pixel, each spread over a dozen by the window: irradiance errs by some 3 %.

    So do the gradient of a smooth function of it and the change along one direction.
    """
    exact, camera, at = models(tmp_path, backend)
    light, seen = exact.light(at), camera.light(at)
    assert relative(seen.image, light.image) < 0.05
    bar = light.image - light.image.mean()
    (found,), (wanted,) = seen.pull_back(bar), light.pull_back(bar)
    assert relative(found, wanted) < 0.1
    direction = [np.random.default_rng(3).standard_normal(len(c)) for c in at]
    assert np.vdot(camera.push_forward(at, direction)[1], bar) == pytest.approx(
        wanted @ direction[0], abs=0.1 * np.linalg.norm(wanted) * np.linalg.norm(direction[0])
    )


@pytest.mark.slow
def test_light_beside_the_target_is_charged_by_its_distance(tmp_path, backend):
    """The target is smaller than the light, which falls on the screen around it, not beyond."""
    exact, camera, at = models(tmp_path, backend, {"target.half_width": [12.0, 12.0]})
    light, seen = exact.light(at), camera.light(at)
    assert light.lost > 0
    assert seen.lost == pytest.approx(light.lost, rel=0.1, abs=0.01 * 12.0**2)
    dark = np.zeros(camera.screen.padded)
    assert relative(seen.pull_back(dark, 1.0)[0], light.pull_back(dark, 1.0)[0]) < 0.2


@pytest.mark.slow
def test_lights_do_not_depend_on_each_other(tmp_path, backend):
    _, camera, at = models(tmp_path, backend, {"optimizer.rays_per_pixel": 2})
    bar = np.random.default_rng(4).standard_normal(camera.screen.padded)
    alone = camera.light(at).pull_back(bar)
    first = camera.light(at)
    other = camera.light([c + 0.1 for c in at])
    assert not np.array_equal(first.image, other.image)
    assert relative(first.pull_back(bar)[0], alone[0]) < 1e-5  # float32 sums in any order


@pytest.mark.parametrize("margin", [0, 3, 20])
def test_the_camera_sees_twice_the_target_and_its_margin(margin):
    screen = Screen((20.0, 15.0), (48, 36), margin)
    wide = wide_screen(screen)
    assert wide.pitch == pytest.approx(screen.pitch)
    for count, own, padded in zip(wide.shape, screen.shape, screen.padded):
        assert count >= max(2 * own, padded)
        assert (count - padded) % 2 == 0


def test_a_lens_without_reflections_is_refused(tmp_path):
    system = small_system(tmp_path, {"optimizer.fresnel": False})
    film = Film(system.target.screen(), (64, 64), GaussianWindow(1.0))
    with pytest.raises(UserError, match=r"optimizer\.fresnel must be true"):
        camera_engine(1).model(system, film)


@pytest.mark.slow
def test_a_whole_design_runs_through_all_levels(tmp_path, backend):
    changes = STUDY | {"optimizer.start": "flat", "optimizer.iterations": [3], "optimizer.method": "adam"}
    changes["optimizer.rays_per_pixel"] = 4
    system = small_system(tmp_path, changes)
    _, state = shape_lens(system, backend, camera_engine(1))
    fits = [row.fit for row in state.history]
    assert len({row.level for row in state.history}) == 3
    assert min(fits) <= fits[0]
    assert len(fits) > 3
