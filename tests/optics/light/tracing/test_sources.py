"""Glowing areas, points and beams through lenses with one or two free surfaces, to a plane or to the far
field."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from optics.scene.sources import Profile, collimated_beam, point_rays, single_rays
from oracles.light_formulas import fresnel, fresnel_parts, meridional
from tests.cases import examples
from tests.optics.cases import (
    coefficients,
    hollow_lens,
    lambertian_parts,
    landing_points,
    rough,
    small_lens,
    small_space,
    tracer_to,
)
from tests.optics.light.tracing.cases import step_trace
from thbcad.lens import FreeformSurface, Lens
from thbcad.sags import Conic
from thbcad.surfaces import THBSurface

PLANE, INDEX = Conic(), 1.5
FAR = np.inf
TARGET_Z = 1005.0


def glowing(count=1 << 12, half_angle=90.0, half_width=(0.5, 0.5), distance=2.0):
    """Return the rays of a Lambertian source of 1 W."""
    return next(lambertian_parts(half_width, distance, 1.0, half_angle, Profile(), count, 0, 1 << 40))


def pointed(counts=(61, 59), half_angle=90.0, exponent=1.0, distance=2.0):
    return point_rays(distance, 1.0, half_angle, exponent, counts, (0.0, 0.0))


def rough_by(height, seed=5):
    """Return a function that makes coefficients which fall to zero at the rim, so that the ruled edges stay
    clear of the surface."""

    def made(space):
        a, b = (np.linspace(-1, 1, kv.dim) for kv in (space.kv_u, space.kv_v))
        return rough(space, height, seed) * ((1 - a**2)[:, None] * (1 - b**2)).ravel()

    return made


def traced(backend, lens, rays, target_z=TARGET_Z, target=(2000.0, 2000.0)):
    """Return (Landing, SequentialFates, Hits of the free surfaces)."""
    tracer = tracer_to(backend, lens, rays, target_z)
    hits, landing = tracer.trace(coefficients(lens))
    return landing, tracer.fates(landing, target), hits


# Fates


@examples(15)
@given(
    height=st.floats(0, 1.5),
    on_front=st.none() | st.floats(0, 1.0),
    spans=st.tuples(*[st.integers(1, 8)] * 2),
    kind=st.sampled_from(["lambertian", "point"]),
    half_angle=st.floats(1, 90),
    distance=st.floats(1.5, 30),
    target_z=st.sampled_from([TARGET_Z, 40.0, FAR]),
    seed=st.integers(0, 99),
)
def test_fates_sum_to_the_flux_and_every_ray_is_resolved(
    backend, height, on_front, spans, kind, half_angle, distance, target_z, seed
):
    """Rough sags up to the bound of the example, rays up to grazing."""
    front = None if on_front is None else rough_by(on_front, seed + 1)
    lens = hollow_lens(rough_by(height, seed), front, spans)
    rays = (
        glowing(1 << 9, half_angle, distance=distance)
        if kind == "lambertian"
        else pointed((23, 21), half_angle, distance=distance)
    )
    landing, budget, _ = traced(backend, lens, rays, target_z, (60.0, 60.0))
    fates = budget.flux
    assert sum(fates.values()) == pytest.approx(1.0, abs=1e-12)
    assert min(fates.values()) >= -1e-12
    assert budget.by_name["unresolved"] == 0
    assert np.isfinite(landing_points(landing)).all()
    onto = (np.abs(landing_points(landing)) <= 60).all(axis=1)
    assert budget.on_target == pytest.approx(landing.flux.numpy()[onto].sum(), abs=1e-12)


@pytest.mark.parametrize("distance", [2.0, 7.0])
def test_a_point_misses_the_front_as_solid_angles_say(backend, distance):
    """A rectangle a x b at distance d fills 4 atan(a b / (d sqrt(a^2 + b^2 + d^2))) of 2 pi.

    On n x n equal-area cells the rectangle's border, at most four cells per row of cells, is miscounted: 4 /
    n at the very most.
    """
    a, b, n = 10.0, 10.0, 200
    filled = 4 * np.arctan(a * b / (distance * np.sqrt(a * a + b * b + distance**2))) / (2 * np.pi)

    def missed(count):
        rays = pointed((count, count), 90.0, 0.0, distance)
        return traced(backend, small_lens(), rays)[1].by_name["beside_lens"]

    assert missed(n) == pytest.approx(1 - filled, abs=4 / n)
    errors = [abs(missed(m) - (1 - filled)) for m in (25, 100, 400)]
    assert errors[2] < max(errors[0] / 4, 1e-4)


@pytest.mark.parametrize("distance", [2.0, 7.0])
def test_a_small_glowing_area_misses_the_front_as_its_form_factor_says(backend, distance):
    """F = 2 / pi [X / sqrt(1 + X^2) atan(Y / sqrt(1 + X^2)) + ...] of a rectangle over its middle; Sobol
    points err by less than n^-1/2."""
    x = y = 10.0 / distance
    factor = (
        2
        / np.pi
        * (
            x / np.hypot(1, x) * np.arctan(y / np.hypot(1, x))
            + y / np.hypot(1, y) * np.arctan(x / np.hypot(1, y))
        )
    )
    count = 1 << 15
    _, budget, _ = traced(backend, small_lens(), glowing(count, half_width=(1e-6, 1e-6), distance=distance))
    assert budget.by_name["beside_lens"] == pytest.approx(1 - factor, abs=count**-0.5)


# Against the independent trace of the STEP file

LENSES = {
    "no sag": hollow_lens(),
    "rear": hollow_lens(rough_by(1.5)),
    "rear, 4 x 3 spans": hollow_lens(rough_by(0.5), spans=(4, 3)),
    "rear, bumps": hollow_lens(rough_by(1.5), spans=(16, 16)),
    "both": hollow_lens(rough_by(1.0), rough_by(0.3, 6)),
    "both, 5 x 8 spans": hollow_lens(rough_by(0.3), rough_by(0.1, 6), (5, 8)),
}
RAYS = {
    "lambertian": glowing(1 << 11),
    "point": pointed(),
    "collimated": collimated_beam((4.5, 7.0), 1.0, (5.0, 5.0), (41, 37)),
}


@pytest.mark.every(5)
@pytest.mark.parametrize("target_z", [TARGET_Z, FAR])
@pytest.mark.parametrize("rays", RAYS)
@pytest.mark.parametrize("lens", LENSES)
def test_the_independent_trace_of_the_step_file_agrees_ray_by_ray(backend, tmp_path, lens, rays, target_z):
    """Its meeting points are within 1e-12 of 16 mm; curvatures and grazing exits enlarge that to angles of
    1e-11 at the most.

    A landing point L tan(theta) errs by L (1 + tan^2) of the angle.
    """
    lens, rays = LENSES[lens], RAYS[rays]
    landing, budget, _ = traced(backend, lens, rays, target_z)
    one_by_one = single_rays(rays, lens)
    reference = step_trace(lens, one_by_one, tmp_path, target_z)
    points, flux = landing_points(landing), landing.flux.numpy()
    np.testing.assert_array_equal(flux > 0, reference.flux > 0)
    arrives = flux > 0
    assert arrives.mean() > 0.5
    found, expected = points[arrives], reference.points[arrives]
    length = TARGET_Z - 5.0
    allowed = (
        np.degrees(1e-11)
        if np.isinf(target_z)
        else 1e-11 * (length + np.square(expected).sum(axis=1, keepdims=True) / length)
    )
    assert (np.abs(found - expected) <= allowed).all()
    np.testing.assert_allclose(flux, reference.flux, rtol=0, atol=1e-10 * flux.max())
    assert budget.transmitted == pytest.approx(reference.flux.sum(), rel=1e-10)
    assert budget.by_name["unresolved"] == 0


# Closed forms


def squares(space, radius):
    """Return the coefficients of (x^2 + y^2) / (2 R): the blossom of t^2 at three knots, averaged over their
    pairs."""
    rows = []
    for kv in (space.kv_u, space.kv_v):
        t = np.stack([kv.knots[k : k + kv.dim] for k in (1, 2, 3)])
        rows.append((t[0] * t[1] + t[1] * t[2] + t[2] * t[0]) / 3)
    return ((rows[0][:, None] + rows[1][None, :]) / (2 * radius)).ravel()


@pytest.mark.parametrize("target_z", [66.0, FAR], ids=["plane", "far"])
@pytest.mark.parametrize("radius", [60.0, -40.0])
def test_a_front_that_is_a_spline_paraboloid_is_the_conic(backend, radius, target_z):
    """A plane with the sag r^2 / (2 R) is the paraboloid, in a beam and before a point."""
    space = small_space(refined=False)
    by_conic = small_lens(Conic(radius, -1.0), rear_half_width=(12.0, 12.0), thickness=12.0)
    front = FreeformSurface((10.0, 10.0), PLANE, THBSurface(space, squares(space, radius)))
    by_spline = Lens(front, by_conic.rear, 12.0, INDEX)
    for rays in (
        collimated_beam((9.5, 9.5), 1.0, (10.0, 10.0), (31, 29)),
        pointed((31, 29), 40.0, distance=9.0),
    ):
        one, other = (traced(backend, lens, rays, target_z)[0] for lens in (by_conic, by_spline))
        np.testing.assert_allclose(other.flux.numpy(), one.flux.numpy(), rtol=0, atol=1e-15)
        arrives = one.flux.numpy() > 0
        assert arrives.mean() > 0.5
        np.testing.assert_allclose(
            landing_points(other)[arrives], landing_points(one)[arrives], rtol=1e-12, atol=1e-11
        )


def test_both_surfaces_report_their_hits(backend):
    """Front first; both lie on their surfaces, evaluated by the kernel."""
    lens = hollow_lens(rough_by(0.5), rough_by(0.3, 6), (4, 3))
    for rays in RAYS.values():
        _, _, hits = traced(backend, lens, rays)
        assert len(hits) == 2
        for at, surface in zip(hits, (lens.front, lens.rear)):
            hit = at.hit.numpy()
            assert hit.mean() > 0.5
            x, y = at.x.numpy()[hit], at.y.numpy()[hit]
            for derivative, found in (((0, 0), at.z), ((1, 0), at.zx), ((0, 1), at.zy)):
                np.testing.assert_allclose(found.numpy()[hit], surface(x, y, derivative), rtol=0, atol=1e-11)


@pytest.mark.parametrize("distance", [2.0, 30.0])
def test_a_plate_keeps_every_direction(backend, distance):
    """In the far field a plate lands light at the angles of its own directions; flux passes Fresnel's formula
    twice."""
    rays = pointed((41, 39), 50.0, 2.0, distance)
    landing, _, _ = traced(backend, small_lens(rear=PLANE, rear_half_width=(60.0, 60.0)), rays, FAR)
    p, q, cosine = rays.direction
    arrives = landing.flux.numpy() > 0
    reach = np.maximum(np.abs(p), np.abs(q)) / cosine * distance
    np.testing.assert_array_equal(arrives, reach < 10)
    assert arrives.mean() > 0.05
    expected = np.degrees(np.arctan(np.stack([p, q], axis=1) / cosine[:, None]))
    np.testing.assert_allclose(landing_points(landing)[arrives], expected[arrives], rtol=0, atol=1e-12)
    angle = np.maximum(np.arccos(cosine), 1e-6)  # T = 0.96 + O(1e-24) at the axis
    inner = np.arcsin(np.sin(angle) / INDEX)
    share = (fresnel_parts(angle, 1.0, INDEX) * fresnel_parts(inner, INDEX, 1.0)).mean(axis=0)
    np.testing.assert_allclose(landing.flux.numpy()[arrives], (rays.flux * share)[arrives], rtol=1e-9)


@pytest.mark.parametrize("radius", [40.0, -25.0])
def test_a_paraboloid_in_a_beam_shows_its_angles_in_the_far_field(backend, radius):
    beam = collimated_beam((9.5, 9.5), 1.0, (10.0, 10.0), (21, 20))
    landing, _, _ = traced(backend, small_lens(rear=Conic(radius, -1.0), thickness=12.0), beam, FAR)
    x, y = np.repeat(beam.x, 20), np.tile(beam.y, 21)
    r = np.hypot(x, y)
    angle = meridional(r).refracted(r / radius, INDEX, 1.0).angle
    expected = np.degrees(np.arctan(np.tan(angle)[:, None] * np.stack([x, y], axis=1) / r[:, None]))
    np.testing.assert_allclose(landing_points(landing), expected, rtol=0, atol=1e-12)


def test_planes_at_any_distance_see_the_far_fields_angles(backend):
    """Between two planes a landing point moves by their distance times the tangent of its angle."""
    lens, rays = hollow_lens(rough_by(0.5), rough_by(0.2, 6)), glowing(1 << 10, 60.0)
    near, further, far = (traced(backend, lens, rays, z)[0] for z in (105.0, 205.0, FAR))
    arrives = far.flux.numpy() > 0
    moved = landing_points(further)[arrives] - landing_points(near)[arrives]
    np.testing.assert_allclose(
        moved, 100 * np.tan(np.radians(landing_points(far)[arrives])), rtol=1e-11, atol=1e-11
    )
    np.testing.assert_array_equal(near.flux.numpy(), far.flux.numpy())


def test_a_cartesian_lens_makes_parallel_light_of_a_point(backend):
    """A sphere around the point bends nothing; an ellipsoid of eccentricity 1 / n with the point in its far
    focus makes light parallel.

    Its vertex radius is (n - 1) / n of the distance.  The angles that are left are rounding, the rays' flux
    is Fresnel's.
    """
    distance, thickness = 2.0, 5.0
    rear = Conic(-(INDEX - 1) / INDEX * (distance + thickness), -1 / INDEX**2)
    space = small_space((2.0, 2.0))
    lens = Lens(
        FreeformSurface((1.2, 1.2), Conic(-distance)),
        FreeformSurface((2.0, 2.0), rear, THBSurface(space, np.zeros(space.dim))),
        thickness,
        INDEX,
    )
    rays = pointed((41, 40), 15.0, 1.0, distance)
    landing, budget, _ = traced(backend, lens, rays, FAR, (1.0, 1.0))
    assert (landing.flux.numpy() > 0).all()
    assert np.abs(landing_points(landing)).max() < 1e-12
    theta = np.arccos(rays.direction[2])
    out = np.arctan2(np.sin(theta), np.cos(theta) - 1 / INDEX)  # the normal lies along n d_in - d_out
    incident = np.maximum(out - theta, 1e-6)
    share = 0.96 * fresnel(incident, INDEX, 1.0)
    np.testing.assert_allclose(landing.flux.numpy(), rays.flux * share, rtol=1e-9)
    assert budget.on_target == pytest.approx((rays.flux * share).sum(), rel=1e-10)


def test_mirror_images_of_rays_land_in_mirror_images(backend):
    lens, rays = hollow_lens(), glowing(1 << 8, 70.0)
    points = landing_points(traced(backend, lens, rays)[0]).reshape(4, -1, 2)
    for mirrored, sign in zip(points, [(1, 1), (1, -1), (-1, 1), (-1, -1)], strict=True):
        np.testing.assert_allclose(mirrored * sign, points[0], rtol=1e-13, atol=1e-12)


# Budgets


def test_the_far_fields_target_is_measured_in_degrees(backend):
    """A plate: light of angle theta in x alone is on target up to the half-width."""
    rays = pointed((201, 199), 30.0, 0.0, 1.0)
    landing, budget, _ = traced(backend, small_lens(rear=PLANE), rays, FAR, (12.0, 7.0))
    p, q, cosine = rays.direction
    onto = (np.abs(np.degrees(np.arctan(p / cosine))) <= 12) & (
        np.abs(np.degrees(np.arctan(q / cosine))) <= 7
    )
    assert 0.05 < onto.mean() < 0.5
    assert budget.on_target == pytest.approx(landing.flux.numpy()[onto].sum(), rel=1e-12)
    assert budget.off_target == pytest.approx(landing.flux.numpy()[~onto].sum(), rel=1e-12)


def test_parts_of_a_source_have_the_budget_of_the_whole(backend):
    lens = hollow_lens(rough_by(1.0))
    whole = traced(backend, lens, glowing(1 << 10))[1]
    parts = [
        traced(backend, lens, part)[1]
        for part in lambertian_parts((0.5, 0.5), 2.0, 1.0, 90.0, Profile(), 1 << 10, 0, 1 << 8)
    ]
    assert len(parts) == 4
    total = parts[0] + parts[1] + parts[2] + parts[3]
    for name, value in vars(whole).items():
        assert getattr(total, name) == pytest.approx(value, abs=1e-13), name


def require_faded(soft, hard, hits, share):
    """Light near rims falls by 3 s^2 - 2 s^3, all other stays.  hits : of the rear, and of a free front."""
    fade = np.ones(hard.flux.numpy().shape)
    for at, half in zip(hits, (8.0, 5.0)):
        for a in (at.x.numpy(), at.y.numpy()):
            s = np.clip((half - np.abs(a)) / (share * half), 0, 1)
            fade *= s * s * (3 - 2 * s)
    assert 0.01 < ((fade > 0) & (fade < 1)).mean() < 0.5
    np.testing.assert_allclose(
        soft.flux.numpy(), hard.flux.numpy() * fade, rtol=0, atol=1e-14 * hard.flux.numpy().max()
    )


@pytest.mark.parametrize("lens", [LENSES["rear"], LENSES["both"]], ids=["rear", "both"])
def test_a_soft_rim_fades_the_light_of_free_surfaces_and_nothing_else(backend, lens):
    """3 s^2 - 2 s^3 with s the distance from the rim in shares of `soft_rim`, for every free surface; landing
    points stay."""
    rays, share = glowing(1 << 11), 0.1
    hard, _, hits = traced(backend, lens, rays)
    _, soft = tracer_to(backend, lens, rays, TARGET_Z, share).trace(coefficients(lens))
    require_faded(soft, hard, hits[::-1], share)
    np.testing.assert_array_equal(landing_points(soft), landing_points(hard))


def test_a_soft_rim_fades_the_light_of_a_rear_behind_a_free_front(backend):
    """Where the front sends light decides how much goes over the rear's rim, whether that is free or not."""
    lens = LENSES["both"]
    lens = lens.with_rear(FreeformSurface(lens.rear.half_width, lens.rear.conic))
    rays, share = glowing(1 << 11), 0.1
    _, hard = tracer_to(backend, lens, rays, TARGET_Z).trace(coefficients(lens))
    tracer = tracer_to(backend, lens, rays, TARGET_Z, share)
    _, soft = tracer.trace(coefficients(lens))
    require_faded(soft, hard, [tracer.at(k, coefficients(lens))[0] for k in (1, 0)], share)
