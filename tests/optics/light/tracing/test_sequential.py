"""Landing points of the sequential tracer against closed forms and independent numerics."""

import numpy as np
import pytest

from optics.base.runtime import load_backend
from optics.light.intersections import KnownHits, SearchedHits
from optics.scene.sources import Profile, collimated_beam, single_rays
from oracles.light_formulas import fresnel, meridional
from tests.optics.cases import (
    PLANE,
    TARGET_Z,
    coefficients,
    landing_points,
    mesh,
    rough,
    small_lens,
    small_space,
    traced,
    tracer_to,
)
from tests.optics.light.tracing.cases import INDEX, step_trace
from thbcad.lens import FreeformSurface, Lens
from thbcad.sags import Conic
from thbcad.surfaces import THBSurface

# ---- landing points ----


def radial(x, y):
    """Return r and the unit vector (x, y) / r."""
    r = np.hypot(x, y)
    return r, np.column_stack([x, y]) / np.maximum(r, 1e-300)[:, None]


@pytest.mark.parametrize("radius", [40.0, -40.0, 20.0])
def test_paraboloid_rear_lands_by_snells_law(backend, radius):
    hits, landing, _, beam = traced(
        backend, small_lens(rear=Conic(radius, -1.0), thickness=12.0), rays=(40, 38), target_z=72.0
    )
    x, y = mesh(beam)
    r, unit = radial(x, y)
    ray = meridional(r)
    ray = (
        type(ray)(r, 12.0 + r**2 / (2 * radius), ray.angle, np.full_like(r, 0.96))
        .refracted(r / radius, INDEX, 1.0)
        .to(72.0)
    )
    np.testing.assert_allclose(landing_points(landing), ray.r[:, None] * unit, rtol=0, atol=1e-12)
    np.testing.assert_allclose(landing.flux.numpy(), ray.share * beam.flux.ravel(), rtol=1e-11)
    np.testing.assert_allclose(hits.z.numpy(), r**2 / (2 * radius), rtol=0, atol=1e-14)


@pytest.mark.parametrize("slope", [0.2, -0.35])
def test_tilted_plane_shifts_every_ray_alike(backend, slope):
    """Sag coefficients a g_i (Greville) make the plane z = a x."""
    space = small_space(refined=False)
    net = slope * np.repeat(space.kv_u.greville()[:, None], space.kv_v.dim, axis=1)
    _, landing, _, beam = traced(backend, small_lens(rear=PLANE, sag=net.ravel(), space=space))
    x, y = mesh(beam)
    incident = np.arctan(abs(slope))
    deflection = np.sign(slope) * np.tan(np.arcsin(INDEX * np.sin(incident)) - incident)
    np.testing.assert_allclose(landing.x.numpy(), x + (60 - slope * x) * deflection, rtol=0, atol=1e-12)
    np.testing.assert_allclose(landing.y.numpy(), y, rtol=0, atol=1e-13)  # slopes of 1e-16 times 60 mm
    np.testing.assert_allclose(
        landing.flux.numpy() / beam.flux.ravel(), 0.96 * fresnel(incident, INDEX, 1.0), rtol=1e-13
    )


@pytest.mark.parametrize("radius", [60.0, -60.0])
def test_paraboloid_front_and_plane_rear_land_by_snells_law(backend, radius):
    _, landing, _, beam = traced(
        backend, small_lens(Conic(radius, -1.0), PLANE, rear_half_width=(12.0, 12.0)), rays=(40, 38)
    )
    x, y = mesh(beam)
    r, unit = radial(x, y)
    ray = meridional(r)
    ray = type(ray)(r, r**2 / (2 * radius), ray.angle, ray.share).refracted(r / radius, 1.0, INDEX).to(6.0)
    ray = ray.refracted(0.0, INDEX, 1.0).to(TARGET_Z)
    np.testing.assert_allclose(landing_points(landing), ray.r[:, None] * unit, rtol=0, atol=1e-12)
    np.testing.assert_allclose(landing.flux.numpy(), ray.share * beam.flux.ravel(), rtol=1e-11)


def test_sphere_front_sends_parallel_light_through_its_focus(backend):
    """Paraxial rays of a sphere and a plane meet at R / (n - 1) minus the thickness's share; the error falls
    as r^3."""
    lens = small_lens(Conic(50.0, 0.0), PLANE)
    focus = 6.0 + (50 * INDEX / (INDEX - 1) - 6.0) / INDEX
    errors = []
    for reach in (0.4, 0.2):
        _, landing, _, _ = traced(backend, lens, (reach, reach), (10, 10), focus)
        errors.append(np.abs(landing_points(landing)).max())
    assert errors[0] / errors[1] == pytest.approx(8, rel=0.01)


@pytest.mark.parametrize("radius", [1e9, 1e13])
def test_searched_and_known_hits_agree_on_a_nearly_flat_front(backend, radius):
    space = small_space()
    sag = rough(space, 0.05)
    known, searched = (traced(backend, small_lens(f, sag=sag, space=space)) for f in (PLANE, Conic(radius)))
    # a front of radius R turns rays by less than r / R; sag height, slope and path enlarge that no more than
    # tenfold
    bound = 10 * (14 / radius) * (TARGET_Z + 14) + 1e-11
    assert np.abs(landing_points(known[1]) - landing_points(searched[1])).max() < bound
    assert np.abs(known[0].z.numpy() - searched[0].z.numpy()).max() < bound
    assert searched[2].transmitted == pytest.approx(known[2].transmitted, rel=bound)
    for front, kind in ((PLANE, KnownHits), (Conic(radius), SearchedHits)):
        tracer = tracer_to(backend, small_lens(front), known[3], TARGET_Z)
        assert isinstance(tracer._surfaces[1].hits, kind)


