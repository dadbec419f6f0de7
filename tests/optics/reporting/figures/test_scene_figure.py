"""The picture of the scene: rays that are traced, things at their places, no lens behind the target."""

import numpy as np
import pytest
from matplotlib import pyplot as plt

from optics.reporting.figures.scene_figure import _by_visit, scene_view
from optics.reporting.view import drawn_elements, placed, scene_paths
from optics.scene.problem import Problem
from optics.scene.system import System
from tests.optics.cases import target_z
from tests.optics.reporting.cases import pixels

LAMBERTIAN = {
    "source.kind": "lambertian",
    "source.half_width": [0.5, 0.5],
    "source.distance": 2.0,
    "optimizer.window": "bspline",
}
POINT = {
    "source.kind": "point",
    "source.half_width": [0.0, 0.0],
    "source.distance": 30.0,
    "source.half_angle": 15.0,
}
SOURCES = {"collimated": {}, "round": {"source.profile": "round"}, "lambertian": LAMBERTIAN, "point": POINT}
FAR = {"target.distance": float("inf"), "target.half_width": [30.0, 30.0]}


def red(png):
    """Return how many pixels are those of a ray that is lost: neither amber nor grey."""
    r, g, b = np.moveaxis(pixels(png), 2, 0)
    return np.count_nonzero((r - g > 60) & (np.abs(g - b) < 30))


@pytest.mark.slow
@pytest.mark.parametrize("name", SOURCES)
def test_every_kind_of_source_has_its_picture(backend, made, name):
    system = made(SOURCES[name])
    light = np.eye(48)
    paths = scene_paths(system, backend)
    png = scene_view(system, light, paths)
    assert png.startswith(b"\x89PNG")
    assert scene_view(system, light, paths) == png
    assert plt.get_fignums() == []


@pytest.mark.parametrize("name", SOURCES)
def test_rays_start_on_the_source_and_end_in_the_target_plane(backend, made, name):
    system = made(SOURCES[name])
    paths = [path for path in scene_paths(system, backend) if "target" in path.fate]
    starts, ends = (np.array([path.points[k] for path in paths]) for k in (0, -1))
    assert len(starts) > 30
    assert (np.abs(starts[:, :2]) <= system.problem.source.half_width).all()
    assert np.array_equal(ends[:, 2], np.full(len(ends), target_z(system.problem)))


def test_rays_go_straight_through_a_plate(backend, made):
    system = made({"lens.rear.radius": float("inf")})
    for path in scene_paths(system, backend):
        assert path.fate == "on_target"
        assert path.points[:, :2] == pytest.approx(np.tile(path.points[0, :2], (4, 1)), abs=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"target.tilt": [30.0, 0.0, 0.0]},
        {"target.surface": "cylinder", "target.radius": 25.0},
        {"target.surface": "sphere", "target.radius": -40.0},
    ],
    ids=["across", "tilted", "cylinder", "sphere"],
)
def test_light_is_drawn_where_it_is(backend, made, changes):
    """A bright corner at +x, +y appears at the upper right of the target, and nowhere else."""
    system = made(changes)
    paths = scene_paths(system, backend)
    dark = np.full((48, 48), 0.5)
    dark[24:, :24] = 1.0  # the scale is the same with and without the corner
    corner = dark.copy()
    corner[:12, 36:] = 1.0
    before, after = (pixels(scene_view(system, light, paths)).mean(axis=2) for light in (dark, corner))
    rows, columns = np.nonzero(after - before > 50)
    middle = np.argwhere(np.abs(before - 127) < 3).mean(
        axis=0
    )  # of what is half bright: the target without its lower left quarter
    assert rows.size > 100
    assert rows.mean() < middle[0]
    assert columns.mean() > middle[1]
    assert (after - before).min() > -10


SIZE = {"half_width": (10, 10)}
LENS = {"kind": "lens", "name": "L1", "index": 1.5, "thickness": 6, "front": SIZE, "rear": SIZE}
MIRROR = {"kind": "mirror", "name": "M1", "tilt": (45, 0, 0), "thickness": 4, "face": SIZE}
PLACES = {
    "wall": (LENS, {"position": (0, 25, 60), "tilt": (-75, 0, 0)}),
    "sphere": (LENS, {"position": (0, 0, 60), "surface": "sphere", "radius": -50.0}),
    "by a mirror": (MIRROR, {"position": (0, 60, 0), "tilt": (-90, 0, 0)}),
}


@pytest.mark.every(3)
@pytest.mark.parametrize("name", PLACES)
def test_light_on_any_screen_is_drawn_where_the_scene_has_it(backend, name):
    """One lit quarter lies from the middle of the picture as the receiver's own points do: within 15 degrees,
    as of a quarter whose centre is seen obliquely."""
    element, place = PLACES[name]
    target = {"kind": "tophat", "half_width": (20, 20), "pixels": (32, 32), **place}
    source = {"kind": "collimated", "half_width": (9, 9)}
    system = System(Problem(source=source, element=[element], target=target))
    scene = placed(system, drawn_elements(system, 21))
    middle, quarter = scene(np.array([system.target.receiver.points(u, u) for u in (0.0, 10.0)]).T).T
    light = np.full((32, 32), 0.5)
    light[16:, :16] = 1.0  # the scale is the same with and without what is looked for
    lit = light.copy()
    lit[:16, 16:] = 1.0
    dark, one, other = (
        pixels(scene_view(system, shown, ())).mean(axis=2) for shown in (0 * light, light, lit)
    )
    whole, found = (np.argwhere(abs(a - b) > 50).mean(axis=0) for a, b in ((one, dark), (other, one)))
    (down, across), wanted = found - whole, quarter - middle
    angle = np.arctan2(-down, across) - np.arctan2(wanted[1], wanted[0])
    assert abs((angle + np.pi) % (2 * np.pi) - np.pi) < np.radians(15)


@pytest.mark.slow
def test_rays_that_miss_are_red(backend, made):
    hit, miss = made({"target.half_width": [60.0, 60.0]}), made({"target.half_width": [0.5, 0.5]})
    counts = [
        red(scene_view(system, np.ones((48, 48)), scene_paths(system, backend))) for system in (hit, miss)
    ]
    assert counts[0] == 0
    assert counts[1] > 100


def test_the_far_field_shows_rays_and_no_target(backend, made):
    system = made(FAR)
    paths = scene_paths(system, backend)
    first, second = (scene_view(system, np.full((48, 48), light), paths) for light in (0.0, 1.0))
    assert first == second
    assert red(first) == 0
    assert all(path.points[-1, 2] == system.designed.thickness + 4 * 10.0 for path in paths)


def test_a_path_is_cut_in_the_middle_between_elements():
    visits = ["front", "rear"], ["face"]
    points = np.arange(15.0).reshape(5, 3).T  # source, front, rear, face, target
    first, second = _by_visit(points, visits)
    middle = (points[:, 2] + points[:, 3]) / 2
    assert np.array_equal(first, np.column_stack([points[:, :3], middle]))
    assert np.array_equal(second, np.column_stack([middle, points[:, 3:]]))
    (missed,) = _by_visit(points[:, :3], visits)  # of the rear
    assert np.array_equal(missed, points[:, :3])
