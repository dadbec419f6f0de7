"""Rays of a file give the light of the source that they were taken from."""

import numpy as np
import pytest

import optics
from optics.scene.ray_files import RaySet, write_rays
from optics.scene.sources import PointSource, Profile, mirror_half
from tests.optics.cases import lambertian_parts, rough, small_problem

LAMP = {"source.kind": "lambertian", "source.half_width": [0.5, 0.4], "source.distance": 20.0}
COUNT = 1 << 18


@pytest.fixture(scope="module")
def lamp(tmp_path_factory):
    """A folder with the rays of LAMP, whose origin is the middle of the source."""
    folder = tmp_path_factory.mktemp("lamp")
    (rays,) = lambertian_parts((0.5, 0.4), 0.0, 5.0, 90.0, Profile(), COUNT, 11, 1 << 30)
    write_rays(RaySet(rays.origin.T, rays.direction.T, rays.flux), folder / "lamp.tm25ray")
    return folder


def of_file(folder, **more):
    keys = {"source.kind": "rays", "source.file": "lamp.tm25ray", "source.distance": 20.0}
    changes = keys | {"source.half_width": [0.0, 0.0]} | more
    return optics.System(small_problem(folder, changes))


def blocks(image, side=8):
    return image.reshape(image.shape[0] // side, side, -1, side).mean(axis=(1, 3))


@pytest.mark.slow
def test_a_file_of_a_lamp_lights_as_the_lamp(lamp, tmp_path):
    theirs = optics.System(small_problem(tmp_path, LAMP))
    ours = of_file(lamp)
    lens = theirs.base
    a, b = theirs.measure(lens), ours.measure(lens)
    assert b.metrics["estimator"] == "rays"
    assert b.metrics["efficiency"] == pytest.approx(
        a.metrics["efficiency"], rel=1.5e-2
    )  # 2 sigma of the file
    difference = np.linalg.norm(blocks(a.irradiance - b.irradiance)) / np.linalg.norm(blocks(a.irradiance))
    assert difference < 0.03
    assert sum(b.metrics["fates_w"].values()) == pytest.approx(1.0, rel=1e-12)
    noise = np.linalg.norm(a.irradiance / a.irradiance.mean() - b.irradiance / b.irradiance.mean())
    floors = np.hypot(*(m.metrics["rel_l2_floor"] for m in (a, b))) * np.linalg.norm(
        b.target / b.target.mean()
    )
    assert noise == pytest.approx(floors, rel=0.15)  # the floors say the noise of both


@pytest.mark.every(3)
@pytest.mark.parametrize(
    ("key", "angles", "axis"),
    [
        ("turn", [0.0, 0.0, 90.0], [0, 0, 1]),
        ("turn", [30.0, 0.0, 0.0], [0, -0.5, np.sqrt(0.75)]),  # about x: z towards -y
        ("turn", [0.0, 30.0, 0.0], [0.5, 0, np.sqrt(0.75)]),  # about y: z towards x
        ("turn", [30.0, 0.0, 90.0], [0.5, 0, np.sqrt(0.75)]),  # then about z: -y towards x
        ("tilt", [30.0, 0.0, 90.0], [0, -0.5, np.sqrt(0.75)]),  # then about its own z, along which it shines
        ("tilt", [30.0, 30.0, 0.0], [0.5, -0.5 * np.sqrt(0.75), 0.75]),  # about its own y, still across x
    ],
)
def test_a_file_is_turned_about_x_then_y_then_z_and_shifted(lamp, key, angles, axis):
    """By a turn about axes that stay, by a tilt about its own."""
    rays = of_file(lamp, **{f"source.{key}": angles, "source.shift": [3.0, -2.0]}).source.placed
    mean = (rays.direction * rays.flux).sum(axis=1)
    np.testing.assert_allclose(mean / np.linalg.norm(mean), axis, atol=2e-3)
    np.testing.assert_allclose(rays.origin.mean(axis=1), [3, -2, -20], atol=2e-3)


def test_the_gradient_through_rays_of_a_file_is_that_of_differences(lamp):
    system = of_file(lamp)
    space = system.space()
    model, c = system.model(space, (65, 65), "bspline"), rough(space, 0.03, 0)
    d = rough(space, 0.03, 1)
    value, gradient = model.loss(c)
    h = 1e-6
    steps = [model.loss(c + k * h * d)[0] for k in (-2, -1, 1, 2)]
    difference = (8 * (steps[2] - steps[1]) - (steps[3] - steps[0])) / (12 * h)
    assert gradient @ d == pytest.approx(difference, abs=1e-7 * abs(difference) + 1e-9 * value / h)


def test_a_point_stands_for_the_lamp_before_there_is_a_lens(lamp):
    point = of_file(lamp).source.without_extent()
    assert isinstance(point, PointSource)
    assert point.distance == pytest.approx(20.0, abs=0.05)
    assert point.half_angle > 80


def test_rays_that_start_in_the_lens_are_refused(lamp):
    problem = of_file(lamp).problem.with_(**{"source.distance": 0.01, "source.turn": [30.0, 0.0, 0.0]})
    with pytest.raises(optics.UserError, match=r"up to 0.1\d+ mm behind the front"):
        optics.System(problem)


def test_no_ray_of_a_file_is_left_out_where_nothing_is_mirrored():
    rays = next(lambertian_parts((0.5, 0.4), 1.0, 1.0, 90.0, Profile(), 64, 0, 64))
    odd = next(rays.slices(63))
    assert mirror_half(odd, ()) is odd
