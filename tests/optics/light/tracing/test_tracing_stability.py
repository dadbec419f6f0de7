"""Tracing where it is hardest: against exact rays, in other units, at the ends of the ranges."""

from dataclasses import replace
from decimal import Decimal, localcontext

import numpy as np
import pytest

from optics.base.runtime import load_backend
from optics.designing.optimisation import Objective
from optics.light.engines import TracedModel
from optics.light.tracing.refraction import refract
from optics.scene.receivers import BSplineWindow, Screen
from optics.scene.sources import Profile, Rays, collimated_beam
from oracles.exact_rays import ARRIVES, Quadric, Setup, exact_trace
from oracles.tracing_accuracy import LIMIT, cases, measure
from tests.cases import THOROUGH
from tests.optics.cases import coefficients, hollow_lens, lambertian_parts, rough, tracer_to
from tests.optics.light.tracing.cases import step_trace
from thbcad import Conic, FreeformSurface, KnotVector, Lens, THBSpace, THBSurface

CASES = {case.name: case for case in cases()}
QUICK = ["degree 2", "degree 10", "lengths times 1e-06", "lengths times 1e+06"]
QUICK += ["extended source in the far field", "parallel beam in the far field"]
SOURCES = "point source", "extended source", "parallel beam"
HARD = [name for name in CASES if not name.startswith(("degree", "lengths", *SOURCES))]
SAMPLED = "light of the sun", "rays of a file"  # four dimensions: many exact rays


@pytest.fixture(scope="module")
def single():
    """Dr.Jit in single precision."""
    return load_backend("single", 1)


def asked(names, often):
    """Return (name, step): every third ray in `make test`; all, exact ones too, in `make slow`.

    Where all are asked for, every third is not traced once more.
    """
    return [
        *((name, 3) for name in names if often(name) and not THOROUGH),
        *(pytest.param(name, 1, marks=pytest.mark.slow) for name in names),
    ]


@pytest.mark.every(6)
@pytest.mark.parametrize(("name", "step"), asked([*HARD, *QUICK], lambda name: not name.startswith(SAMPLED)))
def test_rays_are_exact_to_the_rounding_of_their_data(backend, name, step):
    require_exact(backend, name, step)


@pytest.mark.every(2)
@pytest.mark.parametrize(("name", "step"), asked(HARD, HARD[::3].__contains__))
def test_rays_in_single_precision_are_exact_to_its_rounding(single, name, step):
    require_exact(single, name, step)


def require_exact(backend, name, step):
    case = CASES[name]
    if case.grid is None and not name.startswith(SAMPLED):
        setup = case.setup
        rays = {"origin": setup.origin[:, ::step], "direction": setup.direction[:, ::step]}
        case = replace(case, setup=replace(setup, **rays))
    found = measure(backend, case)
    assert found.points <= LIMIT
    assert found.shares <= LIMIT
    assert (found.wrong, found.unresolved, found.numberless) == (0, 0, 0)


def test_the_referee_knows_the_ray_through_a_plate():
    """A plate shifts a ray by d tan(b) and passes T^2: closed forms in double precision."""
    plate = Quadric((0.0, 0.0, 0.0, 0.0, 0.0), 8.0)
    sine = np.array([0.0, 0.3, 0.9])
    origin, direction = (
        np.stack([0 * sine, 0 * sine, 0 * sine - 1]),
        np.stack([sine, 0 * sine, np.sqrt(1 - sine**2)]),
    )
    traced = exact_trace(Setup(plate, plate, 2.0, 1.5, 10.0, origin, direction))
    inside, outside = np.tan(np.arcsin(sine / 1.5)), np.tan(np.arcsin(sine))
    np.testing.assert_array_equal(traced.fate, ARRIVES)
    np.testing.assert_allclose(traced.x.astype(float), 11 * outside + 2 * inside, rtol=1e-14)
    assert float(traced.share[0]) == pytest.approx(0.96**2, rel=1e-15)


def test_the_referee_knows_the_angles_of_the_far_field():
    """Behind a plate rays keep their directions: atan(d_x / d_z) in double precision."""
    plate = Quadric((0.0, 0.0, 0.0, 0.0, 0.0), 80.0)
    sine = np.array([-0.99, 1e-9, 0.3, 0.9])
    origin, direction = np.zeros((3, 4)), np.stack([sine, 0 * sine, np.sqrt(1 - sine**2)])
    traced = exact_trace(Setup(plate, plate, 2.0, 1.5, np.inf, origin, direction))
    np.testing.assert_allclose(traced.x.astype(float), np.degrees(np.arctan2(sine, direction[2])), rtol=1e-13)


