"""The blur of cusps against closed forms, and against the exact trace of a lens with its cusps."""

import numpy as np
import pytest

from optics.light.analysis import measure
from optics.tolerancing.machining import (
    ToolOrder,
    cusp_blur,
    landing_response,
    light_with_cusps,
    traced_points,
)
from tests.optics.cases import WIDE, small_lens, small_system
from tests.optics.tolerancing.machining.cases import bowl_lens
from thbcad.sags import Conic
from thbcad.tools import air_side, ball_cusps

PIXEL = 40 / 48  # mm, of the small problem
LENGTH = 60.0  # mm, from the rear's vertex to its target


def system_of(folder, changes=None):
    return small_system(folder, changes)


def blur_of(system, lens, backend, order, name="rear", rays=9):
    response = landing_response(system.with_lens(lens), backend, name, rays)
    return response, cusp_blur(air_side(lens, name), response, system.target.screen(), order)


def test_on_a_plane_the_blur_is_the_way_times_snells_factor_times_step_over_radius(tmp_path, backend):
    """Behind a plane at normal incidence: L (n - 1) s / R; here 60 * 0.5 * 0.1 / 6 mm of 0.83 mm."""
    system, lens = system_of(tmp_path), small_lens(rear=Conic())
    _, blur = blur_of(system, lens, backend, ToolOrder(ball=6.0))
    assert 0.1 * blur.pixels == pytest.approx(LENGTH * 0.5 * 0.1 / 6 / PIXEL, rel=1e-6)
    assert blur.heights * 0.01 == pytest.approx(0.01 / 48, rel=1e-12)
    assert blur.unknown == 0
    assert blur.rms == pytest.approx(blur.worst()[0])
    _, turned = blur_of(system, lens, backend, ToolOrder(nose=2.0))
    assert turned.pixels == pytest.approx(LENGTH * 0.5 / 2 / PIXEL, rel=1e-6)


def test_a_front_blurs_by_the_way_through_glass_and_air(tmp_path, backend):
    """A ray that the front turns by (n - 1) / n goes T in glass, and n times steeper L in air."""
    system, lens = system_of(tmp_path), small_lens(rear=Conic())
    _, blur = blur_of(system, lens, backend, ToolOrder(ball=6.0), "front")
    turned = 0.5 / 1.5 * (6 + 1.5 * LENGTH)
    assert blur.pixels == pytest.approx(turned / 6 / PIXEL, rel=1e-6)


@pytest.mark.parametrize("rows", ["x", "y"])
def test_the_exact_trace_of_the_cusps_spreads_light_by_the_blur(tmp_path, backend, rows):
    """Slopes at both sides of a cusp send a ray to both ends of its blur, to second order in the slope."""
    system, lens, step = system_of(tmp_path), bowl_lens(), 0.05
    order = ToolOrder(ball=8.0, rows=rows)
    response, blur = blur_of(system, lens, backend, order, rays=25)
    cusps = ball_cusps(air_side(lens, "rear"), response.x, response.y, 8.0, step, rows)
    path, rays = system.with_lens(lens).path, system.source.rays((25, 25))
    paths = (path.with_slope_errors((None, sign * cusps.slopes / 2)) for sign in (-1.0, 1.0))
    ends = [traced_points(erring, backend, rays)[0] for erring in paths]
    spread = np.hypot(*(ends[1] - ends[0])) / PIXEL
    assert spread == pytest.approx(step * blur.pixels, rel=1e-3)


def test_scallops_at_every_ray_move_light_within_the_blur_and_fill_it(tmp_path, backend):
    """The slope of a pass is q (y - row), so that landing points spread evenly over J w."""
    system, lens, step = system_of(tmp_path), bowl_lens(), 0.05
    order = ToolOrder(ball=8.0)
    response, blur = blur_of(system, lens, backend, order, rays=129)
    cusps = ball_cusps(air_side(lens, "rear"), response.x, response.y, 8.0, step, "x")
    phase = response.y / step - np.round(response.y / step)
    path, rays = system.with_lens(lens).path, system.source.rays((129, 129))
    smooth, _ = traced_points(path, backend, rays)
    rough, _ = traced_points(path.with_slope_errors((None, phase * cusps.slopes)), backend, rays)
    moved = np.hypot(*(rough - smooth)) / PIXEL / (step * blur.pixels)
    assert moved.max() <= 0.5 * (1 + 1e-3)
    assert moved.max() > 0.49
    # evenly spread over a whole width: rms 1 / sqrt(12); 16641 rays, whose phases are no lattice of the rows
    assert np.sqrt((moved**2).mean()) == pytest.approx(12**-0.5, rel=0.02)


