"""The irradiance that rays measure, against the source's image that points of the target see."""

import numpy as np
import pytest

from optics.base.runtime import load_backend
from optics.light.analysis.light_estimate import Light, LightEstimate
from optics.light.analysis.light_of_rays import light_of_parts
from optics.scene.problem import load_problem
from optics.scene.system import System
from oracles.source_image import Scene, SourceImage, pixel_irradiance
from tests.cases import EXAMPLES
from tests.optics.cases import rough
from thbcad.splines import BSplineSurface, KnotVector
from thbcad.surfaces import THBSurface

SIDE, REPLICATES = 1024, 6  # rays of a replicate in each direction


def bent_rear():
    """A rear of 20 mm by 16 mm with bumps of some tenths of a millimetre."""
    kv_u, kv_v = KnotVector.uniform(3, 4, -10, 10), KnotVector.uniform(3, 3, -8, 8)
    return BSplineSurface(kv_u, kv_v, np.random.default_rng(3).uniform(-0.3, 0.3, (kv_u.dim, kv_v.dim)))


def direct_irradiance(points, scene, nodes=12):
    """Return L times the integral of d^2 / r^4 over the source, by Gauss's rule, W/mm^2."""
    x, w = np.polynomial.legendre.leggauss(nodes)
    (a, b), d = scene.source, scene.target + scene.distance
    square = d**2 + (points[:, 0, None, None] - a * x[:, None]) ** 2 + (points[:, 1, None, None] - b * x) ** 2
    return scene.flux / (4 * np.pi * a * b) * a * b * np.einsum("i,j,nij->n", w, w, d**2 / square**2)


def test_glass_of_index_1_leaves_the_light_of_the_source():
    """Front and rear bend, and nothing else: what is seen is the rectangle itself, whole.

    Pieces are about 1/50 of the source wide.  Their square, 4e-4, is the scale of the error; halving them
    quarters what is found, 5e-5.
    """
    scene = Scene(
        graph=bent_rear(),
        radius=-40.0,
        constant=0.3,
        half_width=(10.0, 8.0),
        thickness=4.0,
        index=1.0,
        target=20.0,
        source=(1.5, 1.0),
        distance=3.0,
        flux=2.0,
    )
    points = np.array([[0.0, 0.0], [4.0, -3.0], [-7.0, 2.0], [9.0, 6.0]])
    found = SourceImage(scene, 64, 8)(points)
    assert found == pytest.approx(direct_irradiance(points, scene), rel=1e-4)


@pytest.mark.slow
def test_rays_measure_what_the_source_s_image_says(tmp_path):
    """The lens of Table 6.3 with a rough rear: pixel by pixel within the replicates' spread, and together."""
    problem = load_problem(EXAMPLES / "extended.toml").with_(**{"target.pixels": [32, 32]})
    system, backend = System(problem), load_backend("double")
    space = system.base.rear.sag.space
    for level in range(2):
        space = space.refine({level: space.cells[space.cells[:, 0] == level, 1:]})
    lens = system.base.with_sags([THBSurface(space, rough(space, 0.02))])
    screen, rng = system.target.screen(), np.random.default_rng(1)

    def replicates():
        for _ in range(REPLICATES):
            parts = system.source.parts((SIDE, SIDE), rng)
            path, rms = system.with_lens(lens).path, system.slope_rms
            images, fates = light_of_parts(path, rms, [screen], parts, rng, backend)
            yield Light.of(images, fates.on_target, fates.off_target)

    light = LightEstimate.of_replicates(replicates())
    lit = np.argwhere(light.irradiance > light.irradiance.mean())
    pixels = lit[rng.choice(len(lit), 16, replace=False)]
    exact, error = pixel_irradiance(SourceImage(Scene.of(system, lens), 128, 8), pixels, screen, 4)
    own, spread = (image[tuple(pixels.T)] for image in (light.irradiance, light.error))
    assert np.median(error / exact) < 1e-3
    spread = np.hypot(spread, error)
    # Student's t with 5 degrees of freedom has the variance 5/3 and hardly ever passes 8
    assert (abs(own - exact) < 8 * spread).all()
    assert abs((own - exact).sum()) < 4 * np.linalg.norm(spread)
    assert np.linalg.norm(spread) / exact.sum() < 3e-3
