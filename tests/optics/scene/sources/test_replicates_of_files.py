"""Independent sets of a ray file's rays: no two hold the same ray, wherever the light of the file stands."""

from dataclasses import replace

import numpy as np
import pytest

import optics
from optics.light.analysis import measure, nonsequential_light
from optics.scene.problem import SourceArray
from optics.scene.ray_files import RaySet, write_rays
from optics.scene.sources import Rays
from optics.scene.system import source_of
from thbcad.poses import Pose

PLACES = {
    "lone": {"distance": 5.0},
    "position": {"position": (0.5, 0.0, -5.0)},
    "array": {"distance": 5.0, "array": SourceArray(columns=2, rows=1, pitch=(1.0, 1.0))},
}
SETS = 8


def problem(folder, keys, count, power=0.0, seed=3, radius=np.inf):
    """A lens before a target, lit by random rays of a Lambertian square, whose flux is uneven by a power."""
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(-0.5, 0.5, (2, count))
    square, turn = 0.75 * rng.random(count), rng.uniform(0, 2 * np.pi, count)  # as far as 60 degrees
    sine = np.sqrt(square)
    direction = np.stack([sine * np.cos(turn), sine * np.sin(turn), np.sqrt(1 - square)], axis=1)
    origin = np.stack([x, y, np.zeros(count)], axis=1)
    write_rays(RaySet(origin, direction, rng.exponential(size=count) ** power), folder / "lamp.tm25ray")
    rear = {"half_width": (8, 8), "radius": radius, "freeform": {"spans": (2, 2)}}
    return optics.Problem(
        source={"kind": "rays", "file": str(folder / "lamp.tm25ray")} | keys,
        lens={"index": 1.5, "thickness": 4, "front": {"half_width": (8, 8)}, "rear": rear},
        target={"kind": "tophat", "distance": 20, "half_width": (30, 30), "pixels": (12, 12)},
    )


@pytest.mark.parametrize("side", [4, 16], ids=["few", "more than the file has"])
@pytest.mark.parametrize("place", PLACES)
def test_no_ray_of_a_file_is_in_two_sets(tmp_path, place, side):
    """Bright rays neither, which stand for many of a sample."""
    source = source_of(problem(tmp_path, PLACES[place], 512, power=3.0))
    found = []
    for parts in source.replicates(SETS, (side, side), np.random.default_rng(1), 100):
        rays = Rays.joined(list(parts))
        assert rays.total == pytest.approx(source.flux, rel=1e-9)
        found.append({tuple(direction) for direction in rays.direction.T.round(9)})
    assert len(found) == SETS
    assert len(set.union(*found)) == sum(map(len, found))


def test_the_noise_of_a_file_is_told_wherever_its_light_stands(tmp_path):
    floors = {}
    for place, keys in PLACES.items():
        system = optics.System(problem(tmp_path, keys, 4096))
        metrics = measure(system, system.backend).metrics
        floors[place] = metrics["rel_l2_floor"]
        assert metrics["rays"] == metrics["rays_of_file"] == (8192 if place == "array" else 4096)
    assert floors["lone"] > 0.1
    assert floors["position"] == pytest.approx(floors["lone"], rel=0.2)
    assert floors["array"] == pytest.approx(floors["lone"], rel=0.3)


@pytest.mark.slow
@pytest.mark.parametrize("place", PLACES)
def test_the_noise_of_light_by_other_ways_is_that_of_files(tmp_path, place):
    """Of eight lenses, each lit by another file of the same lamp."""
    found = []
    for seed in range(8):
        system = optics.System(problem(tmp_path, PLACES[place], 2048, seed=seed, radius=15.0))
        other = nonsequential_light(system, system.target.screen(), system.backend)
        assert other.share > 0.1
        found.append(other.light)
    spread = np.sqrt(np.var([light.irradiance for light in found], axis=0, ddof=1).sum())
    told = np.sqrt(np.mean([light.error**2 for light in found], axis=0).sum())
    assert told == pytest.approx(spread, rel=0.25)


@pytest.mark.parametrize("place", PLACES)
def test_a_file_of_fewer_rays_than_parts_is_refused(tmp_path, place):
    with pytest.raises(optics.UserError, match=r"source\.file holds 7 rays, and 8 parts"):
        optics.System(problem(tmp_path, PLACES[place], 7))


def test_an_array_of_files_is_tilted_as_a_whole(tmp_path):
    """Its members stand where those of a Lambertian array do, which turn with it."""
    keys = {"distance": 20.0, "tilt": (10.0, 30.0, 20.0)}
    keys["array"] = SourceArray(columns=2, rows=1, pitch=(6.0, 1.0))
    of_files = problem(tmp_path, keys, 512)
    middle = np.array([0.0, 0.0, -20.0])
    lambertian = replace(of_files.source, kind="lambertian", file="", half_width=(0.5, 0.5))
    for case in (of_files, replace(of_files, source=lambertian)):
        poses = [member.pose for member in source_of(case).members]
        middles = np.array([pose.points(middle) for pose in poses])
        along = Pose.tilted((0.0, 0.0, 0.0), keys["tilt"]).directions(np.array([3.0, 0.0, 0.0]))
        np.testing.assert_allclose(middles, np.outer([-1, 1], along) + middle, atol=1e-12)
