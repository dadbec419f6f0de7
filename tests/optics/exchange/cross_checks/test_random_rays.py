"""Random rays of every source: in its bounds, and distributed as the ray sets of the design are."""

import numpy as np
import pytest

from optics.exchange.cross_checks.random_rays import random_rays
from optics.scene.luminaires import write_ies
from optics.scene.sources import Rays, single_rays
from tests.optics.cases import small_system
from tests.optics.scene.luminaires.cases import asymmetric

POINT = {"source.kind": "point", "source.half_angle": 75.0, "source.distance": 4.0}
GLOWING = {"source.kind": "lambertian", "source.half_width": [0.5, 0.3], "source.distance": 4.0}
SOURCES = {
    "beam": {},
    "round beam": {"source.profile": "round"},
    "gaussian beam": {"source.profile": "gaussian", "source.sigma": [0.4, 2.0]},
    "round gaussian beam": {"source.profile": "round_gaussian", "source.sigma": [0.4, 2.0]},
    "round gaussian area": GLOWING | {"source.profile": "round_gaussian", "source.sigma": [0.4, 2.0]},
    "picture as a beam": {"source.profile": "image", "source.image": "picture.png"},
    "point": POINT,
    "half space": POINT | {"source.half_angle": 90.0, "source.exponent": 3.0},
    "area": GLOWING,
    "area in a cone": GLOWING | {"source.half_angle": 40.0, "source.profile": "gaussian"},
    "picture that glows": GLOWING | {"source.profile": "image", "source.image": "picture.png"},
    "area elsewhere": GLOWING
    | {"source.distance": 2.0, "source.position": [2.0, 1.0, -7.0], "source.tilt": [20.0, 0.0, 30.0]},
    "three areas": GLOWING
    | {"source.array.columns": 3, "source.array.rows": 1, "source.array.pitch": [2.0, 1.0]},
    "luminaire": {
        "source.kind": "luminaire",
        "source.file": "lamp.ies",
        "source.half_width": [0.5, 0.3],
        "source.distance": 4.0,
        "source.turn": [20.0, 30.0, 40.0],
        "source.profile": "round",
    },
}
COUNT = 1 << 16


def moments(rays):
    """Return flux-weighted means of first, second and mixed powers of position and direction."""
    x, y, p, q = *rays.origin[:2], *rays.direction[:2]
    rows = np.stack([x, y, p, q, x * x, y * y, p * p, q * q, x * x * y, y**4, p**4, rays.direction[2]])
    mean = rows @ rays.flux / rays.flux.sum()
    return mean, np.sqrt(((rows - mean[:, None]) ** 2).mean(axis=1))


@pytest.mark.every(3)
@pytest.mark.parametrize("changes", SOURCES.values(), ids=SOURCES)
def test_random_rays_have_the_moments_of_the_design_rays(tmp_path, changes):
    """Means of n independent rays are off by a standard deviation / sqrt(n); five of these are allowed."""
    write_ies(asymmetric(), tmp_path / "lamp.ies")
    system = small_system(tmp_path, changes)
    parts = list(random_rays(system.source, -5.0, COUNT, 1, 5000))
    drawn = Rays(
        *(np.concatenate([getattr(p, k) for p in parts], axis=-1) for k in ("origin", "direction", "flux"))
    )
    assert drawn.total == pytest.approx(system.problem.flux, rel=1e-12)
    np.testing.assert_allclose(np.linalg.norm(drawn.direction, axis=0), 1, rtol=0, atol=1e-14)
    (mean, spread), (wanted, _) = (
        moments(drawn),
        moments(single_rays(system.source.rays((512, 512)), system.base)),
    )
    regular = 1e-4 * np.abs(wanted)  # of the regular set itself
    assert (np.abs(mean - wanted) <= 5 * spread / np.sqrt(COUNT) + regular).all()


def test_fewer_rays_than_sources_are_drawn_too(tmp_path):
    source = small_system(tmp_path, SOURCES["three areas"]).source
    assert [part.flux.size for part in random_rays(source, -5.0, 3, 1, 2)] == [2, 1]


def test_the_same_seed_draws_the_same_rays_and_another_one_others(tmp_path):
    source = small_system(tmp_path).source
    one, same, other = (next(random_rays(source, -5.0, 100, seed, 100)).origin for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, same)
    assert (one[:2] != other[:2]).all()
