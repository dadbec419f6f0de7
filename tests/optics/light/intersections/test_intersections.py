"""The search for meeting points: no ray that crosses a surface is lost, none that misses it is found."""

import numpy as np
import pytest
from hypothesis import example, given, strategies as st

from optics.base.runtime import load_backend
from optics.light.intersections.ray_roots import conic_distance
from optics.light.intersections.searched_intersections import SearchedHits
from tests.cases import examples, slow_unless
from tests.optics.cases import grazing_rays, hollow_lens, rough, small_lens, small_space
from thbcad.lens import FreeformSurface
from thbcad.sags import Conic
from thbcad.surfaces import THBSurface

SAMPLES = 2001  # along the span of every ray
HALF_WIDTH = 8.0


def rim(space, depth=-1.5):
    """Return coefficients that bend the surface by `depth` at its rim only."""
    net = np.zeros((space.kv_u.dim, space.kv_v.dim))
    net[[0, -1], :] = net[:, [0, -1]] = depth
    return net.ravel()


def rear(sag, spans=(2, 2)):
    """Return the rear of the Table 6.3 lens with a sag."""
    base = hollow_lens(spans=spans).rear
    return base.with_sag(THBSurface(base.sag.space, sag(base.sag.space)))


def met(backend, surface, origin, direction):
    """Return (Hits, ray parameters) of rays on a surface."""
    knots, net = None, None
    if surface.sag is not None:
        e = surface.sag.space.embedding
        knots, net = (e.kv_u, e.kv_v), e.coefficients(surface.sag.coefficients)
    search = SearchedHits(backend, surface.conic, surface.outline, knots)
    return search.meet([backend.array(a) for a in origin], [backend.array(a) for a in direction], net)


def sampled(surface, origin, direction, samples=SAMPLES):
    """Return (crosses, leaves) of rays, (n,) bool: whether f = surface height - ray height falls through zero
    on a ray's way above the rectangle, and whether the ray is above the surface at the end of it.
    """
    hx, hy = surface.half_width
    with np.errstate(divide="ignore"):
        ends = np.stack(
            [
                (s * h - o) / d
                for s in (-1, 1)
                for h, o, d in ((hx, origin[0], direction[0]), (hy, origin[1], direction[1]))
            ]
        )
    walls = np.stack([ends[[0, 2]], ends[[1, 3]]])
    first = np.maximum(np.min(walls, axis=1).max(axis=0), 0)
    last = np.max(walls, axis=1).min(axis=0)
    last = np.minimum(last, (60 - origin[2]) / direction[2])
    t = np.where(first < last, first + (last - first) * np.linspace(0, 1, samples)[:, None], 0.0)
    x, y, z = (o + t * d for o, d in zip(origin, direction))
    height = surface(np.clip(x, -hx, hx).ravel(), np.clip(y, -hy, hy).ravel()).reshape(t.shape) - z
    crosses = ((height[:-1] > 0) & (height[1:] <= 0)).any(axis=0)
    return crosses & (first < last), height[-1] <= 0


def require_all_found(backend, surface, origin, direction):
    """Compare the search with the samples, ray by ray; return the hits."""
    hits = met(backend, surface, origin, direction)
    hit, found = hits.hit.numpy(), hits.found.numpy()
    crosses, leaves = sampled(surface, origin, direction)
    assert found.all()  # every ray is known to hit or to miss
    assert hit[crosses & leaves].all()  # what leaves the surface and meets it again may be either
    # the samples may step over a hit between two of them, close to the rectangle's border; never over more
    # than these
    assert (hit & ~crosses).sum() <= 1 + len(hit) // 500
    at = [a.numpy()[hit] for a in (hits.x, hits.y, hits.z)]
    np.testing.assert_allclose(at[2], surface(at[0], at[1]), rtol=0, atol=1e-9)
    offset = np.stack(at) - origin[:, hit]
    across = np.cross(offset.T, direction[:, hit].T)
    np.testing.assert_allclose(
        across, 0, rtol=0, atol=1e-12 * 100
    )  # on the ray: rounding of lengths below 100 mm
    return hits


STEEP = {
    "steep rim": rear(rim),
    "steeper rim": rear(lambda space: rim(space, -4.0)),
    "raised rim": rear(lambda space: rim(space, 3.0)),
    "narrow rim": rear(rim, (12, 12)),
    "bumps": rear(lambda space: rough(space, 1.5), (8, 8)),
    "fine bumps": rear(lambda space: rough(space, 1.0), (16, 5)),
}


