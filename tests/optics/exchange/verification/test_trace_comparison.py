"""Two traces of the same rays: what counts as another fate."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from optics.exchange.verification.reference_tracer import trace_step
from optics.exchange.verification.trace_comparison import compared
from optics.light.tracing import LandingPoints
from optics.scene.problem import load_problem
from optics.scene.system import OpticalSystem
from tests.optics.cases import write_problem
from thbcad.lens import placed_surfaces


@pytest.mark.parametrize("sigma", [0.05, 0.02, 0.01, 0.005])
def test_rays_too_weak_for_a_thread_have_no_other_fate(tmp_path, backend, sigma):
    """Threads of Dr.Jit may round subnormal numbers to none; those of numpy do not."""
    problem = load_problem(
        write_problem(tmp_path, {"source.profile": "gaussian", "source.sigma": [sigma, sigma]})
    )
    system = OpticalSystem(problem)
    front, rear = placed_surfaces(system.lens)
    faces = SimpleNamespace(front=front, rear=rear)
    subnormal = []

    def flushing(rays):
        seen = trace_step(faces, rays.origin.T, rays.direction.T, rays.flux, 1.5, system.target.receiver)
        weak = seen.flux < np.finfo(float).tiny
        subnormal.append(int((weak & (seen.flux > 0)).sum()))
        return LandingPoints(seen.points, np.where(weak, 0.0, seen.flux))

    seen = compared(system, system.lens, backend, (129, 129), flushing)
    assert seen.mismatched == 0
    assert seen.landing <= 1e-8
    assert (subnormal[0] > 0) == (sigma < 0.05)


def test_a_ray_with_light_that_arrives_in_one_trace_only_counts(tmp_path, backend):
    system = OpticalSystem(load_problem(write_problem(tmp_path)))
    front, rear = placed_surfaces(system.lens)
    faces = SimpleNamespace(front=front, rear=rear)

    def losing(rays):
        seen = trace_step(faces, rays.origin.T, rays.direction.T, rays.flux, 1.5, system.target.receiver)
        flux = seen.flux.copy()
        flux[:3] = 0.0
        flux[3] *= 1e-13
        return LandingPoints(seen.points, flux)

    assert compared(system, system.lens, backend, (9, 9), losing).mismatched == 4
