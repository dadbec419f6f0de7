"""The objective's gradient against differences, and the adjoint operators one by one."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import Bounds, minimize

from optics.scene.receivers import BSplineWindow, GaussianWindow, Screen, filter_image
from optics.scene.sources import Profile, collimated_beam, point_rays
from oracles.light_formulas import brute_irradiance
from tests.optics.cases import (
    PLANE,
    TARGET_Z,
    coefficients,
    lambertian_parts,
    rough,
    small_lens,
    small_space,
    tracer_to,
)
from tests.optics.designing.optimisation.cases import (
    ANGLES,
    BOTH,
    GLOWING,
    REAR,
    SCREEN,
    SPHEROID,
    WIDE,
    asked_for,
    make_objective,
    make_tracer,
    objective_of,
    of_vector,
)
from thbcad.hierarchy import THBSpace
from thbcad.sags import Conic
from thbcad.splines import KnotVector
from thbcad.surfaces import THBSurface


def optimised(function, dim, iterations=15):
    """Return coefficients after some iterations: fluxes crowd, landing points fold, the target is half
    met."""
    return minimize(
        function,
        np.zeros(dim),
        jac=True,
        method="L-BFGS-B",
        bounds=Bounds(-1, 1),
        options={"maxiter": iterations},
    ).x


def difference(function, at, direction, step):
    return (function(at + step * direction)[0] - function(at - step * direction)[0]) / (2 * step)


def worst(function, at, gradient, step, count=20):
    """Return the greatest error of g . d over random unit directions, relative to its usual size |g| /
    sqrt(n)."""
    rng = np.random.default_rng(11)
    errors = []
    for _ in range(count):
        d = rng.standard_normal(len(at))
        d /= np.linalg.norm(d)
        errors.append(abs(difference(function, at, d, step) - gradient @ d))
    return max(errors) / (np.linalg.norm(gradient) / np.sqrt(len(at)))


@pytest.mark.every(2)
@pytest.mark.parametrize(
    ("front", "sagged"), [(PLANE, False), (PLANE, True), (Conic(60.0), False), (Conic(60.0), True)], ids=str
)
def test_gradient_is_that_of_the_loss_at_an_optimised_state(backend, front, sagged):
    """Central differences with h = 1e-5 mm err by h^2 / 6 of the third derivative and by 1e-16 L / h: about
    1e-8 here."""
    space = small_space()
    objective = of_vector(make_objective(backend, front, space), space)
    at = optimised(objective, space.dim) + (rough(space, 0.003) if sagged else 0.0)
    _, gradient = objective(at)
    assert np.ptp(at) > 0.5
    assert worst(objective, at, gradient, 1e-5) < 1e-6


def test_gradient_holds_where_light_misses_the_target_and_the_lens(backend):
    """A source wider than the lens and a front that spreads light beyond target, margin and rear."""
    space = small_space()
    objective = of_vector(make_objective(backend, Conic(-25.0), space, source=(14.0, 14.0)), space)
    at = rough(space, 0.02)
    (hits,), landing = make_tracer(backend, Conic(-25.0), space, source=(14.0, 14.0)).trace([at])
    assert not hits.hit.numpy().all()
    assert np.abs(landing.x.numpy()).max() > 30
    _, gradient = objective(at)
    # rays at the rear's border come and go with the surface; none does so within 1e-8 mm
    assert worst(objective, at, gradient, 1e-8) < 1e-4


POINT = point_rays(2.0, 1.0, 40.0, 1.0, (65, 63), (0.0, 0.0))
BEAM = collimated_beam((3.0, 4.0), 1.0, (5.0, 5.0), (65, 63))
CASES = {
    "lambertian, rear": (REAR, GLOWING, 1005.0, WIDE),
    "lambertian, both": (BOTH, GLOWING, 1005.0, WIDE),
    "point, rear": (REAR, POINT, 1005.0, WIDE),
    "point, both": (BOTH, POINT, 1005.0, WIDE),
    "collimated, rear": (REAR, BEAM, 1005.0, WIDE),
    "collimated, both": (BOTH, BEAM, 1005.0, WIDE),
    "lambertian, rear, far": (REAR, GLOWING, np.inf, ANGLES),
    "lambertian, both, far": (BOTH, GLOWING, np.inf, ANGLES),
    "collimated, both, far": (BOTH, BEAM, np.inf, ANGLES),
}


@pytest.mark.every(3)
@pytest.mark.parametrize(("lens", "rays", "target_z", "screen"), CASES.values(), ids=CASES.keys())
def test_gradient_of_every_source_surface_and_target(backend, lens, rays, target_z, screen):
    """Every ray passes both surfaces within their rims, so that the loss is smooth: differences err as
    above."""
    tracer = tracer_to(backend, lens, rays, target_z)
    spaces = [sag.space for sag in lens.sags]
    hits, landing = tracer.trace(coefficients(lens))
    assert all(h.hit.numpy().all() for h in hits)
    assert (landing.flux.numpy() > 0).all()
    objective = of_vector(objective_of(backend, tracer, screen), *spaces)
    at = np.concatenate(coefficients(lens))
    _, gradient = objective(at)
    assert worst(objective, at, gradient, 1e-5) < 1e-6
    ends = np.cumsum([space.dim for space in spaces])
    assert all(np.linalg.norm(g) > 1e-3 * np.linalg.norm(gradient) for g in np.split(gradient, ends[:-1]))


@pytest.mark.parametrize("lens", [REAR, BOTH], ids=["rear", "both"])
@pytest.mark.parametrize("target_z", [1005.0, np.inf], ids=["plane", "far"])
def test_gradient_where_a_glowing_area_lights_rims_and_beside_the_target(backend, lens, target_z):
    """The whole half space: rays miss the front and the rear, land far out, some are grazing.

    Rays at a rim come and go with the surface; none does so within 1e-8 mm.
    """
    rays = next(lambertian_parts((0.5, 0.5), 2.0, 1.0, 90.0, Profile(), 1 << 12, 0, 1 << 40))
    tracer = tracer_to(backend, lens, rays, target_z)
    hits, _ = tracer.trace(coefficients(lens))
    assert not hits[-1].hit.numpy().all()
    screen = ANGLES if np.isinf(target_z) else WIDE
    objective = objective_of(backend, tracer, screen, lost_flux_weight=1.0)
    objective = of_vector(objective, *(sag.space for sag in lens.sags))
    at = np.concatenate(coefficients(lens))
    _, gradient = objective(at)
    assert worst(objective, at, gradient, 1e-8) < 1e-4


def test_vertex_gradients_of_both_surfaces(backend):
    """One number per vertex and surface, front first; with signs, hats and the sag's own functions sum to the
    same lift of a surface."""
    tracer = tracer_to(backend, BOTH, GLOWING, 1005.0)
    objective = objective_of(backend, tracer, WIDE)
    knots = [
        tuple(KnotVector.uniform(1, n, -h, h) for n in counts) for counts, h in (((6, 7), 5.0), ((4, 9), 8.0))
    ]
    found = objective.vertex_gradients(coefficients(BOTH), knots)
    assert [g.shape for g in found] == [(7, 8), (5, 10)]
    gradients = objective(coefficients(BOTH)).gradients
    light = objective._model.light(coefficients(BOTH))
    _, _, by_image = objective._penalised(light)
    both = light.pull_back(by_image, objective._lost_weight, knots)
    for g, signed, gradient in zip(found, both, gradients, strict=True):
        np.testing.assert_array_equal(np.abs(signed), g)
        assert signed.sum() == pytest.approx(gradient.sum(), abs=1e-10 * np.abs(gradient).sum())
        assert g.max() > 0


def test_gradient_with_the_gaussian_window(backend):
    """The window lowered to zero at its cut has a kink there: differences agree to 2e-5."""
    space = small_space()
    objective = of_vector(make_objective(backend, PLANE, space, GaussianWindow(1.0)), space)
    at = optimised(objective, space.dim, 5)
    _, gradient = objective(at)
    assert worst(objective, at, gradient, 1e-6) < 2e-5


def test_the_loss_is_the_formula(backend):
    """L = |E - T|^2 / |T|^2 + w sum phi d^2 / (r^2 sum phi), by loops over the tracer's own rays."""
    space, window, screen = small_space(), BSplineWindow(3), Screen((14.0, 13.0), (40, 30), 12)
    tracer = make_tracer(backend, Conic(200.0), space, rays=33)
    at = rough(space, 0.02)
    objective = objective_of(backend, tracer, screen, window, 7.0)
    found = objective([at])
    _, landing = tracer.trace([at])
    x, y, flux = landing.x.numpy(), landing.y.numpy(), landing.flux.numpy()
    beside = np.maximum(np.abs(x) - 14, 0) ** 2 + np.maximum(np.abs(y) - 13, 0) ** 2
    assert (beside > 0).mean() > 0.1
    assert np.abs(x).max() < 14 + 10 * 0.7
    assert np.abs(y).max() < 13 + 10 * 0.86
    target = filter_image(np.pad(asked_for(screen), 12), window)
    fit = np.sum((brute_irradiance(screen, window, x, y, flux) - target) ** 2) / np.sum(target**2)
    assert found.fit == pytest.approx(np.sqrt(fit), rel=1e-12)
    assert found.loss == pytest.approx(fit + 7.0 * np.sum(flux * beside) / (14**2 * 0.92), rel=1e-12)


