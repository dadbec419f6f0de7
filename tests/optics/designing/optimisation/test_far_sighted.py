"""The norm of H^-1: its weights on cosines, and slopes of the loss by differences."""

import numpy as np
import pytest

import optics
from optics.base.runtime import load_backend
from optics.designing.optimisation.level_objective import stage_objective
from optics.designing.optimisation.stage_plan import stages
from optics.light.engines import ExactEngine
from optics.scene.system import solvable_system
from tests.optics.designing.optimisation.cases import slope_at_0

POINT = {"kind": "point", "half_angle": 20.0}


@pytest.fixture(scope="module")
def system():
    return solvable_system(
        optics.Problem(
            source=[POINT | {"position": (x, 0.0, -30.0)} for x in (-3.0, 4.0)],
            lens={
                "index": 1.5,
                "thickness": 6,
                "front": {"half_width": (12, 12)},
                "rear": {"half_width": (14, 14), "freeform": {"spans": (4, 4), "max_level": 0}},
            },
            target={"kind": "tophat", "distance": 60, "half_width": (30, 30), "pixels": (16, 16)},
        )
    )


def far_sighted(system):
    rough, final = stages(system, True)[-2:]
    assert (rough.far_sighted, final.far_sighted) == (True, False)
    target = system.target.irradiance(rough.screen, 1.0)
    return stage_objective(system, rough, target, ExactEngine(load_backend("double", 1)))


def test_its_slope_is_that_of_differences(system):
    loss, rng = far_sighted(system), np.random.default_rng(2)
    dim = system.base.rear.sag.space.dim
    at, along = 0.05 * rng.normal(size=dim), rng.normal(size=dim)
    found = slope_at_0(lambda step: loss([at + step * along]).loss, 1e-5)
    assert found == pytest.approx(float(loss([at]).gradients[0] @ along), rel=1e-7)


def test_a_wave_of_twice_the_length_weighs_about_four_times_as_much(system):
    loss = far_sighted(system)
    rows, columns = loss.target.shape
    x = (np.arange(columns) + 0.5) / columns
    for k in (4, 8):
        wave = np.cos(np.pi * k * x) * np.ones((rows, 1))
        weight = 1 / ((np.pi * k / columns) ** 2 + (np.pi / max(rows, columns)) ** 2)
        np.testing.assert_allclose(loss._weighted(wave), weight * wave, rtol=0, atol=1e-12 * weight)
        np.testing.assert_allclose(loss._weighted(wave, 0.5), weight**0.5 * wave, rtol=0, atol=1e-12 * weight)
