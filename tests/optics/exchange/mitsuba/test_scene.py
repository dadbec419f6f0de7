"""Problems as Mitsuba scenes: the sources' flux and density, the camera's irradiance, and what is refused."""

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("mitsuba")

from optics.base.runtime import UserError
from optics.exchange.mitsuba.cameras import watching_camera
from optics.exchange.mitsuba.loading import load_mitsuba
from optics.exchange.mitsuba.mesh import LensMesh
from optics.exchange.mitsuba.scene import camera_irradiance, mitsuba_scene
from optics.light.analysis import ray_irradiance
from optics.light.tracing import TargetArea, trace_nonsequential
from optics.scene.problem import load_problem
from optics.scene.receivers import PixelWindow, Screen
from optics.scene.sources import single_rays
from optics.scene.system import System
from tests.optics.cases import picture, rough, target_z
from tests.optics.exchange.mitsuba.cases import exact_image
from tests.optics.scene.problem.cases import MIRROR, ROW, load_text
from thbcad.poses import Pose
from thbcad.surfaces import THBSurface

pytestmark = pytest.mark.usefixtures("mi")
SAMPLES = 1 << 17
TWO = """
title = "two beams"

[[source]]
name = "near"
kind = "collimated"
half_width = [4.0, 6.0]
position = [-4, 1, -5]

[[source]]
name = "oblique"
kind = "collimated"
half_width = [3.0, 3.0]
position = [5, -4, -12]
tilt = [3, -8, 0]
weight = 0.5

[lens]
index = 1.5
thickness = 6.0
front = { half_width = [14.0, 14.0] }
rear = { half_width = [14.0, 14.0], freeform = { spans = [4, 4], max_level = 1, z_freedom = 1.0 } }

[target]
kind = "tophat"
distance = 40.0
half_width = [20.0, 20.0]
pixels = [32, 32]
"""
STRETCHED = {"source.half_width": [6.0, 9.0], "source.flux": 0.7}
NEAR = {"source.kind": "lambertian", "source.half_angle": 90.0, "source.distance": 4.0}
POINT = {"source.kind": "point", "source.half_width": [0.0, 0.0], "source.distance": 30.0, "source.flux": 0.7}


@pytest.fixture
def make(problem_file, tmp_path):
    """A function that returns (system, lens) of the small problem with changes; the rear has a sag without
    symmetry."""

    def build(changes):
        Image.fromarray(picture(24, 16)).save(tmp_path / "source.png")
        system = System(load_problem(problem_file(changes)))
        sags = [THBSurface(sag.space, rough(sag.space, 0.3)) for sag in system.base.sags]
        return system, system.base.with_sags(sags)

    return build


def emitted(mi, scene):
    """Return origins and directions, (3, n), and fluxes, (n,), whose mean is the source's, of rays that the
    emitter sends out."""
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(1, SAMPLES)
    emitter = next(e for e in scene.emitters())
    ray, weight = emitter.sample_ray(mi.Float(0), sampler.next_1d(), sampler.next_2d(), sampler.next_2d())
    return np.array(ray.o), np.array(ray.d), np.broadcast_to(np.array(weight).ravel(), SAMPLES).astype(float)


