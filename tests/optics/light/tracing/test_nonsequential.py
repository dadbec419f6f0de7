"""Non-sequential tracing: closed forms, a convex polyhedron, a triangle mesh, and a sequential twin."""

from dataclasses import asdict

import numpy as np
import pytest
from hypothesis import Phase, assume, given, settings, strategies as st

from optics.base.runtime import load_backend
from optics.light.intersections import first_crossing, last_root
from optics.light.tracing.nonsequential import FATES, TargetArea, trace_nonsequential, trace_paths
from optics.scene.receivers import Cylinder, FarField, Sphere, receiver_at
from optics.scene.sources import Rays
from oracles.branch_tracer import INDEX, Frustum, MeshSolid, edge_gap, traced_one_by_one
from oracles.light_formulas import fresnel_parts
from oracles.polarised_faces import split_fields, unpolarised
from tests.cases import examples
from tests.optics.light.tracing.cases import FAR, FAR_Z, dome_lens, lambertian
from tests.thbcad.cases import lenses
from thbcad.lens import FreeformSurface, Lens
from thbcad.poses import Pose
from thbcad.sags import Conic

WIDE = TargetArea(receiver_at(50.0), (30.0, 20.0))


def plane_lens(front, rear, thickness):
    return Lens(FreeformSurface(front), FreeformSurface(rear), thickness, INDEX)


def one_ray(origin, direction):
    direction = np.array(direction, dtype=float)[:, None]
    return Rays(np.array(origin, dtype=float)[:, None], direction / np.linalg.norm(direction), np.ones(1))


# closed forms


def test_a_slab_passes_the_infinite_fresnel_series(backend):
    lens = plane_lens((1e4, 1e4), (1e4, 1e4), 5.0)
    result = trace_nonsequential(
        backend, lens, one_ray((0.1, 0.2, -1), (0, 0, 1)), WIDE, bounces=40, threshold=0.0
    )
    # R = 0.04 per bounce: after 40 of them nothing is left in float64
    assert result.fates.on_target == pytest.approx(2 * INDEX / (INDEX**2 + 1), rel=1e-14)
    assert result.fates.reflected_outside == pytest.approx(0.04, rel=1e-14)
    direct = result.direct
    assert result.landings.flux[direct] == pytest.approx([0.96**2], rel=1e-14)
    assert direct.sum() == 1


def test_a_cube_guides_a_ray_by_total_reflection(backend):
    """45 degrees outside, 28.1 inside; 61.9 degrees at the walls is beyond the critical angle 41.8."""
    lens = plane_lens((5.0, 5.0), (5.0, 5.0), 10.0)
    ray, target = one_ray((-1, 0.3, -1), (1, 0, 1)), TargetArea(receiver_at(50.0), (60.0, 20.0))
    fates = trace_nonsequential(backend, lens, ray, target, threshold=0.0).fates
    passed = fresnel_parts(np.pi / 4, 1.0, INDEX)  # of s and of p: all planes of incidence are one
    lost = 1 - passed
    assert fates.on_target == pytest.approx(np.mean(passed / (1 + lost)), rel=1e-12)
    assert fates.reflected_outside == pytest.approx(np.mean(lost), rel=1e-12)
    assert fates.back == pytest.approx(np.mean(lost * passed / (1 + lost)), rel=1e-12)
    (path,) = trace_paths(backend, lens, ray, target)
    tangent = np.tan(np.arcsin(np.sqrt(0.5) / INDEX))
    exit_x = 10 - 10 * tangent
    expected = [(-1, 0.3, -1), (0, 0.3, 0), (5, 0.3, 5 / tangent), (exit_x, 0.3, 10), (exit_x - 40, 0.3, 50)]
    assert path.points == pytest.approx(np.array(expected), abs=1e-12)
    assert path.fate == "on_target"
    (away,) = trace_paths(backend, lens, ray, TargetArea(FarField(), (60.0, 20.0)))
    ending = np.array(expected[-2]) + lens.thickness * np.array([-1, 0, 1]) / np.sqrt(2)
    assert away.points == pytest.approx(np.array([*expected[:-1], ending]), abs=1e-12)
    assert away.fate == "on_target"


