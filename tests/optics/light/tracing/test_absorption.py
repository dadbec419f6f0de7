"""Light that the lens absorbs: exp(-a t) along every path in it."""

import numpy as np
import pytest

from optics.light.analysis import measure
from optics.light.tracing import FATES, TargetArea, trace_nonsequential
from optics.scene.receivers import receiver_at
from optics.scene.sources import Rays, point_rays
from optics.scene.system import System
from oracles.light_formulas import refracted_vector
from tests.optics.cases import (
    GLOWING,
    PARABOLOID,
    PLANE,
    TARGET_Z,
    coefficients,
    rough,
    small_lens,
    small_space,
    small_system,
    traced,
    tracer_to,
)
from thbcad.lens import FreeformSurface, Lens
from thbcad.sags import Conic
from thbcad.surfaces import THBSurface

A = 0.05  # 1/mm: a quarter of the light in 6 mm
WINDOW = small_lens(rear=PLANE)
POINT = {"distance": 30.0, "flux": 2.0, "half_angle": 10.0, "exponent": 0.0, "shift": (0.0, 0.0)}


def test_a_plane_window_passes_exp_minus_a_t(backend):
    lit, dimmed = (
        tracer_to(backend, WINDOW, traced(backend, WINDOW)[3], TARGET_Z, absorption=a) for a in (0.0, A)
    )
    fates = []
    for tracer in (lit, dimmed):
        _, landing = tracer.trace(coefficients(WINDOW))
        fates.append(tracer.fates(landing, (20.0, 20.0)))
    kept, lost = np.exp(-A * WINDOW.thickness), fates[0].by_name["rear_reflected"]
    assert fates[1].on_target == pytest.approx(kept * fates[0].on_target, rel=1e-13)
    assert fates[1].by_name["absorbed"] == pytest.approx(0.96 * (1 - kept), rel=1e-12)
    assert fates[1].by_name["rear_reflected"] == pytest.approx(kept * lost, rel=1e-10)
    assert fates[1].total == pytest.approx(1, rel=1e-12)


def test_oblique_rays_take_a_longer_path(backend):
    """A point before a plane window, by numpy."""
    rays = point_rays(**POINT, counts=(31, 31))
    tracer = tracer_to(backend, WINDOW, rays, TARGET_Z, absorption=A)
    _, landing = tracer.trace(coefficients(WINDOW))
    _, clear = tracer_to(backend, WINDOW, rays, TARGET_Z).trace(coefficients(WINDOW))
    inside = refracted_vector(rays.direction.T, np.array([[0.0, 0.0, 1.0]]), 1 / 1.5)
    path = WINDOW.thickness / inside[:, 2]
    assert landing.flux.numpy() == pytest.approx(clear.flux.numpy() * np.exp(-A * path), rel=1e-12)


def test_behind_a_curved_rear_the_path_is_that_of_the_ray(backend):
    """Parallel light behind a plane front: t = thickness + z(x, y)."""
    lens = small_lens(sag=rough(small_space()))
    beam = traced(backend, lens)[3]
    _, landing = tracer_to(backend, lens, beam, TARGET_Z, absorption=A).trace(coefficients(lens))
    _, clear = tracer_to(backend, lens, beam, TARGET_Z).trace(coefficients(lens))
    x, y = np.meshgrid(beam.x, beam.y, indexing="ij")
    wanted = clear.flux.numpy() * np.exp(-A * (6.0 + lens.rear(x.ravel(), y.ravel())))
    assert landing.flux.numpy() == pytest.approx(wanted, rel=1e-12)


@pytest.mark.parametrize("front", [PLANE, Conic(60.0)], ids=["known", "searched"])
def test_no_absorption_is_what_there_was_before_bit_for_bit(backend, front):
    lens = small_lens(front=front, sag=rough(small_space()))
    beam = traced(backend, lens)[3]
    none, zero = (tracer_to(backend, lens, beam, TARGET_Z, **a) for a in ({}, {"absorption": 0.0}))
    landings = [tracer.trace(coefficients(lens))[1] for tracer in (none, zero)]
    assert landings[0].flux.numpy().tobytes() == landings[1].flux.numpy().tobytes()
    assert "absorbed" not in none.fates(landings[0], (20.0, 20.0)).by_name