def test_searched_points_lie_on_ray_and_surface(backend):
    """Every hit satisfies z = conic + sag at (x, y), with the surface's own slopes, evaluated by the
    kernel."""
    space = small_space()
    lens = small_lens(Conic(35.0, -0.5), Conic(40.0, 0.3), rough(space, 0.3), space=space)
    hits, *_ = traced(backend, lens)
    assert hits.hit.numpy().all()
    x, y = hits.x.numpy(), hits.y.numpy()
    for derivative, found in (((0, 0), hits.z), ((1, 0), hits.zx), ((0, 1), hits.zy)):
        np.testing.assert_allclose(found.numpy(), lens.rear(x, y, derivative), rtol=0, atol=1e-12)


@pytest.mark.parametrize("front", [PLANE, Conic(60.0, -1.0), Conic(-60.0, -1.0)], ids=str)
def test_independent_trace_of_the_step_file_lands_at_the_same_points(backend, tmp_path, front):
    space = small_space()
    lens = small_lens(front, Conic(40.0, -1.0), rough(space, 0.05), thickness=12.0, space=space)
    _, landing, _, beam = traced(backend, lens)
    reference = step_trace(lens, single_rays(beam, lens), tmp_path)
    flux = landing.flux.numpy()
    np.testing.assert_array_equal(flux > 0, reference.flux > 0)
    arrives = flux > 0
    assert arrives.mean() > 0.9
    np.testing.assert_allclose(
        landing_points(landing)[arrives], reference.points[arrives], rtol=0, atol=1e-10
    )
    np.testing.assert_allclose(flux, reference.flux, rtol=0, atol=1e-12 * beam.flux.max())


def test_independent_trace_counts_total_reflection_alike(backend, tmp_path):
    lens = small_lens(PLANE, Conic(10.0, -1.0))
    _, landing, _, beam = traced(backend, lens)
    reference = step_trace(lens, single_rays(beam, lens), tmp_path)
    assert (reference.flux == 0).any()
    np.testing.assert_array_equal(landing.flux.numpy() > 0, reference.flux > 0)
    assert np.isnan(reference.points[reference.flux == 0]).all()


def test_light_that_would_turn_back_is_lost(backend):
    """n = 2.5, front R = 5, rear tilted by 20 degrees: close to the critical angle some rays leave by more
    than 90 degrees to the axis."""
    tilt, radius, index, thickness = np.radians(20), 5.0, 2.5, 40.0
    space = small_space((30.0, 30.0), refined=False)
    net = -np.tan(tilt) * np.repeat(space.kv_u.greville()[:, None], space.kv_v.dim, axis=1)
    rear = FreeformSurface((30.0, 30.0), PLANE, THBSurface(space, net.ravel()))
    lens = Lens(FreeformSurface((10.0, 10.0), Conic(radius, -1.0)), rear, thickness, index)
    _, landing, budget, beam = traced(backend, lens, (10.0, 1e-6), (2000, 1), 100.0)
    ray = meridional(-beam.x)  # mirrored, so that the normal leans towards -r as in the formulas
    ray = ray.refracted(-beam.x / radius, 1.0, index)
    beyond_critical = np.abs(np.sin(ray.angle + tilt)) >= 1 / index
    with np.errstate(invalid="ignore"):
        out = np.where(beyond_critical, np.nan, ray.refracted(np.tan(tilt), index, 1.0).angle)
    backwards = np.abs(out) > np.pi / 2
    assert backwards.sum() > 10
    np.testing.assert_array_equal(landing.flux.numpy() == 0, beyond_critical | backwards)
    assert budget.by_name["total_internal"] == pytest.approx(
        ray.share[beyond_critical | backwards].sum() / 2000, rel=1e-9
    )


# ---- limits ----


@pytest.mark.parametrize("front", [PLANE, Conic(60.0, 0.0)], ids=str)
def test_single_precision_makes_the_same_light(front, backend):
    """run.precision = "single" may cost digits (float32: 6e-8), never rays."""
    space = small_space()
    lens = small_lens(front, sag=rough(space, 0.01), space=space)
    *_, exact, _ = traced(backend, lens)
    *_, rounded, _ = traced(load_backend("single", 1), lens)
    for name, value in vars(exact).items():
        if name not in ("on_target", "off_target"):
            assert getattr(rounded, name) == pytest.approx(value, abs=2e-5), (
                name
            )  # 1517 sums at 6e-8 each, not all of one sign
    assert rounded.transmitted == pytest.approx(exact.transmitted, abs=2e-5)


@pytest.mark.parametrize("front", [PLANE, Conic(60.0, -1.0)])
def test_rays_of_a_profile_keep_their_own_flux(backend, front):
    """Each ray's flux is its share of the uniform beam's times its density; the fates still sum to the source
    flux."""
    lens = small_lens(front, rear_half_width=(12.0, 12.0))
    rays, profile = (31, 29), Profile("gaussian")
    landings = []
    for chosen in (Profile(), profile):
        beam = collimated_beam((9.5, 9.5), 2.0, (10.0, 10.0), rays, profile=chosen)
        tracer = tracer_to(backend, lens, beam, TARGET_Z)
        _, landing = tracer.trace(coefficients(lens))
        budget = tracer.fates(landing, (20.0, 20.0))
        assert budget.total == pytest.approx(2.0, rel=1e-13)
        landings.append(landing.flux.numpy())
    s, t = ((2 * np.arange(n) + 1) / n - 1 for n in rays)
    density = profile(s[:, None], t[None, :]).ravel()
    share = density / density.mean()  # all light meets the lens, whatever the midpoint rule says
    np.testing.assert_allclose(landings[1], landings[0] * share, rtol=1e-12)
