"""Light by other ways that follows the rear: the closed lens's own branches, and derivatives both ways."""

from dataclasses import replace
from itertools import count

import numpy as np
import pytest

from optics.light.engines import ExactEngine, Film, JointModel, light_within
from optics.light.tracing import FATES, TargetArea, trace_nonsequential
from optics.scene.receivers import BSplineWindow
from optics.scene.sources import Rays
from tests.optics.cases import DOME, roughened, small_system

SMALL = DOME | {"target.pixels": [24, 24]}
BOTH_FREE = {"lens.front.freeform": {"spans": [3, 2], "z_freedom": 1.0}}


def followed(folder, backend, changes, bounces=12):
    """Return (system, lens, all its branches, those within before the rear as rays)."""
    system = small_system(folder, SMALL | changes)
    lens = roughened(system.base, 0.2, count())
    rays, path = (
        system.with_lens(lens).own_rays(system.source.rays((48, 48))),
        system.with_lens(lens).own_path,
    )
    area = TargetArea.of(path, system.target.screen().half_width)
    every = trace_nonsequential(backend, lens, rays, area, bounces, threshold=0.0)
    within = every.onto_rear
    return system, lens, every, Rays(within.origin, within.direction, within.flux)


def test_rays_within_leave_the_rear_as_branches_of_the_closed_lens_do(tmp_path, backend):
    """They land at the same points with the same flux: edges, front and direct light have no part in it."""
    system, lens, every, rays = followed(tmp_path, backend, {"lens.absorption": 0.02})
    by_rear = ~every.direct & np.isin(every.fate, [FATES.index("on_target"), FATES.index("off_target")])
    wanted = np.column_stack([every.landings.points, every.landings.flux])[by_rear]
    film = Film(system.target.screen(1, 3), (48, 48), BSplineWindow(2))
    _, landing = light_within(backend, system.with_lens(lens).own_path, rays, film)._tracer.trace()
    found = np.column_stack([landing.x.numpy(), landing.y.numpy(), landing.flux.numpy()])
    found = found[found[:, 2] > 0]
    assert len(found) == len(wanted) > 100
    for got, want in zip(*(a[np.argsort(a[:, 0])].T for a in (found, wanted))):
        np.testing.assert_allclose(got, want, rtol=1e-6, atol=1e-6 * abs(want).max())


@pytest.mark.parametrize("axes", [(), (0, 1)])
def test_forward_is_the_transpose_of_backward_and_the_start_is_the_path_alone(tmp_path, backend, axes):
    """w . (J d) == (J' w) . d but for rounding; at the start nothing has changed."""
    system, lens, _, rays = followed(tmp_path, backend, BOTH_FREE)
    film = Film(system.target.screen(1, 3), (48, 48), BSplineWindow(2), axes)
    path = ExactEngine(backend).model(system.with_lens(lens), film)
    within = light_within(backend, system.with_lens(lens).own_path, rays, film)
    at, rng = [sag.coefficients for sag in lens.sags], np.random.default_rng(1)
    model = JointModel(path, within, within.image(at[-1:]))
    np.testing.assert_allclose(model.image(at), path.image(at), rtol=0, atol=1e-12 * path.image(at).max())
    directions, weights = [rng.standard_normal(len(c)) for c in at], rng.standard_normal(model.screen.padded)
    image, forward = model.push_forward(at, directions)
    np.testing.assert_allclose(model.light(at).image, image, rtol=0, atol=1e-12 * image.max())
    backward = model.light(at).pull_back(weights)
    assert np.linalg.norm(forward - path.push_forward(at, directions)[1]) > 0.01 * np.linalg.norm(forward)
    assert np.vdot(forward, weights) == pytest.approx(
        sum(g @ d for g, d in zip(backward, directions)),
        abs=1e-12 * np.linalg.norm(forward) * np.linalg.norm(weights),
    )


def test_light_within_is_its_own_mirror_image_in_the_axes(tmp_path, backend):
    system, lens, _, rays = followed(tmp_path, backend, {})
    film = Film(system.target.screen(1, 3), (48, 48), BSplineWindow(2))
    at = [sag.coefficients for sag in lens.sags]
    whole, halves = (
        light_within(backend, system.with_lens(lens).own_path, rays, replace(film, axes=axes)).image(at)
        for axes in ((), (0,))
    )
    np.testing.assert_allclose(halves, (whole + whole[:, ::-1]) / 2, rtol=0, atol=1e-12 * whole.max())