def test_the_picture_with_cusps_is_the_sharp_one_spread_by_the_blur(tmp_path, backend):
    """Behind a plane the square beam is spread in y over a width b: variances add up, a^2 / 3 + b^2 / 12."""
    system, lens, step = (
        system_of(tmp_path, {"target.half_width": [19.0, 19.0]}),
        small_lens(rear=Conic()),
        1.0,
    )
    pixel = 38 / 48  # the beam ends between two pixels
    width = LENGTH * 0.5 * step / 6

    def slopes(x, y):
        return ball_cusps(air_side(lens, "rear"), x, y, 6.0, step, "x").slopes

    light = light_with_cusps(system.with_lens(lens), backend, "rear", slopes, width / pixel)
    phases = max(4, int(np.ceil(2 * width / pixel)))  # finitely many leave 1 - 1 / phases^2 of the variance
    spread = width**2 / 12 * (1 - 1 / phases**2)
    at = (2 * np.arange(48) + 1) / 48 * 19 - 19
    # pixels take h^2 / 12 from the variance of an even beam, and give as much to one that fades (Sheppard)
    for axis, added in ((0, -(pixel**2) / 12), (1, spread + pixel**2 / 12)):
        profile = light.picture.sum(axis=axis)
        variance = profile @ at**2 / profile.sum()
        assert variance == pytest.approx(9.5**2 / 3 + added, rel=1e-3)
    assert light.without != light.with_cusps


@pytest.mark.every(2)
@pytest.mark.parametrize("spectrum", [{}, {"lens.material": "PC", "source.spectrum": "LED-B3"}])
def test_without_cusps_rel_l2_is_that_of_the_far_field_in_all_colours(tmp_path, backend, spectrum):
    system = system_of(tmp_path, WIDE | spectrum)
    light = light_with_cusps(system, backend, "rear", lambda x, y: 0 * np.stack([x, y]), 0.1)
    measured = measure(system, backend).metrics["rel_l2_sequential"]
    # both count cells, though not as many; irradiances would be 0.03 off, a single wavelength 0.01
    assert light.without == pytest.approx(measured, rel=1e-4)
    assert light.with_cusps == pytest.approx(light.without, rel=1e-9)


def test_the_picture_of_an_extended_source_is_not_told(tmp_path, backend):
    changes = {"source.kind": "lambertian", "source.half_width": [0.5, 0.5], "source.distance": 20.0}
    system = system_of(tmp_path, changes)
    assert light_with_cusps(system.with_lens(bowl_lens()), backend, "rear", lambda x, y: x, 1.0) is None


def test_where_the_tool_does_not_fit_the_blur_is_left_out_and_counted(tmp_path, backend):
    system, lens = system_of(tmp_path), bowl_lens(0.1)
    _, blur = blur_of(system, lens, backend, ToolOrder(ball=12.0), rays=33)
    assert 0 < blur.unknown < 1
    assert np.isfinite(blur.worst()[0])
    assert np.isfinite(blur.rms)


def test_an_extended_source_has_rays_all_over_the_surface(tmp_path, backend):
    changes = {"source.kind": "lambertian", "source.half_width": [0.5, 0.5], "source.distance": 20.0}
    system = system_of(tmp_path, changes)
    response, blur = blur_of(system, bowl_lens(), backend, ToolOrder(nose=1.0), rays=33)
    assert len(response.x) == len(blur.pixels) > 20
    assert (blur.pixels > 0).all()


def test_a_bent_front_without_a_sag_is_met_too(tmp_path, backend):
    """The tracer tells where rays meet a surface with a sag: one of zeros changes nothing."""
    changes = {"source.kind": "lambertian", "source.half_width": [0.5, 0.5], "source.distance": 20.0}
    lens = small_lens(front=Conic(-40.0), rear=Conic())
    response, blur = blur_of(system_of(tmp_path, changes), lens, backend, ToolOrder(ball=6.0), "front", 33)
    assert len(response.x) > 20
    assert (np.abs(response.x) <= 10).all()
    assert (blur.pixels > 0).all()