@pytest.mark.every(3)
@pytest.mark.parametrize("name", slow_unless(("steeper rim", "narrow rim", "fine bumps").count, STEEP))
def test_no_ray_that_crosses_a_steep_surface_is_lost(backend, name):
    surface = STEEP[name]
    hits = require_all_found(backend, surface, *grazing_rays(surface, 600))
    assert hits.hit.numpy().mean() > 0.5


def newton(surface, origin, direction, start, steps=50):
    """Return which rays plain Newton steps from `start` bring onto the surface, within its rectangle."""
    t = start.copy()
    for _ in range(steps):
        x, y, z = (o + t * d for o, d in zip(origin, direction))
        x, y = (np.clip(a, -h, h) for a, h in zip((x, y), surface.half_width))
        slope = direction[2] - surface(x, y, (1, 0)) * direction[0] - surface(x, y, (0, 1)) * direction[1]
        t = t + (surface(x, y) - z) / slope
    x, y, z = (o + t * d for o, d in zip(origin, direction))
    inside = (np.abs(x) <= surface.half_width[0]) & (np.abs(y) <= surface.half_width[1])
    close = np.abs(surface(*(np.clip(a, -h, h) for a, h in zip((x, y), surface.half_width))) - z) < 1e-9
    return inside & close


def test_brackets_find_what_newtons_steps_from_the_conic_do_not(backend):
    """The reason for brackets: plain Newton steps lose some of the grazing rays that meet a rim of -1.5
    mm."""
    surface = STEEP["narrow rim"]
    origin, direction = grazing_rays(surface, 5000)
    start = conic_distance(
        backend, surface.conic, *([backend.array(a) for a in v] for v in (origin, direction))
    ).numpy()
    hits = met(backend, surface, origin, direction)
    gained = hits.hit.numpy() & ~newton(surface, origin, direction, start)
    assert gained.sum() >= 5
    x, y, z = (a.numpy()[gained] for a in (hits.x, hits.y, hits.z))
    np.testing.assert_allclose(z, surface(x, y), rtol=0, atol=1e-9)


@pytest.mark.slow
@examples(20)
@given(
    height=st.floats(0, 3),
    spans=st.tuples(*[st.integers(1, 10)] * 2),
    radius=st.sampled_from([-10.0, 10.0, np.inf, 200.0]),
    constant=st.sampled_from([-1.0, -2.5, 0.0]),
    least=st.sampled_from([0.005, 0.1, 0.7]),
    seed=st.integers(0, 999),
)
@example(height=0.0, spans=(1, 1), radius=np.inf, constant=-1.0, least=0.1, seed=0)
def test_any_surface_is_found_by_all_rays_that_cross_it(
    backend, height, spans, radius, constant, least, seed
):
    if constant == 0.0 and abs(radius) < 12:
        constant = -1.0  # a sphere would end within the rectangle
    sag = hollow_lens(spans=spans).rear.sag.space
    surface = FreeformSurface(
        (HALF_WIDTH, HALF_WIDTH), Conic(radius, constant), THBSurface(sag, rough(sag, height, seed))
    )
    require_all_found(backend, surface, *grazing_rays(surface, 100, seed, least))


# Conics alone


@pytest.mark.parametrize("least", [0.02, 0.5])
@pytest.mark.parametrize(
    "conic",
    [
        Conic(),
        Conic(-10.0, -1.0),
        Conic(10.0, -1.0),
        Conic(-12.0),
        Conic(12.0),
        Conic(60.0, 0.5),
        Conic(-9.0, -3.0),
    ],
    ids=str,
)
def test_every_ray_that_crosses_a_conic_is_found(backend, conic, least):
    surface = FreeformSurface((HALF_WIDTH, HALF_WIDTH), conic)
    hits = require_all_found(backend, surface, *grazing_rays(surface, 400, least=least))
    assert hits.hit.numpy().mean() > 0.1