def test_a_ray_creeps_along_a_hollow_sphere(backend):
    """Chords of a sphere advance by equal angles; here by less than the step at which faces are sampled."""
    radius, graze = 10.0, np.radians(1.0)
    lens = Lens(FreeformSurface((5.0, 5.0), Conic(-radius)), FreeformSurface((5.0, 5.0)), 5.0, INDEX)
    middle = np.radians(-20.5)  # polar angle of the middle of the first chord, where the ray starts
    start = radius * np.cos(graze) * np.array([np.sin(middle), 0, np.cos(middle)]) - (0, 0, radius)
    (path,) = trace_paths(backend, lens, one_ray(start, (np.cos(middle), 0, -np.sin(middle))), WIDE)
    polar = middle + graze * np.arange(1, 51, 2)  # the rim lies at 30 degrees
    polar = polar[polar < np.radians(30)]
    expected = radius * np.array([np.sin(polar), 0 * polar, np.cos(polar) - 1]).T
    assert path.fate == "reflected_outside"
    assert path.points[1:-1] == pytest.approx(expected, abs=1e-11)


# frusta with plane faces: convex, so that half-spaces give every intersection


SHAPES = [
    ((5.0, 5.0), (5.0, 5.0), 10.0),
    ((5.0, 5.0), (8.0, 8.0), 5.0),
    ((5.0, 4.0), (3.0, 7.0), 5.0),
    ((5.0, 7.0), (5.0, 4.0), 6.0),
    ((8.0, 8.0), (3.0, 3.0), 20.0),
    ((5.0, 5.0), (5.0 + 1e-7, 5.0), 5.0),  # nearly a wall
    ((5.0, 5.0), (5.0 + 1e-10, 5.0 - 1e-6), 5.0),  # below the step that counts as one
]


@pytest.mark.parametrize("shape", SHAPES)
def test_every_branch_in_a_frustum(backend, shape):
    rng = np.random.default_rng(1)
    n = 150
    origin = np.vstack([rng.uniform(-9, 9, (2, n)), rng.uniform(-6, -1, n)])
    direction = rng.normal(size=(3, n))
    direction[2] = abs(direction[2])
    rays = Rays(origin, direction / np.linalg.norm(direction, axis=0), np.ones(n))
    result = trace_nonsequential(backend, plane_lens(*shape), rays, WIDE)
    expected = traced_one_by_one(Frustum(*shape), rays, WIDE, 1e-4)
    # 1e-10 mm of a shifted wall over a thickness of 5 mm tilt it by 2e-11; rounding of the others is less
    assert result.by_ray == pytest.approx(expected, abs=2e-8)


# curved lenses


def has_kink(surface):
    """Whether an inner knot of the sag is repeated as often as the degree."""
    if surface.sag is None:
        return False
    knots = surface.sag.space.kv_u, surface.sag.space.kv_v
    return any(
        np.unique(kv.knots[1:-1], return_counts=True)[1][1:-1].max(initial=0) >= kv.degree for kv in knots
    )


@pytest.mark.slow
@settings(
    max_examples=8, deadline=None, derandomize=True, phases=[Phase.generate]
)  # every example compiles kernels
@given(lenses(), st.integers(0, 2**16))
def test_the_fates_hold_all_flux(backend, lens, seed):
    assume(edge_gap(lens) > 0)  # a ruled edge that crosses the front or the rear leaves no solid
    reach = min(lens.front.half_width)
    rays = lambertian(2000, seed, 0.5 * reach, -2.0 * reach)
    target = TargetArea(receiver_at(100.0 * lens.thickness), (50.0 * lens.thickness, 20.0 * lens.thickness))
    result = trace_nonsequential(backend, lens, rays, target)
    assert result.by_ray.sum(axis=0) == pytest.approx(rays.flux, rel=1e-12)
    assert (result.by_ray >= 0).all()
    if not (has_kink(lens.front) or has_kink(lens.rear)):  # without a second derivative nothing is proven
        assert result.fates.failed <= 1e-6
    landings = result.landings
    by_fate = np.bincount(result.fate, landings.flux, len(FATES))
    for name, flux in asdict(result.fates).items():
        if name.endswith("_target"):
            assert by_fate[FATES.index(name)] == pytest.approx(flux, abs=1e-13)


