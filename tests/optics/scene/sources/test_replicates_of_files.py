"""Independent sets of a ray file's rays: no two hold the same ray, wherever the light of the file stands."""

import numpy as np
import pytest

import optics
from optics.light.analysis import measure
from optics.scene.problem import SourceArray
from optics.scene.ray_files import RaySet, write_rays
from optics.scene.sources import Profile, Rays, lambertian_parts
from optics.scene.system import source_of

PLACES = {
    "lone": {"distance": 5.0},
    "position": {"position": (0.5, 0.0, -5.0)},
    "array": {"distance": 5.0, "array": SourceArray(columns=2, rows=1, pitch=(1.0, 1.0))},
}
SETS = 8


def problem(folder, keys, count, power=0.0):
    """A slab before a target, lit by `count` rays of a file, whose flux is uneven by a power."""
    (rays,) = lambertian_parts((0.5, 0.5), 0.0, 1.0, 60.0, Profile(), count, 3, 1 << 30)
    uneven = np.random.default_rng(5).exponential(size=count) ** power
    write_rays(RaySet(rays.origin.T, rays.direction.T, uneven), folder / "lamp.tm25ray")
    faces = {"front": {"half_width": (8, 8)}, "rear": {"half_width": (8, 8), "freeform": {"spans": (2, 2)}}}
    return optics.Problem(
        source={"kind": "rays", "file": str(folder / "lamp.tm25ray")} | keys,
        lens={"index": 1.5, "thickness": 4, **faces},
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
        system = optics.System(problem(tmp_path, keys, 4096)).optical
        floors[place] = measure(system, system.lens, system.backend).metrics["rel_l2_floor"]
    assert floors["lone"] > 0.1
    assert floors["position"] == pytest.approx(floors["lone"], rel=0.2)
    assert floors["array"] == pytest.approx(floors["lone"], rel=0.3)