@pytest.mark.parametrize("sag", [None, 0.0, -0.5, 0.5], ids=str)
def test_a_plane_is_met_by_every_ray_over_it(backend, sag):
    """A plane reaches its greatest height everywhere: the end of the search is the meeting point itself."""
    space = small_space((HALF_WIDTH, HALF_WIDTH))
    surface = FreeformSurface(
        (HALF_WIDTH, HALF_WIDTH), Conic(), None if sag is None else THBSurface(space, np.full(space.dim, sag))
    )
    rng = np.random.default_rng(8)
    direction = np.stack([*rng.uniform(-0.9, 0.9, (2, 2000)), np.ones(2000)])
    direction /= np.linalg.norm(direction, axis=0)
    origin = np.stack([*rng.uniform(-3, 3, (2, 2000)), rng.uniform(-9, -1, 2000)])
    t = ((sag or 0.0) - origin[2]) / direction[2]
    x, y = (origin[k] + t * direction[k] for k in (0, 1))
    inside = np.maximum(np.abs(x), np.abs(y)) <= HALF_WIDTH
    hits = met(backend, surface, origin, direction)
    assert 0.5 < inside.mean() < 1
    np.testing.assert_array_equal(hits.hit.numpy(), inside)
    np.testing.assert_allclose(hits.x.numpy()[inside], x[inside], rtol=0, atol=1e-9)


def test_a_source_that_touches_the_front_still_lights_it(backend):
    """source.distance = 0: the rays start on the plane itself."""
    surface = small_lens().front
    rng = np.random.default_rng(9)
    direction = np.stack([*rng.uniform(-2, 2, (2, 500)), np.ones(500)])
    direction /= np.linalg.norm(direction, axis=0)
    origin = np.stack([*rng.uniform(-9, 9, (2, 500)), np.zeros(500)])
    hits = met(backend, surface, origin, direction)
    assert hits.hit.numpy().all()
    np.testing.assert_allclose([hits.x.numpy(), hits.y.numpy()], origin[:2], rtol=0, atol=1e-8)


def test_rays_that_start_beyond_the_surface_or_pass_it_miss(backend):
    """Behind it, beside it and turned away: decided misses, none unresolved."""
    surface = STEEP["bumps"]
    origin, direction = grazing_rays(surface, 300, 3)
    beyond = origin.copy()
    beyond[2] = surface(origin[0], origin[1]) + 3.5
    beside = origin + np.array([[30.0], [0.0], [0.0]])
    outward = np.stack([np.abs(direction[0]), direction[1], direction[2]])
    upward = np.repeat([[0.0], [0.0], [1.0]], 300, axis=1)
    for o, d in ((beside, outward), (beyond, upward)):
        hits = met(backend, surface, o, d)
        assert not hits.hit.numpy().any()
        assert hits.found.numpy().all()


def test_hits_outside_the_rectangle_are_misses_of_its_extension(backend):
    """Parallel rays beside the rectangle: found is known, hit is False; right on the border they hit."""
    surface = FreeformSurface((HALF_WIDTH, 5.0), Conic(40.0, -1.0))
    x = np.array([0.0, 8.0, -8.0, 8.0 + 1e-9, 20.0, 0.0, 0.0, 0.0])
    y = np.array([0.0, 0.0, 5.0, 0.0, 0.0, 5.0, -5.0 - 1e-9, -9.0])
    origin = np.stack([x, y, np.full(8, -50.0)])
    direction = np.repeat([[0.0], [0.0], [1.0]], 8, axis=1)
    hits = met(backend, surface, origin, direction)
    np.testing.assert_array_equal(hits.hit.numpy(), [1, 1, 1, 0, 0, 1, 0, 0])
    assert hits.found.numpy().all()


@pytest.mark.parametrize("precision", ["double", "single"])
def test_a_search_that_begins_where_rays_met_before_finds_what_a_fresh_one_does(precision):
    """Rays of the optimiser, which no proof leads: the last of Newton's steps begins within 0.5 um and ends
    within the rounding of a coordinate."""
    backend = load_backend(precision, None)
    surface = rear(lambda space: 0.3 * rough(space))
    origin, direction = grazing_rays(surface, 400, least=0.7)
    e = surface.sag.space.embedding
    rays = [[backend.array(a) for a in v] for v in (origin, direction)]
    first, *others = (e.coefficients(k * surface.sag.coefficients) for k in (1.0, 1.02, 0.7, -0.5))

    def search(proven):
        return SearchedHits(backend, surface.conic, surface.outline, (e.kv_u, e.kv_v), proven)

    near = search(False)
    near.meet(*rays, first)
    for net in others:
        found, fresh = near.meet(*rays, net), search(True).meet(*rays, net)
        hit = fresh.hit.numpy()
        assert hit.sum() > 100
        np.testing.assert_array_equal(found.hit.numpy(), hit)
        for a, b in ((found.x, fresh.x), (found.y, fresh.y), (found.z, fresh.z)):
            np.testing.assert_allclose(
                a.numpy()[hit], b.numpy()[hit], rtol=0, atol=100 * HALF_WIDTH * np.finfo(backend.dtype).eps
            )