# Other units


@pytest.mark.parametrize("precision", ["double", "single"])
def test_a_lens_in_other_units_gives_the_same_bits(precision):
    """Powers of two scale without rounding: nothing in the tracer may be an absolute length."""
    backend = load_backend(precision, 1)
    base = hollow_lens(rough_300(8), rough_300(5), (4, 4))
    rays = next(lambertian_parts((0.5, 0.5), 2.0, 1.0, 89.9, Profile(), 1 << 12, 3, 1 << 12))
    expected = landing(backend, base, rays, 1000.0)
    assert 0.5 < (expected[2] > 0).mean() < 1
    for power in (-20, -10, 10, 20):
        k = 2.0**power
        moved = Rays(rays.origin * k, rays.direction, rays.flux)
        x, y, flux, found = landing(backend, scaled(base, k), moved, 1000.0 * k)
        np.testing.assert_array_equal(found, expected[3])
        np.testing.assert_array_equal(flux, expected[2])
        np.testing.assert_array_equal([x / k, y / k], expected[:2])


def rough_300(seed):
    return lambda space: rough(space, 0.3, seed)


def landing(backend, lens, rays, target_z):
    """Return (x, y, flux, found) of the rays, (n,) each."""
    _, end = tracer_to(backend, lens, rays, target_z).trace(coefficients(lens))
    return [a.numpy() for a in (end.x, end.y, end.flux, end.passages[1].found)]


def scaled(lens, k):
    """Return the lens in other units."""
    surfaces = []
    for surface in (lens.front, lens.rear):
        half = tuple(k * h for h in surface.half_width)
        space = surface.sag.space
        space = THBSpace(*(KnotVector(kv.degree, kv.knots * k) for kv in (space.kv_u, space.kv_v)))
        sag = THBSurface(space, surface.sag.coefficients * k)
        surfaces.append(FreeformSurface(half, Conic(surface.conic.radius * k, surface.conic.constant), sag))
    return Lens(*surfaces, lens.thickness * k, lens.index)


# Refraction alone


@pytest.mark.parametrize("eta", [1.5, 1 / 1.5])
@pytest.mark.parametrize("exponent", range(-12, -2))
def test_small_shares_of_light_keep_their_digits(backend, eta, exponent):
    """At 10^exponent from grazing incidence, or from the critical angle, T = 1 - R is small: no digits may
    cancel in it."""
    if eta > 1:
        away = np.arcsin(1 / eta) - 10.0**exponent
        direction = np.array([np.sin(away), 0.0, np.cos(away)])
    else:
        direction = np.array([1.0, 0.0, 10.0**exponent])
    _, share, passes = refract(
        backend.dr, [backend.array([a]) for a in direction], (backend.Float(0), backend.Float(0)), eta
    )
    assert passes.numpy()[0]
    with localcontext() as context:
        context.prec = 50
        c, n = Decimal(float(direction[2])), Decimal(eta)
        t = (1 - n * n * (1 - c * c)).sqrt()
        exact = 1 - (((n * c - t) / (n * c + t)) ** 2 + ((c - n * t) / (c + n * t)) ** 2) / 2
        # t = sqrt(1 - n^2 (1 - c^2)) has 4 roundings in a difference of terms below n^2, and dt = d(t^2) / 2t
        bound = Decimal(2.0**-53) * (8 + 4 * n * n / (t * t))
        assert abs(Decimal(float(share.numpy()[0])) / exact - 1) < bound


# The ends of the ranges


@pytest.mark.parametrize("height", [1e-12, 1e-6, 1e-3, 1.4])
def test_every_ray_is_decided_whatever_z_freedom_allows(backend, height):
    """From sags far below the resolution to a rear that nearly meets the front, rays up to 89.9 degrees."""
    lens = hollow_lens(lambda space: rough(space, height), lambda space: rough(space, height, 6), (6, 6))
    rays = next(lambertian_parts((0.5, 0.5), 1.5, 1.0, 89.9, Profile(), 1 << 12, 3, 1 << 12))
    tracer = tracer_to(backend, lens, rays, 1000.0)
    hits, end = tracer.trace(coefficients(lens))
    counts = tracer.counts(end, (1e9, 1e9))
    assert counts["unresolved"] == 0
    assert counts["on_target"] > 1000
    for surface, found in zip((lens.front, lens.rear), hits):
        x, y, z, hit = (np.broadcast_to(a.numpy(), 1 << 12) for a in (found.x, found.y, found.z, found.hit))
        assert np.isfinite([x, y, z]).all()
        offset = 0.0 if surface is lens.front else lens.thickness
        # heights up to 10 mm over slopes up to 3 at x that is wrong by a few roundings of 10 mm
        np.testing.assert_allclose(
            z[hit], surface(x[hit], y[hit]), rtol=0, atol=64 * 2**-53 * 10, err_msg=str(offset)
        )