def both_free():
    space = small_space()
    front = FreeformSurface((10.0, 10.0), Conic(80.0, -1.0), THBSurface(space, rough(space, seed=1)))
    rear = FreeformSurface((10.0, 10.0), PARABOLOID, THBSurface(space, rough(space, seed=2)))
    return Lens(front, rear, 6.0, 1.5)


CASES = {
    "parallel": (lambda: small_lens(sag=rough(small_space())), lambda lens: None),
    "point, both free": (both_free, lambda lens: point_rays(**POINT, counts=(21, 21))),
}


@pytest.mark.parametrize("name", CASES)
def test_the_gradient_counts_absorbed_light(backend, name):
    """The flux that arrives, against central differences: h^2 / 6 of the third derivative and 1e-16 F / h."""
    make, light = CASES[name]
    lens = make()
    rays = light(lens) or traced(backend, lens)[3]
    tracer = tracer_to(backend, lens, rays, TARGET_Z, fresnel=False, absorption=A)
    dr = backend.dr

    def flux(nets):
        with dr.suspend_grad():
            return float(dr.sum(tracer.trace(nets)[1].flux).numpy()[0])

    hits, landing = tracer.trace(coefficients(lens))
    dr.backward(dr.sum(landing.flux))
    gradients = tracer.pull_back(hits)
    size = np.sqrt(np.mean(np.concatenate(gradients) ** 2))
    rng = np.random.default_rng(3)
    for surface, gradient in enumerate(gradients):
        for _ in range(4):
            d = rng.standard_normal(len(gradient))
            d /= np.linalg.norm(d)
            steps = []
            for sign in (1, -1):
                nets = coefficients(lens)
                nets[surface] = nets[surface] + sign * 1e-4 * d
                steps.append(flux(nets))
            assert (steps[0] - steps[1]) / 2e-4 == pytest.approx(gradient @ d, abs=1e-8 * max(size, 1e-2))


def test_all_paths_in_a_plate_are_dimmed(backend):
    """Normal incidence with all reflections: T^2 u / (1 - R^2 u^2) passes, where u = exp(-a d)."""
    one = np.ones(1)
    rays = Rays(np.array([[0.3], [0.2], [-1.0]]), np.array([[0.0], [0.0], [1.0]]), one)
    plane = TargetArea(receiver_at(TARGET_Z), (20.0, 20.0), absorption=A)
    result = trace_nonsequential(backend, WINDOW, rays, plane, threshold=1e-15)
    r, u = 0.04, np.exp(-A * 6.0)
    passing = (1 - r) ** 2 * u / (1 - r**2 * u**2)
    assert result.fates.on_target == pytest.approx(passing, rel=1e-13)
    back = r + (1 - r) ** 2 * r * u**2 / (1 - r**2 * u**2)
    assert result.fates.back + result.fates.reflected_outside == pytest.approx(back, rel=1e-12)
    assert result.fates.absorbed == pytest.approx(1 - passing - back, rel=1e-12)
    assert result.by_ray[FATES.index("absorbed"), 0] == result.fates.absorbed


@pytest.mark.every(3)
@pytest.mark.parametrize(
    "changes",
    [
        {},
        pytest.param({"source.divergence": 0.3}, marks=pytest.mark.slow),
        {"source.kind": "point", "source.distance": 30.0, "source.half_angle": 12.0},
        GLOWING,
        pytest.param({"lens.rear.slope_rms": 0.002}, marks=pytest.mark.slow),
    ],
    ids=["cells", "beams", "point", "rays", "rough"],
)
def test_fates_sum_to_the_source_flux(tmp_path, backend, changes):
    """Measured light of every kind, and for spreading light all paths."""
    small = {"lens.absorption": A, "target.pixels": [16, 16], "source.flux": 3.0}
    system = small_system(tmp_path, changes | small)
    metrics = measure(system, backend).metrics
    assert sum(metrics["fates_w"].values()) == pytest.approx(3, rel=1e-12)
    assert 0.2 < metrics["fates_w"]["absorbed"] / 3 < 0.4
    if "nonsequential" in metrics:
        assert metrics["nonsequential"]["fates_w"]["absorbed"] > 0.3
    clear = System(system.problem.with_(**{"lens.absorption": 0.0}))
    assert measure(clear, backend).metrics["efficiency"] > metrics["efficiency"]
