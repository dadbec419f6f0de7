"""The sure search: rays come to the first meeting with a rough surface, or are counted as undecided."""

import numpy as np
import pytest

from optics.base.runtime import load_backend
from optics.light.intersections.box_bounds import FINEST, ROOM, spline_bounds, surface_bounds
from optics.scene.sources import Rays
from oracles.exact_meetings import ExactGraph
from oracles.exact_rays import Quadric
from oracles.first_meetings import BEHIND, MEETS, MISSES, first_meetings
from oracles.rough_fronts import SOURCES, disagreeing, judge, rough_front
from tests.optics.cases import coefficients, tracer_to
from thbcad import Conic, FreeformSurface, KnotVector, Lens, THBSpace, THBSurface

REAR = FreeformSurface((50.0, 50.0))
BOWL = Quadric((0.0, 0.0, 0.0, 0.125, 0.125), 8.0)


@pytest.mark.parametrize(("slope", "radius"), [(1.0, np.inf), (3.0, -16.0)])
@pytest.mark.parametrize("name", SOURCES)
def test_no_ray_comes_to_another_meeting_than_the_first(backend, name, slope, radius):
    front = rough_front(slope, radius)
    judged = judge(backend, front, SOURCES[name](front, 4000, 1))
    assert (judged.wrong, judged.undecided) == (0, 0)


def test_the_referee_sees_the_rays_that_the_faster_search_leads_astray(backend):
    front = rough_front(2.0)
    assert disagreeing(backend, front, SOURCES["oblique rays"](front, 1000, 1), proven=False) > 10


@pytest.mark.parametrize("radius", [np.inf, -16.0], ids=["plane", "paraboloid"])
def test_intervals_and_rational_numbers_agree(radius):
    front = rough_front(2.0, radius)
    rays = SOURCES["oblique rays"](front, 12, 2)
    found, graph = first_meetings(front, rays.origin, rays.direction), ExactGraph(front)
    assert set(found.fate) == {MISSES, MEETS, BEHIND}
    for fate, low, high, o, d in zip(found.fate, found.low, found.high, rays.origin.T, rays.direction.T):
        exact, first, last = graph.first_meeting(o, d)
        assert exact == fate
        if fate == MEETS:
            assert low <= last
            assert first <= high


def test_the_referees_know_the_meeting_with_a_paraboloid():
    """z = (x^2 + y^2) / 8 half as a conic, half as a spline; a ray along x from (-4, 0, -1) with slope 3/4.

    -1 + 0.6 t = (-4 + 0.8 t)^2 / 8 has the roots t = (31 - sqrt(241)) / 1.6 * 0.5 and a later one.
    """
    origin, direction = np.array([[-4.0], [0.0], [-1.0]]), np.array([[0.8], [0.0], [0.6]])
    exact = np.roots([0.08, -0.8 - 0.6, 3.0]).min()
    front = BOWL.surface()
    found = first_meetings(front, origin, direction)
    fate, low, high = ExactGraph(front).first_meeting(origin[:, 0], direction[:, 0])
    assert found.fate[0] == fate == MEETS
    for a, b in ((found.low[0], found.high[0]), (float(low), float(high))):
        assert a - 1e-12 <= exact <= b + 1e-12


# What rounding decides


def touching(gap):
    """Return a ray that passes the bowl at `gap` mm where it touches it, and then meets nothing."""
    at, slope = 1.0, 0.25
    direction = np.array([1.0, 0.0, slope]) / np.hypot(1, slope)
    origin = np.array([at, 0.0, 0.125 * at**2 - gap]) - 4 * direction
    return origin[:, None], direction[:, None]