def assert_same_light(image, exact, size):
    """Assert that an image is the exact one within 3 % in blocks of size x size pixels, and not turned."""
    assert image.shape == exact.shape
    found, wanted = (a.reshape(len(a) // size, size, -1, size).mean((1, 3)) for a in (image, exact))
    assert np.linalg.norm(found - wanted) < 0.03 * np.linalg.norm(wanted)
    for turned in (found[:, ::-1], found[::-1], found[::-1, ::-1]):
        assert np.linalg.norm(turned - wanted) > 0.1 * np.linalg.norm(wanted)


@pytest.mark.parametrize("profile", ["uniform", "round", "gaussian", "image"])
@pytest.mark.parametrize("kind", ["collimated", "lambertian"])
def test_sources_have_the_flux_and_the_density_of_the_problem(mi, make, kind, profile):
    """In each of 8 x 8 cells a share q of n samples errs by sqrt(q / n), four times which is allowed; the
    picture has no symmetry."""
    picture_of = {"source.image": "source.png"} if profile == "image" else {}
    system, lens = make({"source.kind": kind, "source.profile": profile, **STRETCHED, **picture_of})
    scene = mitsuba_scene(system, LensMesh.uniform(lens, (5, 5)))
    origin, direction, flux = emitted(mi, scene)
    spread = flux.std() / np.sqrt(SAMPLES)
    assert flux.mean() == pytest.approx(0.7, abs=4 * spread + 1e-6)
    assert (origin[2] < 0).all()
    if kind == "collimated":
        assert (direction[2] == 1).all()
    else:
        assert direction[2].mean() == pytest.approx(2 / 3, abs=4 * 0.24 / np.sqrt(SAMPLES))  # Lambert's law
    share, _, _ = np.histogram2d(
        origin[0] / 6, origin[1] / 9, bins=8, range=[[-1, 1]] * 2, weights=flux / flux.sum()
    )
    middles = (2 * np.arange(960) + 1) / 960 - 1
    wanted = np.broadcast_to(system.source.profile(middles[:, None], middles[None, :]), (960, 960))
    wanted = wanted.reshape(8, 120, 8, 120).sum((1, 3)) / wanted.sum()
    unequal = np.max(flux) / np.mean(flux)  # of the samples' weights
    assert (np.abs(share - wanted) < 4.5 * np.sqrt(wanted * unequal / SAMPLES) + 1e-4).all()


@pytest.mark.parametrize(("half_angle", "share"), [(90.0, 0.5), (25.0, 1.0)])
def test_point_sources_light_their_cone_uniformly(mi, make, half_angle, share):
    """A wide one sends as much backwards, where nothing is; heights on the sphere are uniform
    (Archimedes)."""
    system, lens = make({"source.half_angle": half_angle, **POINT})
    scene = mitsuba_scene(system, LensMesh.uniform(lens, (5, 5)))
    origin, direction, flux = emitted(mi, scene)
    forward = direction[2] > 0
    assert flux[0] * share == pytest.approx(0.7, rel=1e-6)
    assert np.ptp(flux) == 0
    np.testing.assert_allclose(origin[:, 0], [0, 0, -30], atol=1e-5)
    low = np.cos(np.radians(half_angle))
    heights = (direction[2, forward] - low) / (1 - low)
    assert heights.min() > -1e-5
    assert heights.mean() == pytest.approx(0.5, abs=4 * 0.29 / np.sqrt(forward.sum()))


def test_the_camera_sees_the_irradiance_the_right_way_round(make, backend):
    """6 x 6 blocks of 8 x 8 pixels with 256 paths each: noise of about 1 %; light that is reflected twice in
    the lens adds as much."""
    system, lens = make({})
    image = camera_irradiance(mitsuba_scene(system, LensMesh.uniform(lens, (65, 65))), spp=256)
    exact = exact_image(backend, system, lens, (301, 301), PixelWindow())
    assert_same_light(image, exact, 8)


@pytest.mark.slow
@pytest.mark.parametrize(
    "changes",
    [{}, {**NEAR, "lens.outline": "ellipse"}, {**NEAR, "lens.outline": "ellipse", "lens.wall": "absorbing"}],
    ids=["rectangle", "ellipse", "absorbing wall"],
)
def test_the_total_flux_is_that_of_the_nonsequential_tracer(make, backend, changes):
    """Eight pictures give the mean and its standard error; the other tracer follows every reflection too, of
    n rays whose flux errs by less than the share 1 / sqrt(n)."""
    system, lens = make({"source.half_width": [8.0, 9.0], **changes})
    scene = mitsuba_scene(system, LensMesh.uniform(lens, (65, 65)))
    area = system.target.screen().pixel_area
    fluxes = [camera_irradiance(scene, spp=128, seed=k).sum() * area for k in range(8)]
    rays = single_rays(system.source.rays((101, 101) if not changes else (512, 512)), lens)
    plane = TargetArea.of(system.with_lens(lens).path, system.problem.target.half_width)
    result = trace_nonsequential(backend, lens, rays, plane)
    onto = (abs(result.landings.points) <= system.problem.target.half_width).all(axis=1)
    error = np.std(fluxes, ddof=1) / np.sqrt(8)
    assert error < 1e-3
    wanted = result.landings.flux[onto].sum()
    if changes:  # rays at random
        error = np.hypot(error, wanted / np.sqrt(onto.sum()))
    assert abs(np.mean(fluxes) - wanted) < 4.5 * error  # p < 0.003 for eight


@pytest.mark.slow
@pytest.mark.parametrize("text", [ROW, TWO], ids=["lens and mirror", "two beams on a lens"])
def test_elements_and_sources_anywhere_make_our_light(tmp_path, backend, text):
    """8 x 8 blocks of 4 x 4 pixels: noise of about 1 %; ours has no light that is reflected twice."""
    system = System(load_text(tmp_path, text))
    lens = system.base
    lens = lens.with_sags([THBSurface(sag.space, rough(sag.space, 0.15)) for sag in lens.sags])
    image = camera_irradiance(mitsuba_scene(system, LensMesh.uniform(lens, (65, 65))), spp=256)
    exact, _ = ray_irradiance(system, system.with_lens(lens).path, system.target.screen(), backend)
    assert_same_light(image, exact.irradiance, 4)


def test_no_body_stands_between_the_camera_and_the_screen(mi):
    """Points at random, of which a pinhole at `away` would see some before the screen were it farther off."""
    screen, pose = Screen((20.0, 10.0), (40, 20)), Pose.tilted((5.0, -3.0, 40.0), (30.0, -50.0, 70.0))
    rng = np.random.default_rng(3)
    for _ in range(50):
        own = rng.uniform([[-40], [-40], [-60]], [[40], [40], [20]], (3, 30))
        to_world = watching_camera(mi, screen, pose, pose.points(own))["to_world"]
        x, y, z = pose.inverse().points(np.array(to_world.matrix)[:3, 3])
        assert z < 0
        assert max(abs(x), abs(y)) < 1e-4
        share = (own[2] - z) / -z  # of the pyramid's width at a point: 0 at the pinhole, 1 on the screen
        within = (np.abs(own[0]) < 20 * share) & (np.abs(own[1]) < 10 * share) & (own[2] < 0)
        assert not within.any()


def test_a_wide_target_is_seen_by_a_camera_near_to_it(make):
    system, lens = make({"target.half_width": [90.0, 60.0], "target.pixels": [48, 32]})
    scene = mitsuba_scene(system, LensMesh.uniform(lens, (9, 9)))
    place = np.array(scene.sensors()[0].world_transform().matrix).reshape(4, 4)[:3, 3]
    assert lens.thickness + lens.rear(10, 10) < place[2] < target_z(system.problem)
    assert camera_irradiance(scene, spp=4).shape == (32, 48)


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"target.distance": np.inf}, "target.distance"),
        ({"source.kind": "lambertian", "source.half_angle": 40.0}, "source.half_angle"),
        ({**POINT, "source.exponent": 2.0}, "source.exponent"),
        ({"target.pixels": [48, 40]}, "target.pixels"),
        ({"lens.rear.slope_rms": 0.01}, "slope_rms"),
        ({"lens.front.reflectance": 0.1}, "reflectance"),
    ],
)
def test_what_mitsuba_cannot_express_is_refused_by_its_key(make, changes, key):
    system, lens = make(changes)
    with pytest.raises(UserError, match=key):
        mitsuba_scene(system, LensMesh.uniform(lens, (5, 5)))


def test_a_curved_screen_is_refused(tmp_path):
    curved = MIRROR.replace("[target]", '[target]\nsurface = "cylinder"\nradius = 90.0')
    system = System(load_text(tmp_path, curved))
    with pytest.raises(UserError, match=r"target\.surface"):
        mitsuba_scene(system, LensMesh.uniform(system.base, (5, 5)))


def test_the_camera_refuses_spectra(make):
    load_mitsuba("llvm_ad_rgb", threads=1)
    system, lens = make({})
    with pytest.raises(UserError, match="llvm_ad_mono only, got llvm_ad_rgb"):
        camera_irradiance(mitsuba_scene(system, LensMesh.uniform(lens, (5, 5))), spp=1)
