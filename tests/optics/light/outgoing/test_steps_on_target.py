"""What a file's steps do to light on the target: none to an even intensity, less with finer steps."""

import numpy as np
import pytest

from optics.light.analysis import uniformity_of_pixels
from optics.light.outgoing import StepsOnTarget
from optics.scene.luminaires import IntensityGrid, Luminaire, Opening
from tests.optics.cases import small_system, target_z

WIDE = {
    "target.kind": "tophat",
    "target.shape": "rectangle",
    "target.lit": [0.5, 0.5],
    "target.distance": 100.0,
    "target.half_width": [60.0, 40.0],
    "target.pixels": [24, 16],
}
FAR = WIDE | {"target.distance": np.inf, "target.half_width": [40.0, 30.0]}


def directions(system):
    """Return where the middles of the pixels lie, seen from the rear, (3, rows, columns)."""
    screen = system.target.screen()
    x, y = np.meshgrid(*screen.centres)
    if screen.angular:
        return np.stack([np.tan(np.radians(x)), np.tan(np.radians(y)), np.ones_like(x)])
    return np.stack([x, y, np.full_like(x, target_z(system.problem) - system.base.thickness)])


def even_light(system):
    """Return the light of an intensity of 1 in all directions."""
    way = directions(system)
    if system.target.far_field:
        return np.ones(way.shape[1:])
    return way[2] / np.linalg.norm(way, axis=0) ** 3


@pytest.mark.parametrize("changes", [WIDE, FAR], ids=["plane", "far field"])
def test_an_even_intensity_stays_within_the_border(tmp_path, changes):
    """Beside the target there is no light: only pixels within two steps of its border change."""
    system = small_system(tmp_path, changes)
    beside = StepsOnTarget(system, even_light(system))
    planes, gammas = np.linspace(0, 360, 37), np.linspace(0, 180, 19)
    everywhere = beside.by_file(Luminaire(planes, gammas, np.ones((37, 19))))
    assert everywhere.rel_l2 < 2e-3  # the mean of a pixel is not its middle
    assert everywhere.min_over_mean == pytest.approx(beside.own.min_over_mean, rel=2e-3)
    assert beside.by_steps(2.5).min_over_mean == pytest.approx(beside.own.min_over_mean, rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("changes", [WIDE, FAR], ids=["plane", "far field"])
def test_finer_steps_change_light_less_and_u0_is_that_of_the_photometry(tmp_path, changes):
    system = small_system(tmp_path, changes | {"target.pixels": [96, 64]})  # below a cell of the photometry
    way = directions(system)
    wave = 1 + 0.5 * np.cos(0.9 * np.degrees(np.arctan(way[0] / way[2])) + 1)  # a period of 7 degrees
    light = even_light(system) * wave
    beside = StepsOnTarget(system, light)
    assert beside.own.rel_l2 == 0
    even = uniformity_of_pixels(system, light, system.target.screen(), 0.0)
    assert beside.own.min_over_mean == even.min_over_mean
    coarse, default, fine = (beside.by_steps(step) for step in (7.5, 2.5, 0.5))
    assert coarse.rel_l2 > 1.5 * default.rel_l2 > 6 * fine.rel_l2 > 0
    assert coarse.min_over_mean > 1.2 * beside.own.min_over_mean  # waves within a step are gone
    assert fine.min_over_mean == pytest.approx(beside.own.min_over_mean, rel=0.1)


def test_the_steps_alone_do_what_a_file_of_many_rays_does(tmp_path):
    """Independent code: every pixel's light as 400 rays on the grid of the file."""
    system = small_system(tmp_path, WIDE)
    way, rng = directions(system), np.random.default_rng(1)
    light = rng.uniform(0.2, 1.0, way.shape[1:]) * (way[0] > -20)
    screen, step = system.target.screen(), 5.0
    (px, py), parts = screen.pitch, (np.arange(20) + 0.5) / 20 - 0.5
    rays = [way + np.array([a * px, b * py, 0.0])[:, None, None] for a in parts for b in parts]
    grid = IntensityGrid(36, 36)
    flux = sum(grid.flux(ray.reshape(3, -1), light.ravel()) for ray in rays)
    beside = StepsOnTarget(system, light)
    by_rays = beside.by_file(grid.luminaire(flux, Opening()))
    alone = beside.by_steps(step)
    assert alone.rel_l2 == pytest.approx(by_rays.rel_l2, rel=0.05)
    assert alone.min_over_mean == pytest.approx(by_rays.min_over_mean, rel=0.05)
