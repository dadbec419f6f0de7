"""Rays that are drawn: as a mirror turns them, as through the closed lens, and lost where they are; stops."""

import numpy as np
import pytest

from optics.light.tracing import TargetArea, trace_paths
from optics.reporting.view import scene_paths, stop_rims
from optics.reporting.view.drawn_rays import sequential_paths
from optics.scene.paths import AIR, Body, LightPath, Stop, Surface
from optics.scene.problem import Problem
from optics.scene.receivers import Plane
from optics.scene.sources import Rays
from optics.scene.system import System, solvable_system
from tests.optics.cases import flat_problem, small_lens
from thbcad.lens import FreeformSurface, Lens
from thbcad.outlines import Outline
from thbcad.poses import Pose

PLATE = Lens(FreeformSurface((10.0, 10.0)), FreeformSurface((10.0, 10.0)), 6.0, 1.5)
ABOVE = Plane(Pose.tilted((0, 50, 0), (-90, 0, 0)))  # light comes along +y


MIRROR = Surface(PLATE.front, Pose.tilted((0, 0, 0), (45, 0, 0)), "reflect", 0.9)


def by_mirror(backend, origins, **path):
    """Return rays along +z by a mirror at 45 degrees, which turns them to +y, as points and fates."""
    origin = np.array(origins, float).T
    direction = np.broadcast_to([[0.0], [0.0], [1.0]], origin.shape)
    rays = Rays(origin, direction, np.ones(origin.shape[1]))
    way = LightPath((MIRROR,), (AIR, AIR), ABOVE, **path)
    found = sequential_paths(backend, way, rays, (8.0, 6.0))
    return [(ray.points, ray.fate) for ray in found]


def test_a_plane_mirror_turns_rays_and_they_end_where_they_are_lost(backend):
    """A ray at height y along +z meets the mirror at z = y, goes along +y to y = 50, and lands at v = -y."""
    origins = [(1, 2, -20), (1, -6.5, -20), (0, 9, -20), (-3, 1, -20)]
    stop = Stop(Outline((1.0, 1.0)), Pose.tilted((-3, 30, 1), (-90, 0, 0)), hole=False)
    straight, beside, missing, blocked = by_mirror(backend, origins, stops=(stop,))
    for (points, fate), wanted, (x, y, _) in zip((straight, beside), ("on_target", "off_target"), origins):
        assert fate == wanted
        np.testing.assert_allclose(points, [(x, y, -20), (x, y, y), (x, 50, y)], rtol=0, atol=1e-12)
    assert missing[1] == "beside_lens"
    assert len(missing[0]) == 2
    assert missing[0][1, 2] > 0  # it passes the mirror
    assert blocked[1] == "blocked"
    np.testing.assert_allclose(blocked[0], [(-3, 1, -20), (-3, 1, 1), (-3, 30, 1)], rtol=0, atol=1e-12)


def test_rays_end_on_the_body_that_shades_them(backend):
    """A plate from y = 30 mm on, below z = -2 mm: light at y = -6.5 mm meets it, at y = 2 mm it passes."""
    plate = Body(PLATE, Pose.tilted((0, 30, -12), (-90, 0, 0)))
    free, shaded = by_mirror(backend, [(1, 2, -20), (1, -5.5, -20)], bodies=(plate,))
    assert (free[1], shaded[1]) == ("on_target", "blocked")
    np.testing.assert_allclose(free[0][-1], (1, 50, 2), rtol=0, atol=1e-12)
    np.testing.assert_allclose(shaded[0][-1], (1, 30, -5.5), rtol=0, atol=1e-9)


def test_what_goes_away_from_the_screen_ends_on_the_mirror(backend):
    origin, direction = np.array([[0.0], [0.0], [-20.0]]), np.array([[0.0], [0.0], [1.0]])
    away = Plane(Pose.tilted((0, 50, 0), (90, 0, 0)))  # light comes along -y
    way = LightPath((MIRROR,), (AIR, AIR), away)
    (ray,) = sequential_paths(backend, way, Rays(origin, direction, np.ones(1)), (8.0, 6.0))
    assert ray.fate == "back"
    np.testing.assert_allclose(ray.points[-1], 0, atol=1e-12)


def test_along_a_path_rays_are_drawn_as_through_the_closed_lens(backend):
    """Where the stronger part goes by front and rear; both trace the same spline, to 1e-9 mm on a surface."""
    lens = small_lens()
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(-8, 8, 5), np.linspace(-7, 7, 4)))
    rays = Rays(np.stack([x, y, 0 * x - 20]), np.stack([0 * x, 0 * x, 0 * x + 1]), np.ones(x.size))
    path = LightPath.through(lens, Plane(Pose.tilted((0, 0, 60), (10, -20, 5))), 0.0)
    closed = trace_paths(backend, lens, rays, TargetArea.of(path, (20.0, 15.0)))
    for one, other in zip(sequential_paths(backend, path, rays, (20.0, 15.0)), closed, strict=True):
        assert one.fate == other.fate
        np.testing.assert_allclose(one.points, other.points, rtol=0, atol=1e-7)


@pytest.mark.parametrize("kind", ["point", "collimated"])
def test_a_lens_moved_with_its_target_moves_its_rays(backend, kind):
    """Along z alone: the source stays, a point so far away that its light is parallel to 1e-4."""
    size = {"half_width": (10, 10)}
    lens = {"index": 1.5, "thickness": 6, "front": size, "rear": {**size, "radius": 40.0}}
    source = {"kind": kind, "half_width": (8, 8)}
    if kind == "point":
        source = {"kind": "point", "distance": 2e4, "half_angle": 0.02}
    made = {}
    for shift in (0.0, 30.0):
        element = {"kind": "lens", "name": "L1", "position": (0, 0, shift), **lens}
        target = {"kind": "tophat", "position": (0, 0, 66 + shift), "half_width": (30, 30), "pixels": (8, 8)}
        system = System(Problem(source=source, element=[element], target=target))
        made[shift] = np.array([ray.points for ray in scene_paths(system, backend)])
    moved = made[30.0][:, 1:] - made[0.0][:, 1:]
    assert np.abs(moved[..., 2] - 30).max() < (0.1 if kind == "point" else 1e-9)
    assert np.abs(moved[..., :2]).max() < (0.1 if kind == "point" else 1e-9)


def test_rims_lie_in_the_plane_of_their_stop_and_run_round_it_in_turn():
    ring = {
        "shape": "ring",
        "half_width": (4, 3),
        "inner": (2, 1),
        "position": (1, 2, 30),
        "tilt": (40, 0, 10),
    }
    stops = [{**ring, "hole": hole} for hole in (False, True)]
    system = solvable_system(flat_problem({"kind": "collimated", "half_width": (8, 8)}, stop=stops))
    obstacle, slit = stop_rims(system)
    assert [len(obstacle), len(slit)] == [2, 3]
    back = system.stops[0].pose.inverse()
    areas = []
    for rim in (*obstacle, *slit):
        x, y, z = back.points(rim)
        np.testing.assert_allclose(z, 0, atol=1e-13)
        areas.append((x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2)
    wanted = np.pi * np.array([12, -2, 0, -12, 2])
    wanted[2] = 4 * 12.5**2
    assert areas == pytest.approx(wanted, rel=(2 * np.pi / 64) ** 2 / 6 * 1.01)  # of 64 chords
