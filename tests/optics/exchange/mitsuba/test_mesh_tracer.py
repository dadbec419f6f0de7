"""Rays through Mitsuba's meshes against the exact tracer."""

import numpy as np
import pytest

pytest.importorskip("mitsuba")

from optics.designing.optimisation import Objective
from optics.exchange.mitsuba.mesh import LensMesh
from optics.exchange.mitsuba.mesh_tracer import MeshTracer
from optics.light.engines import TracedModel
from optics.scene.problem import load_problem
from optics.scene.receivers import GaussianWindow, receiver_at
from optics.scene.sources import Profile, collimated_beam
from optics.scene.system import System
from tests.optics.cases import (
    coefficients,
    hollow_lens,
    lambertian_parts,
    rough,
    small_lens,
    small_space,
    target_z,
    tracer_to,
)
from tests.optics.exchange.mitsuba.cases import exact_image

pytestmark = pytest.mark.usefixtures("mi")
WINDOW = GaussianWindow(1.0)
BEAM = collimated_beam((9.5, 9.5), 1.0, (10.0, 10.0), (65, 63))
WIDE = collimated_beam((14.0, 14.0), 1.0, (10.0, 10.0), (65, 63))
GLOWING = next(lambertian_parts((0.5, 0.5), 2.0, 1.0, 40.0, Profile(), 1 << 12, 0, 1 << 40))
ROUGH = small_lens(sag=rough(small_space()))
BOTH = hollow_lens(lambda space: rough(space, 0.05), lambda space: rough(space, 0.05, 6), (2, 2))


def landings(backend, lens, rays, target_z, vertices):
    """Return the landings of the exact tracer and of the meshes."""
    _, exact = tracer_to(backend, lens, rays, target_z).trace(coefficients(lens))
    _, mesh = MeshTracer(LensMesh.uniform(lens, vertices), rays, receiver_at(target_z)).trace(
        coefficients(lens)
    )
    return exact, mesh


def mesh_model(system, lens, rays, vertices):
    """Return the light through meshes."""
    mesh = LensMesh.uniform(lens, (vertices, vertices))
    tracer = MeshTracer(mesh, system.source.rays((rays, rays)), system.target.receiver)
    return TracedModel(tracer.backend, tracer, system.target.screen(), WINDOW)


def distance(exact, mesh):
    """Return the root mean square distance between landing points of rays that arrive by both ways."""
    both = (exact.flux.numpy() > 0) & (mesh.flux.numpy() > 0)
    return np.sqrt(
        np.mean([(a.numpy() - b.numpy())[both] ** 2 for a, b in ((exact.x, mesh.x), (exact.y, mesh.y))])
    )


@pytest.mark.parametrize(
    ("lens", "rays"), [(ROUGH, BEAM), (BOTH, GLOWING)], ids=["collimated, rear", "lambertian, both"]
)
def test_landing_points_converge_with_the_square_of_the_spacing(backend, lens, rays):
    """Normals that are interpolated linearly err by h^2 / 8 of their second derivative."""
    errors = [distance(*landings(backend, lens, rays, 66.0, (n, n))) for n in (33, 65, 129)]
    assert errors[1] < errors[0] / 3
    assert errors[2] < errors[1] / 3


@pytest.mark.parametrize(
    ("lens", "rays"), [(ROUGH, WIDE), (BOTH, GLOWING)], ids=["collimated, rear", "lambertian, both"]
)
def test_far_field_and_flux(backend, lens, rays):
    """No ray slips through between triangles, not even those on the grid lines; the rest are Fresnel
    losses."""
    exact, mesh = landings(backend, lens, rays, np.inf, (129, 129))
    assert distance(exact, mesh) < 0.02  # degrees: the interpolation of the normals again
    flux = [landing.flux.numpy() for landing in (exact, mesh)]
    assert np.abs(flux[0] - flux[1]).max() < 1e-3 * flux[0].max()
    assert (flux[1] > 0).sum() == (flux[0] > 0).sum()


def test_irradiance_of_a_smooth_lens_is_exact_but_for_float32(backend, problem_file):
    """On a paraboloid normals are linear but for the normalisation; landing errors of 1e-5 pixels remain."""
    system = System(load_problem(problem_file()))
    image = mesh_model(system, system.base, 129, 129).image(coefficients(system.base))
    exact = exact_image(backend, system, system.base, (129, 129), WINDOW)
    assert image.shape == exact.shape
    assert np.linalg.norm(image - exact) < 5e-5 * np.linalg.norm(exact)


def test_loss_and_gradient_come_near_those_of_the_exact_tracer(backend, problem_file):
    """Both fall short of the exact ones by the interpolation of the normals, h^2."""
    problem = load_problem(problem_file({"lens.front.freeform": {"spans": [3, 3]}}))
    lens = System(problem).base
    screen = System(problem).target.screen()
    target = System(problem).target.irradiance(screen, problem.source.flux)
    tracer = tracer_to(backend, lens, System(problem).source.rays((97, 97)), target_z(problem))
    objective = Objective(TracedModel(backend, tracer, screen, WINDOW), target, 0.0)
    at = [rough(sag.space, 0.02, k) for k, sag in enumerate(lens.sags)]
    exact = objective(at)
    losses, slopes = [], []
    for n in (65, 129):
        near = Objective(mesh_model(System(problem), lens, 97, n), target, 0.0)(at)
        losses.append(abs(near.loss - exact.loss) / exact.loss)
        slopes.append(
            [np.linalg.norm(a - b) / np.linalg.norm(b) for a, b in zip(near.gradients, exact.gradients)]
        )
    assert losses[1] < 1e-4
    assert max(slopes[1]) < 2e-3
    assert (np.array(slopes[1]) < np.array(slopes[0]) / 3).all()
