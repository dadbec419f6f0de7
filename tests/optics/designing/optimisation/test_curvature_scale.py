"""The diagonal of the Gauss-Newton Hessian: its estimate by random signs, and the variables that it
scales."""

from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

from optics.designing.optimisation.bounded_variables import LEAST, BoundedVariables
from optics.designing.optimisation.objective import Objective
from optics.light.engines import TracedModel
from optics.light.measuring import Splat
from optics.scene.receivers import BSplineWindow, Screen, filter_image
from optics.scene.sources import Profile, collimated_beam
from tests.optics.cases import (
    coefficients,
    hollow_lens,
    lambertian_parts,
    picture,
    rough,
    small_lens,
    small_space,
    tracer_to,
)
from tests.optics.designing.optimisation.cases import check_adjoint, run
from thbcad.sags import Conic

WINDOW = BSplineWindow(3)


def case(backend, kind):
    """Return (objective, start, J / ||T||) of a tiny case, J (pixels, dim) by central differences of the
    splat with its margin."""
    if kind == "rear":
        space = small_space(refined=False)
        lens = small_lens(Conic(), Conic(45.0, 0.4), rough(space), space=space)
        rays, target_z, half = collimated_beam((9.5, 9.5), 1.0, (10.0, 10.0), (41, 39)), 66.0, 20.0
    else:
        lens = hollow_lens(lambda s: rough(s, 0.1), lambda s: rough(s, 0.05, 6))
        rays = next(lambertian_parts((0.5, 0.5), 2.0, 1.0, 45.0, Profile(), 1 << 11, 0, 1 << 40))
        target_z, half = 105.0, 150.0
    screen = Screen((half, half), (14, 12), 2)
    target = picture(12, 14).astype(float)
    target *= 0.8 / (target.sum() * screen.pixel_area)
    tracer = tracer_to(backend, lens, rays, target_z, 0.05)
    splat, at = Splat(backend, screen, WINDOW), coefficients(lens)
    norm = np.linalg.norm(filter_image(screen.pad(target), WINDOW))

    def image(vector):
        _, landing = tracer.trace(np.split(vector, np.cumsum([len(c) for c in at])[:-1]))
        return splat(landing.x, landing.y, landing.flux).numpy() / norm

    start, h = np.concatenate(at), 1e-5
    jacobian = np.stack(
        [(image(start + h * e) - image(start - h * e)) / (2 * h) for e in np.eye(len(start))], axis=1
    )
    return SimpleNamespace(
        objective=Objective(TracedModel(backend, tracer, screen, WINDOW), target, 100.0, 0.5),
        start=at,
        jacobian=jacobian,
        lens=lens,
    )


@pytest.fixture(scope="module", params=["rear", "both"])
def tiny(request, backend):
    return case(backend, request.param)


def probes(tiny, count, seed=0):
    """Return the objective's vectors, (count, dim)."""
    return np.array([np.concatenate(v) for v in tiny.objective.curvature(tiny.start, count, seed)])


def test_every_vector_is_the_adjoint_applied_to_signs(tiny):
    """J^T s / ||T|| with signs drawn one image after the other; central differences with h = 1e-5 mm err by
    1e-7 or so."""
    found, rng = probes(tiny, 3, 7), np.random.default_rng(7)
    for row in found:
        expected = rng.choice((-1.0, 1.0), len(tiny.jacobian)) @ tiny.jacobian
        np.testing.assert_allclose(
            row, expected, rtol=0, atol=1e-5 * np.linalg.norm(expected) / np.sqrt(len(row))
        )


@pytest.mark.slow
def test_the_mean_square_converges_to_half_the_hessians_diagonal(tiny):
    """The square of a sum of signs varies by at most twice its squared mean: n probes err by sqrt(2 / n),
    seldom by five times that."""
    half = np.square(tiny.jacobian).sum(axis=0)
    squares = np.square(probes(tiny, 320))
    errors = [np.abs(squares[:n].mean(axis=0) / half - 1) for n in (20, 320)]
    for n, error in zip((20, 320), errors):
        assert np.sqrt(np.mean(error**2)) < 2 * np.sqrt(2 / n)
        assert error.max() < 5 * np.sqrt(2 / n)
    assert np.mean(errors[1] ** 2) < np.mean(errors[0] ** 2) / 4


def test_the_same_seed_gives_the_same_bytes_and_another_other_signs(tiny, backend):
    one, again, other = (probes(tiny, 2, seed) for seed in (3, 3, 4))
    assert one.tobytes() == again.tobytes()
    assert np.abs(other - one).max() > 0.1 * np.abs(one).max()


