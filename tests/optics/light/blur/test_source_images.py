"""The spread of light on the target, against closed forms of plane windows."""

from math import radians, sin, sqrt, tan

import numpy as np
import pytest

from optics.light.blur import patch_images, spot_rms
from tests.optics.cases import small_system

WINDOW = {
    "lens.rear.radius": np.inf,
    "lens.rear.conic": 0.0,
    "target.distance": 200.0,
    "lens.thickness": 0.01,
}


def spread(folder, backend, changes):
    system = small_system(folder, WINDOW | changes)
    return spot_rms(system, backend), system


def test_parallel_light_and_points_have_no_spread(tmp_path, backend):
    assert spread(tmp_path, backend, {})[0] == 0


@pytest.mark.parametrize("kind", ["uniform", "gaussian"])
def test_a_beam_spreads_by_its_angles_times_the_distance(tmp_path, backend, kind):
    """Uniform over solid angle within a: E[sin^2] = a^2 / 2 to second order, half of it in x."""
    angle = 0.2
    found, _ = spread(
        tmp_path,
        backend,
        {"source.divergence": angle, "source.divergence_profile": kind, "target.pixels": [20, 20]},
    )
    rms = radians(angle) / 2 if kind == "uniform" else radians(angle)
    assert found == pytest.approx(200 * rms, rel=3e-3)


@pytest.mark.parametrize("near", [40.0, 80.0])
def test_light_of_which_little_meets_the_lens_spreads_too(tmp_path, backend, near):
    """A square of side 2 h that shines into a half-space, through a thin window: h L / d / sqrt(3)."""
    half = 1.5
    changes = {
        "lens.front.half_width": [10.0, 10.0],
        "lens.rear.half_width": [10.0, 10.0],
        "source.kind": "lambertian",
        "source.half_width": [half, half],
        "source.distance": near,
        "source.flux": 1.0,
    }
    found, _ = spread(tmp_path, backend, changes)
    assert found == pytest.approx(half / sqrt(3) * 200 / near, rel=0.05)


@pytest.mark.slow
def test_an_area_spreads_as_its_shadow_through_a_pinhole(tmp_path, backend):
    """Through a point of a thin window a square of side 2 h at distance d is thrown h / sqrt(3) L / d wide.

    Light that goes steeply through the window lands 1 / cos further; the cone is narrow.
    """
    half, near, half_angle = 1.5, 40.0, 8.0
    changes = {
        "lens.front.half_width": [10.0, 10.0],
        "source.kind": "lambertian",
        "source.half_width": [half, half],
        "source.distance": near,
        "source.half_angle": half_angle,
        "source.flux": 1.0,
    }
    found, system = spread(tmp_path, backend, changes)
    assert sin(radians(half_angle)) * near < min(system.base.front.half_width)  # all light meets the window
    assert found == pytest.approx(half / sqrt(3) * 200 / near, rel=0.03)
    images = patch_images(system, backend)
    middle = len(images.flux) // 2
    assert images.width[:, middle, middle] == pytest.approx(2 * half * 200 / near, rel=0.03)
    assert tan(radians(half_angle)) < 0.2
