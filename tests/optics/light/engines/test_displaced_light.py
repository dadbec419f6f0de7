"""The light that a design of a plate traces, and the model of a script, is the sum that is measured."""

from itertools import count

import numpy as np
import pytest

import optics
from optics.light.analysis import measure
from optics.light.blur import spreads_of
from optics.light.engines import BlurredEngine, ExactEngine, Film
from tests.optics.cases import (
    assert_gradient_of_loss,
    coefficients,
    roughened,
    small_problem,
    small_system,
)

PLATE = {"lens.array.columns": 2, "lens.array.rows": 1, "lens.array.pitch": 25.0, "lens.thickness": 8.0}
NEAR = PLATE | {"target.half_width": [30.0, 30.0], "target.pixels": [40, 40], "target.distance": 60.0}
LAMP = {"source.kind": "lambertian", "source.half_width": [0.5, 0.5], "source.distance": 20.0}
LAMP |= {"source.half_angle": 15.0, "optimizer.window": "bspline"}


def traced(folder, changes, backend):
    """Return the light of the models of all lenses and of one, and the system with its lens."""
    system = small_system(folder, changes)
    lens = roughened(system.base, 0.05, count())
    engines = [ExactEngine(backend)]
    for spread in reversed(spreads_of(system, system.path, backend)):
        engines.append(BlurredEngine(engines[-1], spread))
    film = Film(system.target.screen(margin=4), (161, 161))
    models = [engine.model(system.shaping.with_lens(lens), film) for engine in (engines[-1], engines[0])]
    return *(m.screen.crop(m.image(coefficients(lens))) for m in models), system, lens


def test_the_light_of_a_model_is_that_of_all_lenses(tmp_path, backend):
    """Half a pitch is 8.3 pixels; the estimates differ by their cells, and by what moves within pixels."""
    both, one, system, lens = traced(tmp_path, NEAR, backend)
    measured = measure(system.with_lens(lens), backend).irradiance / 2
    found, alone = (np.linalg.norm(image - measured) / np.linalg.norm(measured) for image in (both, one))
    assert found < 0.02
    assert alone > 0.5


def test_blurred_light_is_displaced_too(tmp_path, backend):
    sun = NEAR | {"source.divergence_profile": "sun", "source.divergence": 1.0}
    both, one, *_ = traced(tmp_path, sun, backend)
    sharp, _, *_ = traced(tmp_path, NEAR, backend)
    assert both.sum() == pytest.approx(sharp.sum(), rel=0.01)
    assert np.abs(both - sharp).max() > 0.01 * sharp.max()
    assert np.linalg.norm(one - sharp) > 0.5 * np.linalg.norm(sharp)


@pytest.mark.parametrize(("changes", "window"), [({}, "cells"), (LAMP, "bspline")])
def test_gradient_is_that_of_the_loss(tmp_path, changes, window):
    assert_gradient_of_loss(optics.System(small_problem(tmp_path, NEAR | changes)), (97, 97), window)


@pytest.mark.slow
def test_a_plate_is_designed_for_the_sum_of_its_pictures(tmp_path):
    """Four pixels apart: 0.26 off where one lens is designed alone, and 0.1 now."""
    keys = {
        "target.distance": 300.0,
        "target.half_width": [100.0, 100.0],
        "target.pixels": [32, 32],
        "target.kind": "tophat",
        "target.lit": [0.7, 0.7],
        "lens.rear.freeform.z_freedom": 5.0,
        "lens.rear.freeform.max_level": 3,
        "optimizer.iterations": [12],
    }
    made = optics.design(small_problem(tmp_path, PLATE | keys))
    assert made.metrics["rel_l2_debiased"] < 0.15