@pytest.mark.parametrize(("gap", "fate"), [(1e-9, "beside_lens"), (0.0, "unresolved"), (-1e-9, "on_target")])
def test_a_ray_that_touches_the_surface_within_rounding_is_undecided(backend, gap, fate):
    lens = Lens(BOWL.surface(), REAR, 50.0, 1.5)
    tracer = tracer_to(backend, lens, Rays(*touching(gap), np.ones(1)), 200.0)
    with backend.dr.suspend_grad():
        _, landing = tracer.trace(coefficients(lens))
    counts = tracer.counts(landing, (1e9, 1e9))
    assert counts == dict.fromkeys(counts, 0) | {fate: 1}
    assert tracer.fates(landing, (1e9, 1e9)).by_name["unresolved"] == float(fate == "unresolved")


def test_a_ray_that_comes_over_the_rim_above_the_surface_misses_it(backend):
    """Although it falls through the surface further on, from the side of the glass."""
    kv = KnotVector.uniform(3, 4, -8.0, 8.0)
    space = THBSpace(kv, kv)
    heights = np.repeat(2 * np.sin(space.kv_u.greville()[:, None]), space.kv_v.dim, axis=1)
    front = FreeformSurface((8.0, 8.0), Conic(), THBSurface(space, heights.ravel()))
    height = front(-8.0, 0.0).item() + 0.1
    direction = np.array([[1.0], [0.0], [0.02]]) / np.hypot(1, 0.02)
    origin = np.array([[-8.0], [0.0], [height]]) - 3 * direction
    x = np.linspace(-8, 8, 400)
    above = front(x, 0 * x) > height + 0.02 * (x + 8)
    assert not above[0]
    assert above.any()
    lens = Lens(front, REAR, 50.0, 1.5)
    tracer = tracer_to(backend, lens, Rays(origin, direction, np.ones(1)), 200.0)
    _, landing = tracer.trace(coefficients(lens))
    assert tracer.counts(landing, (1e9, 1e9))["beside_lens"] == 1


def test_single_precision_decides_every_ray():
    single, front = load_backend("single", 1), rough_front(1.0)
    judged = judge(single, front, SOURCES["point source"](front, 1000, 1))
    assert judged.undecided == 0
    assert judged.wrong < 10  # grazing ones: nothing is proven in single precision


# The bounds


@pytest.mark.parametrize("degree", [2, 3, 5])
@pytest.mark.parametrize("conic", [Conic(), Conic(-12.0, -1.0), Conic(12.0), Conic(-9.0, -3.0)], ids=str)
def test_heights_and_derivatives_lie_within_their_bounds(conic, degree):
    rng = np.random.default_rng(degree)
    half, count = (5.0, 8.0), FINEST // 4
    knots = [KnotVector.clamped(degree, np.sort(rng.uniform(-h, h, 9)), -h, h) for h in half]  # of any width
    sag = THBSurface(THBSpace(*knots), rng.standard_normal(knots[0].dim * knots[1].dim))
    surface = FreeformSurface(half, conic, sag)
    net = sag.space.embedding.coefficients(sag.coefficients)
    low, high = surface_bounds(conic, half, spline_bounds(knots, net, count))
    points = [rng.uniform(-h, h, 20_000) for h in half]
    place = [(p + h) / (2 * h) * count for p, h in zip(points, half)]
    turn = rng.uniform(0, 2 * np.pi, 20_000)
    xx, yy, xy = np.cos(turn) ** 2, np.sin(turn) ** 2, np.sin(2 * turn)
    along = xx * surface(*points, (2, 0)) + yy * surface(*points, (0, 2)) + xy * surface(*points, (1, 1))
    plain = [surface(*points), surface(*points, (1, 0)), surface(*points, (0, 1))]
    for shift in (-ROOM, ROOM):  # bounds hold a little around a box too
        i, j = (np.clip(np.floor(s + shift).astype(int), 0, count - 1) for s in place)
        for table, other, sign in ((low[i, j], high[i, j], 1), (high[i, j], low[i, j], -1)):
            bound = xx * table[:, 0] + yy * table[:, 1] + xy * np.where(xy < 0, other[:, 2], table[:, 2])
            assert (sign * (along - bound) >= 0).all()
            assert (sign * (np.transpose(plain) - table[:, 3:]) >= 0).all()