NARROWING = Lens(
    FreeformSurface((8.0, 8.0), Conic(-10.0, -1.0)),
    FreeformSurface((5.0, 6.0), Conic(-30.0, -1.0)),
    9.0,
    INDEX,
)


@pytest.mark.slow
@pytest.mark.parametrize(
    "lens", [dome_lens(3), NARROWING], ids=["dome with THB sag", "rear smaller than front"]
)
def test_every_branch_in_a_triangle_mesh(backend, lens):
    rays = lambertian(100, 5)
    result = trace_nonsequential(backend, lens, rays, FAR, threshold=1e-3)
    differ = []
    for count in (16, 32):
        expected = traced_one_by_one(MeshSolid(lens, count), rays, FAR, 1e-3)
        differ.append(abs(expected - result.by_ray).sum(axis=0) / rays.flux)
    # facets lie h^2 / 8 times the curvature beside the surface: half the size, a quarter of the difference
    assert np.median(differ[1]) < np.median(differ[0]) / 3
    assert np.median(differ[1]) < 3e-4
    # near the critical angle, a rim or the threshold a branch may end elsewhere
    assert (differ[1] > 0.01).mean() <= 0.06
    assert result.fates.on_target > 0.25
    assert result.fates.failed == 0


def scan(surface, vertex, origin, direction):
    """Return the path lengths at which rays (3, n) first pass a graph to greater z, by scanning and
    bisection; NaN for none."""
    t = np.linspace(1e-6, 30, 3000)[:, None]
    hx, hy = surface.half_width

    def depth(t):
        x, y, z = (o + t * d for o, d in zip(origin, direction))
        inside = (abs(x) <= hx) & (abs(y) <= hy)
        flat = np.clip(x, -hx, hx).ravel(), np.clip(y, -hy, hy).ravel()
        return np.where(inside, z - vertex - surface(*flat).reshape(x.shape), np.nan)

    values = depth(t)
    crossing = (values[:-1] < 0) & (values[1:] >= 0)
    first = crossing.argmax(axis=0)
    low, high = t[first, 0], t[first + 1, 0]
    for _ in range(55):
        middle = 0.5 * (low + high)
        before = depth(middle) < 0
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    return np.where(crossing.any(axis=0), high, np.nan)


def normals_at(surface, point):
    """Return unit normals towards +z, (n, 3)."""
    slopes = [surface(*point[:2], d) for d in ((1, 0), (0, 1))]
    normal = np.stack([-slopes[0], -slopes[1], np.ones_like(slopes[0])], axis=1)
    return normal / np.linalg.norm(normal, axis=1, keepdims=True)


@pytest.mark.parametrize(
    "lens", [dome_lens(8, 0.7), NARROWING], ids=["dome with THB sag", "rear smaller than front"]
)
def test_the_direct_part_is_sequential(backend, lens):
    rays = lambertian(300, 2)
    result = trace_nonsequential(backend, lens, rays, FAR)
    origin, d, share = rays.origin, rays.direction, rays.flux
    alive, fields = np.arange(300), unpolarised(d.T)
    for surface, vertex, eta in ((lens.front, 0.0, 1 / INDEX), (lens.rear, lens.thickness, INDEX)):
        t = scan(surface, vertex, origin, d)
        met = np.isfinite(t)
        origin, d, share, alive = (origin + t * d)[:, met], d[:, met], share[met], alive[met]
        normals = normals_at(surface, origin)
        (d, fields, passed), _ = split_fields(fields[met], d.T, normals, np.full(len(alive), eta))
        d, share = d.T, share * passed
    good = (share > 0) & (d[2] > 0)
    points = np.full((2, 300), np.nan)
    points[:, alive[good]] = (origin[:2] + (FAR_Z - origin[2]) / d[2] * d[:2])[:, good]
    flux = np.full(300, np.nan)
    flux[alive[good]] = share[good]
    landings = result.landings
    direct = result.ray[result.direct]
    assert len(np.unique(direct)) == len(direct) > 0.9 * good.sum()  # a few meet the lens again
    # landing points move by 1000 mm times the error of the direction, and grow without bound for grazing
    # exits
    distance = np.hypot(FAR_Z, np.hypot(landings.x, landings.y))[result.direct]
    for found, expected in zip((landings.x, landings.y), points):
        assert (abs(found[result.direct] - expected[direct]) <= 1e-11 * distance**2).all()
    assert landings.flux[result.direct] == pytest.approx(flux[direct], rel=1e-8)


