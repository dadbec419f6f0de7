"""The exact tracer as a Mitsuba integrator: image, gradient, forward mode, variants, and a design inside
Mitsuba."""

import runpy
from itertools import pairwise

import numpy as np
import pytest

pytest.importorskip("mitsuba")

from optics.designing.optimisation import Objective
from optics.exchange.mitsuba.integrator import exact_integrator, register
from optics.exchange.mitsuba.loading import load_mitsuba
from optics.light.engines import TracedModel
from optics.scene.problem import load_problem
from optics.scene.receivers import GaussianWindow, filter_image
from optics.scene.system import System, target_irradiance
from tests.cases import ROOT
from tests.optics.cases import coefficients, rough, store_result, target_z, tracer_to
from tests.optics.exchange.mitsuba.cases import exact_image
from thbcad.surfaces import THBSurface

EPS = 2.0**-23  # of float32
BOTH_FREE = {"lens.front.freeform": {"spans": [3, 2]}}
WINDOW = GaussianWindow(1.0)
PIXELS = (48, 40)
KEYS = ("integrator.front_coefficients", "integrator.rear_coefficients")


@pytest.fixture(scope="module", params=["llvm_ad_mono", "llvm_ad_rgb"])
def mi(request):
    """Mitsuba in two variants."""
    yield load_mitsuba(request.param)
    load_mitsuba()


@pytest.fixture
def make(problem_file):
    """A function that returns (problem, lens) without symmetry."""

    def build(changes=None):
        smooth = {
            "optimizer.window": "gaussian",
            "target.pixels": list(PIXELS),
            "target.half_width": [24.0, 20.0],
        }
        problem = load_problem(problem_file(smooth | (changes or {})))
        lens = System(problem).base
        return problem, lens.with_sags(
            [THBSurface(sag.space, rough(sag.space, 0.05, k)) for k, sag in enumerate(lens.sags)]
        )

    return build


def scene_with(mi, integrator):
    """Return a scene whose sensor has a film of the target's pixels and 9 samples."""
    film = {"type": "hdrfilm", "width": PIXELS[0], "height": PIXELS[1], "pixel_format": "luminance"}
    sensor = {"type": "perspective", "film": film, "sampler": {"type": "independent", "sample_count": 9}}
    return mi.load_dict({"type": "scene", "integrator": integrator, "sensor": sensor})


def exact_film(backend, problem, lens):
    """Return the light model of the exact tracer with 9 rays per pixel."""
    system = System(problem)
    rays = system.source.rays([3 * n for n in PIXELS])
    tracer = tracer_to(backend, lens, rays, target_z(problem))
    return TracedModel(backend, tracer, system.target.screen(), WINDOW)


def asked_for(problem):
    target = System(problem).target
    return target_irradiance(target.light, target.screen(), problem.target.placing, 0.92)


@pytest.mark.parametrize("absorption", [0.0, 0.02])
def test_the_image_is_that_of_the_exact_tracer_row_by_row(mi, make, backend, absorption):
    problem, lens = make({"lens.absorption": absorption})
    system = System(problem)
    scene = scene_with(mi, exact_integrator(system.with_lens(lens)))
    image = np.array(mi.render(scene))
    exact = exact_image(backend, system, lens, [3 * n for n in PIXELS], WINDOW)
    assert image.shape == (40, 48, 1)
    # rounded to float32 at the end; atomics add in any order
    assert np.abs(image[..., 0] - exact).max() <= EPS * exact.max()
    assert np.array_equal(np.array(mi.render(scene, spp=9, seed=5)), image)
    assert not np.array_equal(np.array(mi.render(scene, spp=4)), image)


