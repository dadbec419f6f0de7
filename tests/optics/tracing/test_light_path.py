"""A path is a value: maps that change nothing give it back, and the tracer follows every one of its parts."""

import numpy as np
import pytest

from optics.problem import load_problem
from optics.receivers import FarField, Plane, receiver_at
from optics.sources import point_rays
from optics.system import OpticalSystem
from optics.tracing import SMOOTH, LightPath, SlopeErrors, Tracer
from tests.optics.cases import TARGET_Z, coefficients, small_lens, write_problem
from thbcad import Conic, Pose

LENS = small_lens(Conic(60.0))


class Bump:
    """An error of the height, 1e-3 mm everywhere."""

    def jet(self, x, y):
        return np.repeat([[1e-3], [0.0], [0.0]], len(x), axis=1)


@pytest.fixture
def path():
    return LightPath(LENS, receiver_at(TARGET_Z), 0.01)


def landed(backend, path, rays):
    """x, y and flux on the receiver, (3, n), of rays that arrive; NaN of others."""
    with backend.dr.suspend_grad():
        _, landing = Tracer(backend, path, rays).trace(coefficients(path.lens))
    flux = landing.flux.numpy()
    return np.where(flux > 0, [landing.x.numpy(), landing.y.numpy(), flux], np.nan)


def cone():
    return point_rays(
        distance=80.0, flux=1.0, half_angle=5.0, exponent=0.0, counts=(21, 21), shift=(0.0, 0.0)
    )


def test_maps_of_nothing_return_the_path_itself(path):
    clear = path.without_absorption().without_reflection()
    assert clear.without_absorption() is clear.without_reflection() is clear
    for same in (
        path.onto(path.receiver),
        path.with_slope_errors(SMOOTH),
        path.with_height_errors(None, None),
        path.with_front_at(Pose.at()),
        path.with_soft_rims(0.0),
    ):
        assert same is path


def test_a_map_of_nothing_takes_back_what_was_there(path):
    errors = SlopeErrors(rear=np.zeros((2, 1)))
    assert path.with_slope_errors(errors).with_slope_errors(SMOOTH).slope_errors is SMOOTH
    assert path.with_height_errors(None, Bump()).with_height_errors(None, None).height_errors == (None, None)
    assert path.with_front_at(Pose.at((0.1, 0, 0))).with_front_at(Pose.at()).front.is_identity
    assert path.with_soft_rims(0.05).with_soft_rims(0.0).soft_rim == 0


def test_every_map_changes_one_thing(path):
    errors, bump, pose = SlopeErrors(rear=np.zeros((2, 1))), Bump(), Pose.at((0.1, 0, 0))
    changed = {
        "receiver": path.onto(FarField()),
        "absorption": path.without_absorption(),
        "reflection": path.without_reflection(),
        "slope_errors": path.with_slope_errors(errors),
        "height_errors": path.with_height_errors(None, bump),
        "front": path.with_front_at(pose),
        "soft_rim": path.with_soft_rims(0.05),
    }
    for name, other in changed.items():
        assert [key for key, value in vars(path).items() if vars(other)[key] is not value] == [name]


def test_the_path_of_a_system_absorbs_what_its_lens_does(tmp_path):
    system = OpticalSystem(load_problem(write_problem(tmp_path, {"lens.absorption": 0.02})))
    path = system.path(system.lens)
    assert path.absorption == 0.02
    assert path.lens is system.lens
    assert path.receiver.pose.shift[2] == system.target.z


def test_a_tilted_receiver_is_met_where_the_ray_meets_its_plane(backend, path):
    """From the landing on an upright plane and the direction there, by vectors."""
    pose = Pose.at((3.0, -2.0, TARGET_Z + 5), (0.3, -0.2, 0.5))
    near, far = (landed(backend, path.onto(receiver_at(z)), cone())[:2] for z in (TARGET_Z, TARGET_Z + 20))
    start = np.vstack([near, np.full(near.shape[1], TARGET_Z)])
    way = np.vstack([far - near, np.full(near.shape[1], 20.0)])
    normal = pose.rotation[:, 2]
    t = (normal @ (pose.shift[:, None] - start)) / (normal @ way)
    wanted = pose.inverse().points(start + t * way)
    found = landed(backend, path.onto(Plane(pose)), cone())
    assert np.nanmax(np.abs(found[:2] - wanted[:2])) < 1e-11
    assert np.nanmax(np.abs(wanted[2])) < 1e-11
    assert np.isfinite(found[2]).sum() > 100


def test_what_is_left_out_is_what_is_not_lost(backend, path):
    """Absorption takes exp(-a t) of every ray, with paths t through the lens between 4 and 9 mm."""
    every, clear, ideal = (
        landed(backend, p, cone())[2]
        for p in (path, path.without_absorption(), path.without_absorption().without_reflection())
    )
    left = every / clear
    assert np.nanmax(left) < np.exp(-0.01 * 4)
    assert np.nanmin(left) > np.exp(-0.01 * 9)
    assert np.nanmin(ideal) == pytest.approx(np.nanmax(cone().flux), rel=1e-12)
    assert np.nanmax(clear / ideal) < 0.93
