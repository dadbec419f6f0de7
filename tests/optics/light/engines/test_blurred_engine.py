"""Blurred light models: derivatives against differences, adjoints, and what they measure against beams."""

from itertools import count

import numpy as np
import pytest

import optics
from optics.light.analysis import measure
from optics.light.blur import blur_of
from optics.light.engines import BlurredEngine, ExactEngine, Film
from tests.cases import slow_unless
from tests.optics.cases import (
    assert_gradient_of_loss,
    coefficients,
    roughened,
    small_problem,
    small_system,
)

SUN = {"source.divergence_profile": "sun", "source.divergence": 1.5}
CASES = {
    "sun": SUN,
    "sun on rough surfaces": SUN | {"lens.front.slope_rms": 0.014, "lens.rear.slope_rms": 0.013},
    "rough, of a point": {
        "source.kind": "point",
        "source.distance": 40.0,
        "source.half_angle": 11.0,
        "source.half_width": [0.0, 0.0],
        "lens.rear.slope_rms": 0.08,
    },
    "sun in the far field": SUN | {"target.distance": np.inf, "target.half_width": [20.0, 20.0]},
    "sun before a curved front": SUN | {"lens.front.radius": 80.0, "source.half_width": [8.0, 8.0]},
    "sun before a free front": SUN
    | {"lens.front.freeform.spans": [2, 2], "lens.front.freeform.z_freedom": 0.5},
}


def model_of(folder, changes, backend):
    system = small_system(folder, changes)
    lens = roughened(system.base, 0.05, count())
    engine = BlurredEngine(ExactEngine(backend), blur_of(system, system.with_lens(lens).path, backend))
    film = Film(system.target.screen(margin=4), (161, 161))
    return engine.model(system.shaping.with_lens(lens), film), lens, system


@pytest.mark.every(3)
@pytest.mark.parametrize("case", CASES)
def test_derivatives_are_differences(tmp_path, backend, case):
    """Of every pixel; the limit of 1e-4 is that of the differences, which cross borders of pixels."""
    model, lens, _ = model_of(tmp_path, CASES[case], backend)
    c, rng = coefficients(lens), np.random.default_rng(1)
    direction = [rng.normal(size=v.size) for v in c]
    bar = np.asfortranarray(rng.normal(size=model.screen.padded))
    _, slope = model.push_forward(c, direction)

    def image(t):
        return model.image([v + t * d for v, d in zip(c, direction)])

    h = 1e-5
    stencil = (8 * (image(h) - image(-h)) - (image(2 * h) - image(-2 * h))) / (12 * h)
    off = float(np.linalg.norm(slope - stencil) / np.linalg.norm(slope))
    assert off < 1e-4
    pulled = model.light(c).pull_back(bar)
    along = sum(float(g @ d) for g, d in zip(pulled, direction))
    assert along == pytest.approx(float(np.vdot(bar, slope)), rel=1e-10)


@pytest.mark.parametrize(
    "case", slow_unless(("rough, of a point", "sun before a free front").__contains__, CASES)
)
def test_gradient_is_that_of_the_loss(tmp_path, case):
    """Along the gradient the sums over pixels smooth their borders: differences of 1e-6 mm err by 4e-10."""
    assert_gradient_of_loss(optics.System(small_problem(tmp_path, CASES[case])), (97, 97))


@pytest.mark.slow
@pytest.mark.parametrize(
    "case", slow_unless(("sun", "rough, of a point", "sun in the far field").count, CASES)
)
def test_the_blurred_image_is_what_beams_measure(tmp_path, backend, case):
    """One blur for all of the lens, against beams of all directions: most of what they change is there."""
    model, lens, system = model_of(tmp_path, CASES[case], backend)
    measured = measure(system.with_lens(lens), backend)
    found = model.screen.crop(model.image(coefficients(lens))) / system.target.screen().projection()
    off, changed = (float(np.linalg.norm(a - measured.irradiance)) for a in (found, measured.sharp))
    assert off < 0.25 * changed
    assert changed > 0.05 * float(np.linalg.norm(measured.irradiance))
    assert measured.metrics["estimator"] == "beams"
    fates = measured.metrics["fates_w"].values()
    assert sum(fates) == pytest.approx(1.0, rel=1e-12)
    assert min(fates) >= 0


def test_a_target_is_asked_for_as_it_is(tmp_path, backend):
    model, _, system = model_of(tmp_path, SUN, backend)
    target = system.target.irradiance(system.target.screen(), 1.0)
    found = model.screen.crop(model.filtered(model.screen.pad(target)))
    np.testing.assert_allclose(found, target, rtol=1e-12)


@pytest.mark.slow
def test_a_design_for_the_sun_is_better_there_than_a_sharp_one(tmp_path):
    """And it makes a picture that is too sharp for parallel light."""
    problem = small_problem(tmp_path, SUN | {"optimizer.iterations": [20]})
    sharp = problem.with_(**{"source.divergence": 0.0, "source.divergence_profile": "uniform"})
    of_sun, of_sharp = optics.design(problem), optics.design(sharp)
    relit = of_sharp.relight(problem.source).metrics["rel_l2"]
    assert of_sun.metrics["rel_l2"] < 0.8 * relit
    assert of_sun.metrics["rel_l2_sharp"] > 1.5 * of_sharp.metrics["rel_l2"]