def test_gradients_are_those_of_the_objective_and_of_differences(mi, make, backend):
    """The film is float32: its rounding moves the loss's derivatives by EPS of the sum of their terms'
    sizes."""
    import drjit as dr

    problem, lens = make(BOTH_FREE)
    scene = scene_with(mi, exact_integrator(System(problem).with_lens(lens)))
    parameters = mi.traverse(scene)
    assert set(KEYS) <= set(parameters.keys())
    for key in KEYS:
        dr.enable_grad(parameters[key])
    measured = filter_image(asked_for(problem), WINDOW)
    image = mi.render(scene, parameters)
    loss = dr.sum(dr.square(image - mi.TensorXf(measured[..., None])), axis=None) / float(
        np.square(measured).sum()
    )
    dr.backward(loss)
    gradients = [dr.grad(parameters[key]).numpy() for key in KEYS]
    objective = Objective(exact_film(backend, problem, lens), asked_for(problem), 0.0)
    found = objective(coefficients(lens))
    value, wanted = found.loss, found.gradients
    assert float(loss.array[0]) == pytest.approx(value, rel=1e-5)
    for gradient, other in zip(gradients, wanted):
        assert np.linalg.norm(gradient - other) < 1e-5 * np.linalg.norm(other)
    rng, h = np.random.default_rng(3), 1e-5
    directions = [rng.standard_normal(len(g)) for g in gradients]
    ends = [
        objective([c + sign * h * d for c, d in zip(coefficients(lens), directions)]).loss for sign in (1, -1)
    ]
    assert sum(g @ d for g, d in zip(gradients, directions)) == pytest.approx(
        (ends[0] - ends[1]) / (2 * h), rel=1e-4
    )


@pytest.mark.parametrize(
    "changes",
    [None, BOTH_FREE, BOTH_FREE | {"source.half_width": [14.0, 14.0]}],
    ids=["rear", "both", "wide beam"],
)
def test_forward_and_backward_are_adjoint(make, backend, changes):
    """Both run in double precision; w . (J d) == (J' w) . d but for the rounding of the sums."""
    problem, lens = make(changes)
    film = exact_film(backend, problem, lens)
    rng, at = np.random.default_rng(4), coefficients(lens)
    directions, weights = [rng.standard_normal(len(c)) for c in at], rng.standard_normal(PIXELS[::-1])
    _, forward = film.push_forward(at, directions)
    backward = film.light(at).pull_back(weights)
    assert np.vdot(forward, weights) == pytest.approx(
        sum(g @ d for g, d in zip(backward, directions)), rel=1e-10
    )


def test_forward_mode_through_mitsuba(mi, make, backend):
    """Central differences in double precision err by h^2 of the third derivative, the tensor by EPS."""
    import drjit as dr

    problem, lens = make()
    scene = scene_with(mi, exact_integrator(System(problem).with_lens(lens)))
    parameters = mi.traverse(scene)
    (at,) = coefficients(lens)
    direction = np.random.default_rng(5).standard_normal(len(at))
    values = mi.Float64(at)
    dr.enable_grad(values)
    parameters[KEYS[1]] = values
    parameters.update()
    dr.set_grad(values, mi.Float64(direction))
    change = np.array(dr.forward_to(mi.render(scene, parameters)))[..., 0]
    h, film = 1e-5, exact_film(backend, problem, lens)
    wanted = (film.image([at + h * direction]) - film.image([at - h * direction])) / (2 * h)
    assert np.abs(change - wanted).max() < 1e-5 * np.abs(wanted).max()


def test_a_result_folder_is_read_by_its_name(mi, make, tmp_path):
    problem, lens = make(BOTH_FREE)
    folder = store_result(tmp_path / "result", problem, lens)
    register()
    images = [
        np.array(mi.render(scene_with(mi, integrator)))
        for integrator in (
            {"type": "thbcad", "result": str(folder.path)},
            exact_integrator(System(problem).with_lens(lens)),
        )
    ]
    assert np.array_equal(*images)


def test_a_folder_without_a_result_is_refused(mi, tmp_path):
    register()
    with pytest.raises(RuntimeError, match=r"is not a result folder: it has no problem\.toml"):
        mi.load_dict({"type": "thbcad", "result": str(tmp_path)})


def test_the_example_designs_a_lens(capsys):
    losses = runpy.run_path(str(ROOT / "examples" / "mitsuba_design.py"))["main"]()
    assert all(b < a for a, b in pairwise(losses))
    assert losses[-1] < 0.5 * losses[0]
    assert capsys.readouterr().out.count("loss") == len(losses) == 10
