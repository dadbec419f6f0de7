"""What light meets first in the closed lens, and for how long its branches are followed."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given

from optics.light.tracing.branches import FRONT, UNDECIDED, Branches, ClosedLens
from optics.light.tracing.lens_faces import lens_faces
from optics.light.tracing.nonsequential import trace_nonsequential
from optics.scene.sources import Rays
from oracles.first_meetings import MEETS, first_meetings
from oracles.rough_fronts import SAME, SOURCES, rough_front
from tests.cases import examples
from tests.optics.light.tracing.cases import FAR, dome_lens, lambertian
from tests.thbcad.cases import lenses
from thbcad import FreeformSurface, Lens
from thbcad.lens import SIDES, placed_surfaces, rim, ruled_edge


@pytest.mark.parametrize("name", ["point source", "oblique rays"])
def test_with_all_reflections_a_rough_front_is_met_first_where_it_is(backend, name):
    """The walls of the lens stand on the rims: what meets the front meets no other face before."""
    front = rough_front(2.0)
    rays = SOURCES[name](front, 3000, 4)
    solid = ClosedLens(backend, Lens(front, FreeformSurface((5.0, 5.0)), 50.0, 1.5))
    meetings, found = (
        solid.meet(Branches.start(rays)),
        first_meetings(front, rays.origin, rays.direction),
    )
    meets = found.fate == MEETS
    np.testing.assert_array_equal(meetings.face == FRONT, meets)
    assert not (meetings.face == UNDECIDED).any()
    path = ((meetings.point - rays.origin) * rays.direction).sum(axis=0)[meets]
    assert (path >= found.low[meets] - SAME).all()
    assert (path <= found.high[meets] + SAME).all()


@examples(20)
@given(lenses())
def test_slanted_edges_lie_within_their_domains(backend, lens):
    """And closely: between planes through the lowest and the highest points of the rims."""
    assume(all(a != b for a, b in zip(lens.front.half_width, lens.rear.half_width)))
    surfaces = placed_surfaces(lens)
    for side, face in zip([SIDES[k] for k in (1, 3, 2, 0)], lens_faces(backend, lens)[2:]):
        edge = ruled_edge(surfaces, side)
        along = (np.linspace(kv.start, kv.stop, 15) for kv in (edge.kv_u, edge.kv_v))
        points = edge(*np.meshgrid(*along)).reshape(-1, 3)
        rows = face.domain @ np.column_stack([points, np.ones(len(points))]).T
        assert rows.min() >= 0
        rise = max(np.ptp(rim(surface, side)[1][:, 2]) for surface in surfaces)
        assert (rows[-2:].sum(axis=0) <= rise + 1e-5 * face.size).all()


@pytest.mark.slow
def test_the_roulette_ends_branches_soon_and_keeps_their_flux(backend, monkeypatch):
    generations, meet = [], ClosedLens.meet
    monkeypatch.setattr(ClosedLens, "meet", lambda *a: generations.append(len(a[1].ray)) or meet(*a))
    lens, rays = dome_lens(3), lambertian(20_000, half_width=1.0, z=-1.0)
    exact = trace_nonsequential(backend, lens, rays, FAR, threshold=1e-6).by_ray.sum(axis=1)
    followed, generations[:] = len(generations), []
    drawn = np.array(
        [
            trace_nonsequential(
                backend, lens, rays, FAR, threshold=0.2, roulette=np.random.default_rng(seed)
            ).by_ray.sum(axis=1)
            for seed in range(8)
        ]
    )
    error = drawn.std(axis=0, ddof=1) / np.sqrt(len(drawn))
    assert (abs(drawn.mean(axis=0) - exact) <= 4 * error + 1e-5).all()
    assert len(generations) / len(drawn) < 20 < followed


@pytest.mark.parametrize("away", [10.0, 1e4, 1e7])
def test_light_from_far_meets_a_front_as_near_light_does(backend, away):
    """The path to it is known to its own rounding, not to that of the lens."""
    front, rng = rough_front(0.3), np.random.default_rng(2)
    solid = ClosedLens(backend, Lens(front, FreeformSurface((5.0, 5.0)), 50.0, 1.5))
    origin = np.stack([*rng.uniform(-4.9, 4.9, (2, 3000)), np.full(3000, -away)])
    rays = Rays(origin, np.tile([[0.0], [0.0], [1.0]], 3000), np.ones(3000))
    meetings = solid.meet(Branches.start(rays))
    assert (meetings.face == FRONT).all()
    height = front(*meetings.point[:2])
    np.testing.assert_allclose(meetings.point[2], height, rtol=0, atol=1e-12 * max(away, 10.0))


def test_a_ray_that_leaves_a_surface_does_not_meet_it_where_it_starts(backend):
    front, rng = rough_front(2.0), np.random.default_rng(3)
    x, y = rng.uniform(-4.9, 4.9, (2, 20_000))
    slopes = np.stack([front(x, y, (1, 0)), front(x, y, (0, 1)), -np.ones_like(x)])
    direction = rng.standard_normal((3, x.size))
    direction *= -np.sign((slopes * direction).sum(axis=0))  # upwards from the surface
    direction /= np.linalg.norm(direction, axis=0)
    solid = ClosedLens(backend, Lens(front, FreeformSurface((5.0, 5.0)), 50.0, 1.5))
    inside = Branches.start(Rays(np.stack([x, y, front(x, y)]), direction, np.ones(x.size)))
    meetings = solid.meet(replace(inside, inside=np.ones(x.size, dtype=bool)))
    path = np.linalg.norm(meetings.point - inside.origin, axis=0)
    assert (path[meetings.face == FRONT] > 1e-6).all()
    assert (meetings.face == FRONT).any()
