"""Refraction, and fluxes of the sequential tracer, against closed forms."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.integrate import dblquad

from optics.light.tracing.refraction import refract
from oracles.light_formulas import fresnel, meridional, refracted_vector
from tests.cases import examples
from tests.optics.cases import PLANE, landing_points, mesh, rough, small_lens, small_space, traced
from tests.optics.light.tracing.cases import INDEX
from thbcad.lens import FreeformSurface, Lens
from thbcad.sags import Conic
from thbcad.surfaces import THBSurface

# ---- fresnel and Snell ----


def test_normal_incidence_passes_96_percent(backend):
    direction, share, passes = refract(
        backend.dr, (0.0, 0.0, 1.0), (backend.Float(0.0), backend.Float(0.0)), 1 / INDEX
    )
    assert share.numpy()[0] == pytest.approx(0.96, rel=1e-15)
    assert passes.numpy().all()
    assert [float(np.asarray(d).ravel()[0]) for d in direction] == [0.0, 0.0, 1.0]


@pytest.mark.parametrize("eta", [1 / INDEX, INDEX])
def test_refraction_is_snells_law_in_space(backend, eta):
    rng = np.random.default_rng(4)
    slope = rng.uniform(-0.3, 0.3, (500, 2))
    direction = np.column_stack([rng.uniform(-0.2, 0.2, (500, 2)), np.ones(500)])
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    normal = np.column_stack([-slope, np.ones(500)])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    out, share, passes = refract(
        backend.dr,
        [backend.Float(d) for d in direction.T.copy()],
        [backend.Float(s) for s in slope.T.copy()],
        eta,
    )
    cosine = np.sum(direction * normal, axis=1)
    below = eta * np.sqrt(1 - cosine**2) < 0.99
    assert below.mean() > 0.9
    assert passes.numpy()[below].all()
    out = np.column_stack([d.numpy() for d in out])[below]
    np.testing.assert_allclose(np.linalg.norm(out, axis=1), 1, rtol=0, atol=1e-15 * 8)
    # cos_t = sqrt(1 - s^2) loses at most 1 / cos_t <= 8 of the digits where s < 0.99
    np.testing.assert_allclose(out, refracted_vector(direction, normal, eta)[below], rtol=0, atol=1e-14)
    np.testing.assert_allclose(
        share.numpy()[below], fresnel(np.arccos(cosine[below]), eta, 1.0), rtol=0, atol=1e-12
    )


def test_light_is_not_refracted_beyond_the_critical_angle_or_from_behind(backend):
    critical = np.tan(np.arcsin(1 / INDEX))
    slope = backend.Float([critical * (1 - 1e-9), critical * (1 + 1e-9), 0.0])
    dz = backend.Float([1.0, 1.0, -1.0])
    _, share, passes = refract(backend.dr, (0.0, 0.0, dz), (slope, 0.0), INDEX)
    np.testing.assert_array_equal(passes.numpy(), [True, False, False])
    assert share.numpy()[0] > 0
    assert not share.numpy()[1:].any()


# ---- fluxes ----


def test_flat_plate_passes_the_square_of_96_percent(backend):
    *_, budget, _ = traced(backend, small_lens(rear=PLANE))
    some = {"front_reflected": 0.04, "rear_reflected": 0.96 * 0.04, "on_target": 0.96**2}
    for name, flux in budget.by_name.items():
        assert flux == pytest.approx(some.pop(name, 0.0), abs=1e-13), name  # sums of 1517 rays
    assert not some


def test_flat_plate_lets_every_ray_go_straight_on(backend):
    hits, landing, _, beam = traced(backend, small_lens(rear=PLANE))
    x, y = mesh(beam)
    np.testing.assert_array_equal(landing.x.numpy(), x)
    np.testing.assert_array_equal(landing.y.numpy(), y)
    assert not hits.z.numpy().any()


def paraboloid_lens(half_width=(50.0, 50.0)):
    """Return a lens with plane front and the pearl example's rear."""
    space = small_space(half_width)
    sag = THBSurface(space, np.zeros(space.dim))
    return Lens(
        FreeformSurface(half_width), FreeformSurface(half_width, Conic(150.0, -1.0), sag), 20.0, INDEX
    )


def exact_transmission(half_width, radius):
    """Return the mean of T_front T_rear over the source square, by adaptive quadrature of one quadrant."""

    def share(y, x):
        return 0.96 * fresnel(np.arctan(np.hypot(x, y) / radius), INDEX, 1.0)

    integral, error = dblquad(share, 0, half_width, 0, half_width, epsabs=0, epsrel=1e-10)
    assert error < 1e-9 * integral
    return integral / half_width**2


def test_paraboloid_passes_the_integral_of_fresnels_formula(backend):
    """The midpoint rule's error is h^2 / 24 of the mean Laplacian: 4e-8 of the flux at 257 rays; twice the
    rays, a quarter of it."""
    exact = exact_transmission(47.5, 150.0)
    errors = []
    for rays in (64, 128, 257):
        *_, budget, _ = traced(backend, paraboloid_lens(), (47.5, 47.5), (rays, rays), 320.0, (100.0, 100.0))
        errors.append(abs(budget.transmitted / exact - 1))
    assert errors[-1] < 1e-6
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.05)