@pytest.mark.slow
def test_the_loss_does_not_jump_where_a_ray_leaves_the_margin(backend):
    """Pushing one ray over the outer edge of the margin changes the loss as little as any other small
    step."""
    space = THBSpace(*[KnotVector.uniform(3, 1, -10.0, 10.0)] * 2)
    beam = collimated_beam((0.5, 0.5), 1.0, (10.0, 10.0), (2, 1))
    tracer = tracer_to(backend, small_lens(rear=PLANE, space=space), beam, TARGET_Z)
    objective = objective_of(backend, tracer, lost_flux_weight=0.0)
    tilt = np.repeat(space.kv_u.greville()[:, None], space.kv_v.dim, axis=1).ravel()
    # both rays move from 22 to 29 mm
    losses = np.array([objective([a * tilt]).loss for a in np.linspace(0.62, 0.72, 801)])
    assert losses[-1] == pytest.approx(1.0, abs=1e-12)  # no light is left on the screen
    # the loss varies over pixels, of which 7 mm hold 8, and the margin ends at 26.7 mm: 100 steps per pixel
    greatest = np.abs(np.diff(losses)).max()
    assert greatest < 0.05 * np.ptp(losses)


def test_image_is_the_measured_irradiance(backend):
    space = small_space()
    objective = make_objective(backend, PLANE, space, rays=33)
    tracer = make_tracer(backend, PLANE, space, rays=33)
    at = rough(space)
    _, landing = tracer.trace([at])
    expected = brute_irradiance(
        SCREEN, BSplineWindow(3), landing.x.numpy(), landing.y.numpy(), landing.flux.numpy()
    )[8:-8, 8:-8]
    np.testing.assert_allclose(objective.image([at]), expected, rtol=0, atol=1e-12 * expected.max())