@pytest.mark.parametrize("free_front", [True, False])
def test_parallel_rays_beside_the_rear_leave_numbers(backend, free_front):
    """Rays along z that are never above the rear's rectangle have no meeting point; loss and gradient stay
    numbers."""
    surfaces = []
    for half, conic in ((10.0, Conic()), (8.0, Conic(40.0, -1.0))):
        kv = KnotVector.uniform(3, 4, -half, half)
        space = THBSpace(kv, kv)
        surfaces.append(FreeformSurface((half, half), conic, THBSurface(space, np.zeros(space.dim))))
    front = surfaces[0] if free_front else FreeformSurface((10.0, 10.0))
    lens = Lens(front, surfaces[1], 6.0, 1.5)
    tracer = tracer_to(backend, lens, collimated_beam((9.5, 9.5), 1.0, (10, 10), (33, 33)), 66.0)
    model = TracedModel(backend, tracer, Screen((20, 20), (24, 24), 4), BSplineWindow(3))
    objective = Objective(model, np.ones((24, 24)) / 1600, 100.0)
    found = objective(coefficients(lens))
    assert np.isfinite(found.loss)
    assert all(np.isfinite(g).all() and g.any() for g in found.gradients)


def test_rays_along_a_plane_and_straight_down_leave_numbers(backend):
    """Directions at which ray or slope divides by zero: decided, and no light."""
    lens = hollow_lens(lambda space: rough(space, 0.1))
    flat = Lens(FreeformSurface((5.0, 5.0)), lens.rear, 9.0, 1.5)
    origin = np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 0.0], [0.0, 0.0, -1.0], [9.0, 0.0, -1.0]]).T
    direction = np.array([[1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 0.0, 1.0]]).T
    x, y, flux, found = landing(backend, flat, Rays(origin, direction, np.ones(origin.shape[1])), 1000.0)
    assert np.isfinite([x, y]).all()
    np.testing.assert_array_equal(flux, 0)
    assert found.all()


def test_rays_that_are_no_numbers_are_counted_as_unresolved(backend):
    lens = hollow_lens(lambda space: rough(space, 0.1))
    origin = np.array([[0.0, 0.0, -2.0]] * 4).T
    direction = np.array([[0.0, 0.0, 1.0], [np.nan, 0.0, 1.0], [0.0, 0.0, np.nan], [0.0, np.nan, 1.0]]).T
    tracer = tracer_to(backend, lens, Rays(origin, direction, np.ones(4)), 1000.0)
    _, end = tracer.trace(coefficients(lens))
    assert tracer.counts(end, (2000.0, 2000.0))["unresolved"] == 3


# The independent tracer


@pytest.mark.parametrize("k", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("distance", [0.0, 1e-6, 2.0])
def test_the_independent_tracer_agrees_in_any_units_and_from_the_front_itself(backend, tmp_path, k, distance):
    half = 8.0 * k
    kv = KnotVector.uniform(3, 4, -half, half)
    space = THBSpace(kv, kv)
    rear = FreeformSurface((half, half), Conic(-20.0 * k, -1.0), THBSurface(space, rough(space, 0.1 * k)))
    lens = Lens(FreeformSurface((5.0 * k, 5.0 * k)), rear, 6.0 * k, 1.5)
    rays = next(lambertian_parts((0.5 * k, 0.5 * k), distance * k, 1.0, 60.0, Profile(), 1 << 10, 3, 1 << 10))
    other = step_trace(lens, rays, tmp_path, 100.0 * k)
    x, y, flux, _ = landing(backend, lens, rays, 100.0 * k)
    np.testing.assert_array_equal(flux > 0, other.flux > 0)
    assert (flux > 0).mean() > 0.5
    arrives = flux > 0
    # the reference stops its steps at 1e-12 of the parameters, 1.6e-11 of 8 mm; the way on to the target
    # enlarges it tenfold
    np.testing.assert_allclose(
        np.column_stack([x, y])[arrives], other.points[arrives], rtol=0, atol=2e-10 * k
    )
    np.testing.assert_allclose(flux[arrives], other.flux[arrives], rtol=1e-9)