def test_total_internal_reflection_is_counted_ray_by_ray(backend):
    """Rear R = 10, K = -1: light is totally reflected where r / R passes tan(asin(1 / n))."""
    lens = small_lens(rear=Conic(10.0, -1.0))
    _, landing, budget, beam = traced(backend, lens, rays=(101, 101), target=(1e6, 1e6))
    x, y = mesh(beam)
    lost = np.hypot(x, y) / 10 > np.tan(np.arcsin(1 / INDEX))
    assert 0.1 < lost.mean() < 0.5
    assert budget.by_name["total_internal"] == pytest.approx(0.96 * lost.mean(), rel=1e-12)
    np.testing.assert_array_equal(landing.flux.numpy() == 0, lost)
    slopes = np.hypot(x, y)[~lost] / 10
    share = np.where(slopes > 0, fresnel(np.arctan(np.maximum(slopes, 1e-9)), INDEX, 1.0), 0.96)
    assert budget.transmitted == pytest.approx(
        0.96 * share.sum() / len(x), rel=1e-9
    )  # T = 0.96 + O(1e-18) at the axis


FATES = [
    (Conic(*front), Conic(*rear), source, rear_half_width)
    for front, rear in (
        ((np.inf, 0.0), (40.0, -1.0)),
        ((np.inf, 0.0), (11.0, -1.0)),
        ((60.0, 0.0), (-60.0, 0.0)),
        ((60.0, -1.0), (11.0, -1.0)),
        ((-60.0, 0.5), (40.0, 0.3)),
    )
    for source in ((9.5, 9.5), (14.0, 11.0))
    for rear_half_width in ((10.0, 10.0), (8.0, 9.0), (12.0, 10.0))
]


@pytest.mark.parametrize("rays", range(20, 28))
def test_no_fate_has_negative_light(backend, rays):
    """The rounding of sums made 2e-15 W of a beam that misses nothing pass beside the lens, or -2e-15 W."""
    _, _, budget, _ = traced(backend, small_lens(), (9.5, 9.5), (rays, rays + 3))
    assert min(budget.flux.values()) >= 0


@pytest.mark.parametrize(("front", "rear", "source", "rear_half_width"), FATES, ids=str)
def test_fates_sum_to_the_source_flux(backend, front, rear, source, rear_half_width):
    space = small_space(rear_half_width)
    lens = small_lens(front, rear, rough(space), rear_half_width, thickness=12.0, space=space)
    _, landing, budget, _ = traced(backend, lens, source)
    fates = budget.flux
    assert sum(fates.values()) == pytest.approx(1.0, abs=1e-12)
    assert min(fates.values()) >= 0
    assert np.isfinite(landing_points(landing)).all()
    beside = 1 - min(source[0], 10) * min(source[1], 10) / (source[0] * source[1])
    assert budget.by_name["beside_lens"] == pytest.approx(beside, abs=1e-13)  # sums of 1517 rays
    x, y = landing_points(landing).T
    inside = (np.abs(x) <= 20) & (np.abs(y) <= 20)
    assert budget.on_target == pytest.approx(landing.flux.numpy()[inside].sum(), abs=1e-12)


@examples(8)
@given(
    front=st.sampled_from([np.inf, 45.0, -45.0, 200.0]),
    constant=st.floats(-3, 1),
    source=st.tuples(st.floats(1, 30), st.floats(1, 30)),
    height=st.floats(0, 1.5),
    seed=st.integers(0, 99),
)
def test_fates_of_any_lens_sum_to_the_source_flux(backend, front, constant, source, height, seed):
    space = small_space()
    lens = small_lens(
        Conic(front, constant), Conic(40.0, constant), rough(space, height, seed), thickness=14.0, space=space
    )
    _, _, budget, _ = traced(backend, lens, source, (23, 29))
    assert budget.total == pytest.approx(1.0, abs=1e-12)
    assert min(budget.flux.values()) >= -1e-12


def test_rays_beside_a_smaller_rear_miss_it(backend):
    """Plane front, rear of 8 x 9 mm: the rays beyond it run into the edge faces, counted exactly."""
    _, landing, budget, beam = traced(backend, small_lens(PLANE, PLANE, None, (8.0, 9.0)))
    x, y = mesh(beam)
    beyond = (np.abs(x) > 8) | (np.abs(y) > 9)
    assert beyond.any()
    assert budget.missed_rear == pytest.approx(0.96 * beyond.mean(), abs=1e-12)
    assert not landing.flux.numpy()[beyond].any()


def test_rays_from_a_curved_front_miss_a_smaller_rear_where_geometry_says(backend):
    front, rear = Conic(60.0, -1.0), PLANE
    _, _, budget, beam = traced(backend, small_lens(front, rear, None, (8.0, 9.0)))
    x, y = mesh(beam)
    r = np.maximum(np.hypot(x, y), 1e-12)
    at_front = meridional(r)
    at_front = type(at_front)(r, r**2 / 120, at_front.angle, at_front.share).refracted(r / 60, 1.0, INDEX)
    scale = at_front.to(6.0).r / r
    beyond = (np.abs(x * scale) > 8) | (np.abs(y * scale) > 9)
    assert budget.missed_rear == pytest.approx(at_front.share[beyond].sum() / len(x), abs=1e-9)
