"""Of symmetric light one half of the rays makes the same image, with an error that counts pixels in pairs."""

from dataclasses import replace

import numpy as np
import pytest

from optics.light.analysis import measure, nonsequential_light, ray_irradiance
from optics.light.measuring import Mirrors, light_axes
from optics.scene.receivers import with_mirror_images
from optics.scene.system import Own
from tests.optics.cases import DOME, rough, small_system
from thbcad.surfaces import THBSurface

BOTH = (0, 1)


def symmetric_lens(system, axes=BOTH, height=0.3):
    """Return the lens with rough sags that are their own mirror images in some directions."""
    spaces = [sag.space for sag in system.base.sags]
    nets = [Mirrors(space, axes).of_coefficients(rough(space, height)) for space in spaces]
    return system.base.with_sags([THBSurface(*pair) for pair in zip(spaces, nets)])


def system_of(folder, changes=()):
    return small_system(folder, DOME | {"target.pixels": [24, 18]} | dict(changes))


@pytest.mark.parametrize("axes", [(), (0,), (1,), BOTH], ids=str)
def test_a_lens_is_symmetric_where_all_of_its_coefficients_are(tmp_path, axes):
    system = system_of(tmp_path)
    lens = symmetric_lens(system, axes)
    assert light_axes(system.with_lens(lens)) == axes
    (sag,) = lens.sags
    moved = sag.coefficients.copy()
    moved[0] = np.nextafter(moved[0], 1)
    assert light_axes(system.with_lens(lens.with_sags([THBSurface(sag.space, moved)]))) == ()


@pytest.mark.parametrize(
    "changes",
    [
        {"lens.rear.slope_rms": 0.01},  # drawn by chance
        {
            "lens.array.columns": 2,
            "lens.array.rows": 1,
            "lens.array.pitch": [20.0],
            "lens.front.half_width": [8.0, 8.0],
        },
        {"lens.body.annulus": True},
        {"source.kind": "point", "source.half_angle": 60.0},  # its rays come without mirror images
        {"target.tilt": [4.0, 3.0, 0.0]},
    ],
    ids=lambda changes: min(changes),
)
def test_light_that_may_differ_from_its_mirror_image_is_traced_whole(tmp_path, changes):
    system = system_of(tmp_path, changes)
    assert light_axes(system.with_lens(symmetric_lens(system))) == ()


def test_what_a_script_brings_is_traced_whole(tmp_path):
    system = system_of(tmp_path)
    for own in (Own(source=system.source), Own(receiver=system.target.receiver)):
        scripted = replace(system, own=own)
        assert light_axes(scripted.with_lens(symmetric_lens(scripted))) == ()


@pytest.mark.parametrize("axes", [(0,), (1,), BOTH], ids=str)
def test_half_of_the_rays_makes_the_image_of_all(tmp_path, backend, axes):
    system = system_of(tmp_path)
    lens, screen = symmetric_lens(system), system.target.screen()
    whole, half = (
        ray_irradiance(system, system.with_lens(lens).path, screen, backend, 1 << 17, chosen)
        for chosen in ((), axes)
    )
    scale = whole[0].irradiance.max()
    for name in ("irradiance", "error"):
        np.testing.assert_allclose(getattr(half[0], name), getattr(whole[0], name), rtol=0, atol=1e-9 * scale)
    assert (half[0].on_target, half[0].off_target) == pytest.approx(
        (whole[0].on_target, whole[0].off_target), rel=1e-12
    )
    assert half[1].by_name == pytest.approx(whole[1].by_name, rel=1e-12)


@pytest.mark.slow
def test_a_measurement_is_that_of_all_rays(tmp_path, backend, monkeypatch):
    """But for the roulette of light by other ways, whose branches are drawn."""
    system = system_of(tmp_path)
    lens = symmetric_lens(system)
    monkeypatch.setattr(
        "optics.light.analysis.metrics._more_rays", lambda *_: 1.0
    )  # noise would ask for them
    half = measure(system.with_lens(lens), backend)
    for module in ("light_by_all_ways", "closed_lens_light"):
        monkeypatch.setattr(f"optics.light.analysis.{module}.light_axes", lambda *_: ())
    whole = measure(system.with_lens(lens), backend)
    for name in ("rel_l2_sequential", "rays", "fates_w"):
        assert half.metrics[name] == pytest.approx(whole.metrics[name], rel=1e-9), name
    errors = [m.metrics["rel_l2_error"] for m in (half, whole)]
    away = half.metrics["rel_l2_debiased"] - whole.metrics["rel_l2_debiased"]
    assert abs(away) < 4 * np.hypot(*errors)
    np.testing.assert_allclose(half.irradiance, with_mirror_images(half.irradiance, BOTH) / 4, rtol=1e-12)


@pytest.mark.slow
def test_light_by_other_ways_is_that_of_all_rays(tmp_path, backend, monkeypatch):
    system = system_of(tmp_path)
    lens, screen = symmetric_lens(system), system.target.screen()
    half = nonsequential_light(system.with_lens(lens), screen, backend)
    monkeypatch.setattr("optics.light.analysis.closed_lens_light.light_axes", lambda *_: ())
    whole = nonsequential_light(system.with_lens(lens), screen, backend)
    away = half.light.irradiance - whole.light.irradiance
    error = np.hypot(half.light.error, whole.light.error)
    assert np.linalg.norm(away) < 1.5 * np.linalg.norm(error)
    assert half.share == pytest.approx(whole.share, rel=0.02)
    assert half.onto_rear.flux.sum() == pytest.approx(whole.onto_rear.flux.sum(), rel=0.01)
    assert half.onto_rear.flux.size < 0.3 * whole.onto_rear.flux.size