WALL = Pose.tilted((0.0, -20.0, 80.0), (40.0, 0.0, 0.0))


@pytest.mark.parametrize(
    "target",
    [FAR, *(TargetArea(r, (30.0, 60.0)) for r in (Cylinder(WALL, radius=90.0), Sphere(WALL, radius=-200.0)))],
    ids=["plane", "cylinder", "sphere"],
)
def test_paths_follow_the_strongest_branch(backend, target):
    lens, rays = dome_lens(3), lambertian(60, 9)
    paths = trace_paths(backend, lens, rays, target)
    assert {path.fate for path in paths} >= {"on_target", "off_target"}
    result = trace_nonsequential(backend, lens, rays, target)
    landings = result.landings
    ends = {
        ray: (x, y) for x, y, ray, direct in zip(landings.x, landings.y, result.ray, result.direct) if direct
    }
    for ray, path in enumerate(paths):
        assert (path.points[0] == rays.origin[:, ray]).all()
        assert ray in ends or path.fate != "on_target" or len(path.points) > 4
        if len(path.points) == 4 and ray in ends:
            assert path.points[-1] == pytest.approx(target.receiver.points(*ends[ray]), abs=1e-9)


# roots


@examples(40, derandomize=True)
@given(st.integers(0, 2**32 - 1))
def test_grazed_humps_are_seen(backend, seed):
    """f = -+ (t - a) (t + 2) ((t - b)^2 -+ g^2) touches zero from below around b, or just does not; some rays
    begin on the root 0."""
    rng, n = np.random.default_rng(seed), 64
    a = rng.choice([-0.5, 0.0, 1.5], n)
    b = rng.uniform(0.4, 0.95, n)  # the third extremum then lies in another step
    g = 10.0 ** rng.uniform(-6, -2, n)
    touches = rng.random(n) < 0.5
    sign = np.where(a > 1, 1.0, -1.0)
    near, middle, factor, gap = (backend.array(v) for v in (a, b, sign, np.where(touches, -(g**2), g**2)))

    def f(t):
        p, q, r = t - near, t + 2, (t - middle) * (t - middle) + gap
        return factor * p * q * r, factor * ((p + q) * r + 2 * p * q * (t - middle)), t

    start = backend.dr.zeros(backend.Float, n)
    low, high, found = first_crossing(backend, f, (start, start + 1), start + 3, start <= 0)
    t = last_root(backend, f, (low, high), found, backend.Float(2.0**-51))
    assert (found.numpy() == touches).all()
    # (t - b)^2 - g^2 is rounded by a few EPS g^2 where t - b is not rounded: EPS b / g, below 1e-9, times g
    assert t.numpy()[touches] == pytest.approx((b - g)[touches], abs=1e-9)


# refusals


def test_bad_rays_are_refused(backend):
    good = lambertian(3)
    with pytest.raises(ValueError, match="direction must have length 1"):
        trace_nonsequential(backend, dome_lens(), Rays(good.origin, 2 * good.direction, good.flux), FAR)
    with pytest.raises(ValueError, match=r"origin must have the shape \(3, 3\), got \(3,\)"):
        Rays(good.origin[0], good.direction, good.flux)
    with pytest.raises(ValueError, match="flux must not be negative"):
        trace_paths(backend, dome_lens(), Rays(good.origin, good.direction, -good.flux), FAR)
    with pytest.raises(ValueError, match="at least one ray"):
        Rays(np.zeros((3, 0)), np.zeros((3, 0)), np.zeros(0))


def test_single_precision_is_refused():
    with pytest.raises(ValueError, match="double precision"):
        trace_nonsequential(load_backend("single", 1), dome_lens(), lambertian(3), FAR)
