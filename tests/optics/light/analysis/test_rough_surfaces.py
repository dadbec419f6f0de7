"""Rough surfaces: the variance of landing points against the closed form, by cells and by rays."""

from itertools import product

import numpy as np
import pytest

import optics
from tests.cases import slow_unless
from tests.optics.cases import small_problem

PIXELS = 96
PLATE = {
    "lens.rear.radius": np.inf,
    "lens.rear.conic": 0.0,
    "target.half_width": [20.0, 20.0],
    "target.pixels": [PIXELS, PIXELS],
}
LAMP = {"source.kind": "lambertian", "source.half_width": [9.5, 9.5], "source.half_angle": 1e-3}
BEAM = 9.5**2 / 3  # variance of both, mm^2


def variance(folder, changes):
    """The variance of x over the target's light, mm^2, without that within a pixel; and the measurement."""
    system = optics.System(small_problem(folder, PLATE | changes))
    measured = system.measure(system.base)
    x = (2 * np.arange(PIXELS) + 1) / PIXELS * 20 - 20
    row = measured.irradiance.sum(axis=0)
    return (row @ x**2) / row.sum() - (row @ x / row.sum()) ** 2 - (40 / PIXELS) ** 2 / 12, measured, system


SOURCES = {"beam": {}, "lamp": LAMP}
PLATES = list(product(("front", "rear"), (0.01, 0.02), SOURCES))
OFTEN = [plate for k, plate in enumerate(PLATES) if k in (1, 2, 4, 7)]  # every pair


@pytest.mark.slow
@pytest.mark.parametrize("case", slow_unless(OFTEN.__contains__, PLATES), ids=str)
def test_a_rough_plate_spreads_light_by_its_slopes(tmp_path, case):
    """Small errors d of the slope turn light by (n - 1) d behind the rear, by (n - 1) d / n behind the front.

    The latter is n times as large again behind a plane rear.
    """
    surface, rms, source = case
    after, measured, system = variance(tmp_path, SOURCES[source] | {f"lens.{surface}.slope_rms": rms})
    lens = system.problem.lens
    length = system.problem.target.distance
    if surface == "front":  # through the plate the light goes at 1 / n of the angle
        length += lens.thickness / lens.index
    assert after - BEAM == pytest.approx((length * (lens.index - 1) * rms) ** 2, rel=0.05)
    assert measured.metrics["estimator"] == ("rays" if source == "lamp" else "beams")
    assert sum(measured.metrics["fates_w"].values()) == pytest.approx(1.0, rel=1e-12)


@pytest.mark.slow
def test_roughness_and_divergence_add_up(tmp_path):
    sun = {"source.divergence_profile": "sun", "source.divergence": 0.6, "source.distance": 3.0}
    rough = {"lens.rear.slope_rms": 0.01, "lens.front.slope_rms": 0.008}
    _, plain, _ = variance(tmp_path, {})
    each = [variance(tmp_path, changes)[0] - BEAM for changes in (sun, rough)]
    both, measured, _ = variance(tmp_path, sun | rough)
    assert both - BEAM == pytest.approx(sum(each), rel=0.03)
    np.testing.assert_allclose(measured.sharp, plain.irradiance, rtol=0, atol=1e-12 * plain.irradiance.max())
    assert measured.metrics["rel_l2_sharp"] == pytest.approx(plain.metrics["rel_l2"], abs=1e-9)
    assert plain.sharp is None
    assert measured.metrics["estimator"] == "beams"


@pytest.mark.slow
def test_a_rough_fixed_mirror_behind_the_lens_spreads_light_by_its_own_slopes():
    """Slopes d of a mirror at 45 degrees turn light by 2 d across the fold, and by 2 d cos(45) along it."""
    sides = {"front": {"half_width": (10, 10)}, "rear": {"half_width": (10, 10)}}
    face = {"half_width": (30, 40), "radius": np.inf, "conic": 0.0, "freeform": False}
    mirror = {"kind": "mirror", "name": "M1", "position": (0, 0, 60), "tilt": (45, 0, 0), "thickness": 5}
    target = {"position": (0, 100, 60), "tilt": (-90, 0, 0), "half_width": (20, 20), "pixels": (64, 64)}
    lamp = {"kind": "lambertian", "half_width": (0.01, 0.01), "half_angle": 2, "distance": 40}
    variances = []
    for rms in (0.0, 0.02):
        lens = {"kind": "lens", "name": "L1", "index": 1.5, "thickness": 5, **sides}
        rough = mirror | {"face": face | {"slope_rms": rms}}
        problem = optics.Problem(source=lamp, element=[lens, rough], target={"kind": "tophat", **target})
        system = optics.System(problem)
        light = system.measure(system.base).irradiance
        x = (2 * np.arange(64) + 1) / 64 * 20 - 20
        variances.append([light.sum(axis=axis) @ x**2 / light.sum() for axis in (0, 1)])
    spread = np.diff(variances, axis=0)[0] / (2 * 100 * 0.02) ** 2
    np.testing.assert_allclose(spread, [0.5, 1.0], rtol=0.02)  # noise of 80 000 rays, cubes of the slopes