@pytest.mark.parametrize("front", [PLANE, Conic(60.0)], ids=str)
@pytest.mark.parametrize("knots", ["own", "bilinear"])
def test_pull_back_is_the_sum_over_rays(backend, front, knots):
    """dL/dC_ij = sum over rays of gz N_i N_j + gx N_i' N_j + gy N_i N_j', by dense matrices at the meeting
    points."""
    space = small_space()
    tracer = make_tracer(backend, front, space, rays=21)
    (hits,), _ = tracer.trace([rough(space)])
    gradients = np.random.default_rng(6).standard_normal((3, 21 * 21))
    for leaf, gradient in zip(hits.leaves, gradients, strict=True):
        leaf.grad = backend.array(gradient)
    own = space.embedding.kv_u, space.embedding.kv_v
    other = KnotVector.uniform(1, 7, -10.0, 10.0), KnotVector.uniform(1, 9, -10.0, 10.0)
    kv_x, kv_y = own if knots == "own" else other
    (a0, a1), (b0, b1) = (
        [kv.collocation(s.numpy(), d).toarray() for d in (0, 1)] for kv, s in ((kv_x, hits.x), (kv_y, hits.y))
    )
    gz, gx, gy = gradients
    expected = a0.T @ (gz[:, None] * b0 + gy[:, None] * b1) + a1.T @ (gx[:, None] * b0)
    if knots == "own":  # by the THB coefficients: the adjoint of the embedding follows
        (found,), expected = tracer.pull_back([hits]), space.embedding.adjoint(expected)
    else:
        (found,) = tracer.pull_back([hits], [other])
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("front", [PLANE, Conic(60.0)], ids=str)
def test_vertex_gradients_are_the_change_of_the_loss_by_one_bilinear_hat(backend, front):
    """The loss of a tracer whose sag *is* bilinear (which no Lens allows) is differenced hat by hat."""
    vertices = KnotVector.uniform(1, 7, -10.0, 10.0), KnotVector.uniform(1, 9, -10.0, 10.0)
    cubic = small_space(refined=False)
    (found,) = make_objective(backend, front, cubic, rays=41).vertex_gradients(
        [np.zeros(cubic.dim)], [vertices]
    )
    bilinear, lens = THBSpace(*vertices), small_lens(front, SPHEROID)
    creased = lens.rear.with_sag(THBSurface(bilinear, np.zeros(bilinear.dim)))
    shaped = SimpleNamespace(front=lens.front, rear=creased, thickness=lens.thickness, index=lens.index)
    tracer = tracer_to(backend, shaped, collimated_beam((9.5, 9.5), 1.0, (10.0, 10.0), (41, 41)), TARGET_Z)
    objective = of_vector(objective_of(backend, tracer), bilinear)
    rng = np.random.default_rng(2)
    chosen = rng.choice(bilinear.dim, 12, replace=False)
    differences = [
        abs(difference(objective, np.zeros(bilinear.dim), np.eye(bilinear.dim)[k], 1e-6)) for k in chosen
    ]
    assert found.shape == (8, 10)
    # no ray crosses a crease of the hat within 1e-6 mm; rounding 1e-16 / 1e-6, curvature 1e-12 of a third
    # derivative
    np.testing.assert_allclose(found.ravel()[chosen], differences, rtol=0, atol=1e-6 * found.max())
