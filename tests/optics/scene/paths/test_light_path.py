"""A path is a value: maps that change nothing give it back, and the tracer follows every one of its parts."""

import numpy as np
import pytest

from optics.light.tracing import Tracer
from optics.scene.paths import AIR, LightPath, Medium, Surface
from optics.scene.receivers import FarField, Plane, receiver_at
from optics.scene.sources import point_rays
from tests.optics.cases import TARGET_Z, small_lens, small_system, target_z
from thbcad import Conic, Pose

LENS = small_lens(Conic(60.0))
TILT = np.zeros((2, 1))


class Bump:
    """An error of the height, 1e-3 mm everywhere."""

    def jet(self, x, y):
        return np.repeat([[1e-3], [0.0], [0.0]], len(x), axis=1)


@pytest.fixture
def path():
    return LightPath.through(LENS, receiver_at(TARGET_Z), 0.01)


def landed(backend, path, rays):
    """x, y and flux on the receiver, (3, n), of rays that arrive; NaN of others."""
    with backend.dr.suspend_grad():
        _, landing = Tracer(backend, path, rays).trace()
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
        path.in_media(path.media),
        path.with_slope_errors((None, None)),
        path.with_height_errors((None, None)),
        path.moved([Pose.at()] * 3),
        path.seen_from(Pose.at()),
        path.with_soft_rims(0.0),
    ):
        assert same is path


def changed(path, other):
    """Return what differs between two paths: names, of surfaces with their numbers."""
    names = {
        name for name in ("media", "receiver", "share", "soft_rim") if vars(path)[name] != vars(other)[name]
    }
    for k, (a, b) in enumerate(zip(path.surfaces, other.surfaces)):
        names |= {f"{name} {k}" for name in vars(a) if vars(a)[name] is not vars(b)[name]}
    return names


def test_every_map_changes_one_thing_and_takes_it_back(path):
    shift, bump = Pose.at((0.1, 0, 0)), Bump()
    maps = {
        ("receiver",): (lambda p: p.onto(FarField()), lambda p: p.onto(path.receiver)),
        ("media",): (lambda p: p.in_media((AIR, Medium(1.7), AIR)), lambda p: p.in_media(path.media)),
        ("share 0", "share 1"): (lambda p: p.without_reflection(), None),
        ("slope_error 1",): (
            lambda p: p.with_slope_errors((None, TILT)),
            lambda p: p.with_slope_errors((None, None)),
        ),
        ("height_error 0",): (
            lambda p: p.with_height_errors((bump, None)),
            lambda p: p.with_height_errors((None, None)),
        ),
        ("pose 1",): (lambda p: p.moved([Pose.at(), shift, Pose.at()]), None),
        ("soft_rim",): (lambda p: p.with_soft_rims(0.05), lambda p: p.with_soft_rims(0.0)),
    }
    for names, (there, back) in maps.items():
        assert changed(path, there(path)) == set(names)
        assert back is None or changed(path, back(there(path))) == set()


def test_absorption_is_left_out_alone(path):
    assert path.without_absorption().media == (AIR, Medium(LENS.index), AIR)
    assert changed(path, path.without_absorption()) == {"media"}


def test_errors_are_given_for_every_surface(path):
    for wrong in ((), (None,), (None, None, None)):
        with pytest.raises(ValueError, match="one slope_error for each surface, got"):
            path.with_slope_errors(wrong)


def test_a_path_that_is_none_is_refused():
    surface, mirror = Surface(LENS.front), Surface(LENS.front, kind="reflect")
    glass = Medium(1.5)
    with pytest.raises(ValueError, match="1 surfaces lie between 2 media, got 1"):
        LightPath((surface,), (AIR,), FarField())
    with pytest.raises(ValueError, match="the medium before the receiver must be clear"):
        LightPath((surface,), (AIR, Medium(1.5, 0.01)), FarField())
    with pytest.raises(ValueError, match=r"surface 0 reflects light, but from .* into"):
        LightPath((mirror,), (AIR, glass), FarField())
    for share in (-0.1, 1.1, float("nan")):
        with pytest.raises(ValueError, match="a share of light lies from 0 to 1"):
            LightPath((surface,), (AIR, glass), FarField(), share)
        with pytest.raises(ValueError, match="a share of light lies from 0 to 1"):
            LightPath((Surface(LENS.front, share=share),), (AIR, glass), FarField())


def test_the_path_of_a_system_absorbs_what_its_lens_does(tmp_path):
    system = small_system(tmp_path, {"lens.absorption": 0.02})
    path = system.path
    assert [medium.absorption for medium in path.media] == [0.0, 0.02, 0.0]
    assert [medium.index for medium in path.media] == [1.0, system.base.index, 1.0]
    assert [surface.shape for surface in path.surfaces] == [system.base.front, system.base.rear]
    assert path.receiver.pose.shift[2] == target_z(system.problem)


def test_a_path_and_all_light_seen_from_elsewhere_lands_the_same(backend, path):
    """Rays, surfaces and receiver as another body sees them."""
    pose = Pose.at((30.0, -20.0, 10.0), (0.3, -0.7, 2.0))
    here = landed(backend, path, cone())
    there = landed(backend, path.seen_from(pose), cone().posed(pose.inverse()))
    assert np.isfinite(here[2]).sum() > 100
    np.testing.assert_allclose(there, here, rtol=0, atol=1e-10)


def test_a_share_of_the_source_takes_a_path(backend, path):
    half = LightPath(path.surfaces, path.media, path.receiver, 0.5)
    whole = [landed(backend, p, cone()) for p in (path, half)]
    np.testing.assert_array_equal(whole[1][:2], whole[0][:2])
    np.testing.assert_allclose(whole[1][2], whole[0][2] / 2, rtol=1e-15)


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


def test_light_from_behind_a_receiver_does_not_arrive_and_is_accounted_for(backend, path):
    """A receiver that is turned round: everything that leaves the lens is beside the target."""
    backward = Plane(Pose.at((0.0, 0.0, TARGET_Z), (0.0, np.pi, 0.0)))
    tracer = Tracer(backend, path.onto(backward), cone())
    with backend.dr.suspend_grad():
        _, landing = tracer.trace()
    fates = tracer.fates(landing, (1e3, 1e3))
    assert fates.on_target == 0
    assert fates.off_target > 0.5
    assert not landing.arrives.numpy().any()
    assert fates.total == pytest.approx(cone().total, rel=1e-12)


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