# The variables


def scaled(tiny, axes=(), count=16):
    """Return the variables of a case, scaled, with bounds that bend their map, and the weights' scales."""
    bounds = [2.0 * np.abs(c).max() for c in tiny.start]
    plain = BoundedVariables(tiny.lens.sags, bounds, axes)
    found = plain.preconditioned(tiny.objective.curvature(tiny.start, count, 0))
    g = [np.random.default_rng(1).standard_normal(len(c)) for c in tiny.start]
    one, other = (v.gradient(g, v.coefficients(v.zeros())[1]) for v in (plain, found))
    return SimpleNamespace(plain=plain, variables=found, scales=other / one)


def test_zero_weights_are_the_start_still(tiny):
    found = scaled(tiny)
    for a, b in zip(*(v.coefficients(v.zeros())[0] for v in (found.variables, found.plain)), strict=True):
        np.testing.assert_array_equal(a, b)


def test_scales_have_mean_square_one_and_make_the_diagonal_constant(tiny):
    """Entries below LEAST of the mean count as that; the plain variables' own diagonal is taken from their
    gradients."""
    found, vectors = scaled(tiny), tiny.objective.curvature(tiny.start, 16, 0)
    assert np.mean(found.scales**2) == pytest.approx(1, rel=1e-9)
    _, slopes = found.plain.coefficients(found.plain.zeros())
    diagonal = np.mean([found.plain.gradient(v, slopes) ** 2 for v in vectors], axis=0)
    regular = diagonal > LEAST * diagonal.mean()
    assert regular.mean() > 0.5
    level = found.scales**2 * diagonal
    np.testing.assert_allclose(level[regular], level[regular][0], rtol=1e-9)
    np.testing.assert_allclose(found.scales[~regular], found.scales.max(), rtol=1e-9)


@pytest.mark.parametrize("size", [0.0, 1.0, 30.0])
@pytest.mark.parametrize("axes", [(), (0, 1)], ids=str)
def test_the_gradient_is_that_of_the_scaled_map(tiny, axes, size):
    """As without scales; these are at most 1 / sqrt(LEAST) = 32 of the usual one."""
    check_adjoint(scaled(tiny, axes).variables, size, 1e-6)


def test_the_loss_has_the_gradient_that_the_scaled_variables_give(tiny):
    """Objective and variables together, as L-BFGS sees them: central differences with steps of 1e-5 mm or so
    in the coefficients."""
    variables, rng = scaled(tiny).variables, np.random.default_rng(3)
    at = 0.1 * rng.standard_normal(len(variables.zeros()))

    def loss(weights):
        return tiny.objective(variables.coefficients(weights)[0])

    gradient = variables.gradient(loss(at).gradients, variables.coefficients(at)[1])
    for _ in range(4):
        d = rng.standard_normal(len(at))
        moved, start = (np.concatenate(variables.coefficients(w)[0]) for w in (at + d, at))
        h = 1e-5 / np.abs(moved - start).max()
        difference = (loss(at + h * d).loss - loss(at - h * d).loss) / (2 * h)
        assert gradient @ d == pytest.approx(
            difference, abs=1e-4 * np.linalg.norm(gradient) * np.linalg.norm(d) / np.sqrt(len(d))
        )


def test_light_that_moves_nothing_leaves_the_variables_alone():
    """All light beside the pixels: the fit has no curvature, only the charge for lost light has a
    gradient."""
    space = small_space(refined=False)
    lens = small_lens(space=space)
    variables = BoundedVariables(lens.sags, [1.0]).preconditioned([[np.zeros(space.dim)]] * 4)
    (c,), _ = variables.coefficients(np.ones(len(variables.zeros())))
    assert np.isfinite(c).all()


def test_a_design_starts_with_all_light_beside_the_target(tmp_path, backend):
    """A beam that is dark in the middle, before a small target and on a flat start: the charge for lost light
    moves it onto the pixels."""
    across = np.abs(np.linspace(-1, 1, 64))
    Image.fromarray(np.where(np.maximum(across[:, None], across) > 0.7, 255, 0).astype(np.uint8)).save(
        tmp_path / "ring.png"
    )
    changes = {
        "source.profile": "image",
        "source.image": "ring.png",
        "optimizer.start": "flat",
        "lens.rear.radius": 400.0,
        "lens.rear.conic": 0.0,
        "lens.rear.freeform.max_level": 0,
        "target.half_width": [3.0, 3.0],
    }
    losses = [row.loss for row in run(tmp_path, backend, changes).state.history]
    assert min(losses) < 0.1 * losses[0]
