"""What is proven of a meeting point by the slopes and heights of boxes along the ray."""

import numpy as np
import pytest

from optics.light.intersections.box_bounds import slope_bounds, spline_bounds
from oracles.rough_fronts import HALF, SOURCES, rough_front
from thbcad import Conic, FreeformSurface, KnotVector, THBSpace, THBSurface

SAMPLES = 1200  # along a ray
ERROR = 1e-9  # mm
KNOTS = KnotVector.uniform(3, 32, -HALF, HALF)


def bounds_of(backend, surface):
    sag = surface.sag.to_bspline()
    spline = spline_bounds((sag.kv_u, sag.kv_v), sag.coefficients)
    return slope_bounds(backend, surface.conic, surface.half_width, spline)


def over_the_rectangle(origin, direction):
    """Return the ray parameters between which rays are over the rectangle, from their origin on."""
    with np.errstate(divide="ignore"):
        ends = (np.array([[-HALF], [HALF]]) - origin[:2, None]) / direction[:2, None]
    first, last = ends.min(axis=1).max(axis=0), ends.max(axis=1).min(axis=0)
    return np.maximum(first, 0), last


def falls(surface, origin, direction, sign=1):
    """Return rays and parameters (ray, t, how many falls there were before) of f's falls through zero."""
    start, stop = over_the_rectangle(origin, direction)
    t = start + np.linspace(0, 1, SAMPLES)[:, None] * (stop - start)
    x, y, z = origin[:, None] + t * direction[:, None]
    f = sign * (surface(np.clip(x, -HALF, HALF), np.clip(y, -HALF, HALF)) - z)
    step, ray = np.nonzero((f[:-1] > 0) & (f[1:] <= 0) & (f[0] > 0))
    share = f[step, ray] / (f[step, ray] - f[step + 1, ray])
    before = np.cumsum((f[:-1] > 0) & (f[1:] <= 0), axis=0)[step, ray] - 1
    return ray, t[step, ray] + share * (t[step + 1, ray] - t[step, ray]), before, start


def proven(backend, surface, origin, direction, ends, below=True):
    """Return the mask of rays whose meeting at the last end is proven to be the first."""
    rows = [[backend.array(a) for a in rows] for rows in (origin, direction)]
    first, t = map(backend.array, ends)
    at = lambda s: [o + s * d for o, d in zip(*rows)]  # noqa: E731
    side = backend.array(np.full(len(ends[0]), below)) > 0
    return bounds_of(backend, surface).prove_first(at, rows[1], (first, t), first > -1, ERROR, side).numpy()


@pytest.mark.every(3)
@pytest.mark.parametrize("below", [True, False])
@pytest.mark.parametrize("name", SOURCES)
@pytest.mark.parametrize(("slope", "radius"), [(0.3, np.inf), (1.0, -16.0), (3.0, 20.0)])
def test_no_later_meeting_is_proven_to_be_the_first(backend, slope, radius, name, below):
    front = rough_front(slope, radius)
    rays = SOURCES[name](front, 500, 1)
    origin, direction = rays.origin, rays.direction
    if not below:  # seen from the other side: mirrored in z, the surface is met from above
        origin, direction = origin * [[1], [1], [-1]], direction * [[1], [1], [-1]]
        sag = THBSurface(front.sag.space, -front.sag.coefficients)
        front = FreeformSurface(front.half_width, Conic(-radius, -1.0), sag)
    ray, t, before, start = falls(front, origin, direction, 1 if below else -1)
    known = proven(backend, front, origin[:, ray], direction[:, ray], (start[ray], t), below)
    assert not known[before > 0].any()
    assert known.any()


def test_a_pit_as_narrow_as_a_box_is_not_stepped_over(backend):
    kv = KnotVector.uniform(2, 256, -HALF, HALF)
    rng = np.random.default_rng(0)
    net = np.where(rng.random(kv.dim**2) < 0.001, -1.0, 0.0)
    front = FreeformSurface((HALF, HALF), Conic(), THBSurface(THBSpace(kv, kv), net))
    origin = np.stack([np.full(1000, -HALF), *rng.uniform([[-HALF], [-1.0]], [[HALF], [-0.2]], (2, 1000))])
    direction = np.stack([np.ones(1000), *rng.uniform([[-1.0], [0.1]], [[1.0], [0.5]], (2, 1000))])
    direction /= np.linalg.norm(direction, axis=0)
    ray, t, before, start = falls(front, origin, direction)
    known = proven(backend, front, origin[:, ray], direction[:, ray], (start[ray], t))
    assert (before > 0).sum() > 50
    assert not known[before > 0].any()
    assert known.sum() > 50


@pytest.mark.parametrize(("steeper", "known"), [(1e-4, False), (0.1, True)])
def test_a_ray_along_the_surface_stays_in_doubt(backend, steeper, known):
    """It comes from under a plane of slope 1 that it meets 3 mm on."""
    space = THBSpace(KNOTS, KNOTS)
    plane = THBSurface(space, np.repeat(KNOTS.greville(), KNOTS.dim))
    direction = np.array([[1.0], [0.0], [1 + steeper]])
    origin = np.array([[-2.0], [0.0], [-2.0 - 3 * steeper]])
    length = np.linalg.norm(direction)
    ends = np.zeros(1), np.array([3 * length])
    front = FreeformSurface((HALF, HALF), Conic(), plane)
    assert proven(backend, front, origin, direction / length, ends) == known


def test_one_steep_hill_leaves_rays_elsewhere_proven(backend):
    """A bound of all slopes at once, 4.7 here, would leave all of them in doubt."""
    space = THBSpace(KNOTS, KNOTS)
    net = np.zeros((KNOTS.dim, KNOTS.dim))
    net[28:31, 28:31] = 3.0
    hill = FreeformSurface((HALF, HALF), Conic(), THBSurface(space, net.ravel()))
    rng = np.random.default_rng(0)
    origin = np.stack([*rng.uniform(-HALF, HALF, (2, 800)), np.full(800, -1.0)])
    direction = np.stack([*rng.uniform(-1, 1, (2, 800)), np.ones(800)])
    direction /= np.linalg.norm(direction, axis=0)
    ray, t, before, start = falls(hill, origin, direction)
    known = proven(backend, hill, origin[:, ray], direction[:, ray], (start[ray], t))
    x, y, _ = origin[:, ray] + t * direction[:, ray]
    away = np.maximum(abs(x - 3.75), abs(y - 3.75)) > 3.0  # mm: the hill has 1.1 on either side, a way 1.4
    assert known[away].all()
    assert not known[before > 0].any()
    assert (~known).any()
