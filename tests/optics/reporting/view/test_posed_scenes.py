"""Scenes of any pose: parts stand apart, pictures are open and read right, the page holds what is there."""

from base64 import b64decode
from itertools import pairwise

import numpy as np
import pytest

from optics.reporting.view import drawn_elements, placed, scene_page
from optics.scene.problem import Problem
from optics.scene.system import System
from tests.optics.reporting.cases import held
from thbcad.poses import Pose

BEAM = {"kind": "collimated", "half_width": (45, 45)}
NARROW = {"kind": "collimated", "half_width": (9, 9)}
BEHIND = {"position": (0, 0, 150), "half_width": (40, 40)}
POINT = {"kind": "point", "half_width": (0, 0), "distance": 100.0, "half_angle": 25.0}


def mirror(*tilt):
    return {"kind": "mirror", "name": "M1", "tilt": tilt, "thickness": 12.0, "face": {"half_width": (60, 70)}}


def lens(position=(0, 0, 0), tilt=(0, 0, 0)):
    size, where = {"half_width": (10, 10)}, {"position": position, "tilt": tilt}
    return {"kind": "lens", "name": "L1", **where, "index": 1.5, "thickness": 6, "front": size, "rear": size}


SCENES = {
    "fold up": (BEAM, mirror(45, 0, 0), {"position": (0, 300, 0), "tilt": (-90, 0, 0)}),
    "fold aside": (BEAM, mirror(0, 45, 0), {"position": (-300, 0, 0), "tilt": (0, -90, 0)}),
    "point": (POINT, mirror(30, 0, 0), {"position": (0, 260, -150), "tilt": (-120, 0, 0)}),
    "wall": (NARROW, lens(), {"position": (0, 40, 90), "tilt": (-75, 0, 0), "half_width": (30, 50)}),
    "turned lens": (
        NARROW,
        lens((0, 0, 30), (20, 0, 0)),
        {"position": (0, -30, 200), "half_width": (40, 40)},
    ),
    "dome": (NARROW, lens(), BEHIND | {"surface": "sphere", "radius": -80}),
    "column": (NARROW, lens(), BEHIND | {"surface": "cylinder", "radius": 120}),
    "long": (BEAM, mirror(45, 0, 0), {"position": (0, 9000, 0), "tilt": (-90, 0, 0)}),
}


@pytest.fixture(params=SCENES)
def system(request):
    source, element, target = SCENES[request.param]
    target = {"kind": "tophat", "half_width": (100, 100), "pixels": (8, 8)} | target
    return System(Problem(source=source, element=[element], target=target))


def separated(one, other):
    """Return whether a line lies between two sets of points (2, n)."""
    angles = np.linspace(0, 2 * np.pi, 181)
    lines = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return ((lines @ one).min(axis=1) > (lines @ other).max(axis=1)).any()


def test_parts_stand_apart_and_the_picture_is_open_and_not_seen_as_in_a_mirror(system):
    scene = placed(system, drawn_elements(system, 21))
    assert separated(scene(scene.outlook), scene(scene.body))
    assert separated(scene(scene.outlook), scene(scene.source))
    (hx, hy), receiver = system.target.settings.half_width, system.target.receiver
    corners = np.stack([receiver.points(u, v) for u, v in ((-hx, -hy), (hx, -hy), (-hx, hy))], axis=1)
    origin, right, up = scene(corners).T
    area = np.linalg.det([right - origin, up - origin])
    assert area > 0.25 * 4 * hx * hy  # a cosine of 0.25; below 0 it would be seen as in a mirror


def test_the_throw_alone_is_drawn_shorter(system):
    scene = placed(system, drawn_elements(system, 21))
    for part in (scene.body, scene.source, scene.outlook):
        shift = scene(part) - scene.turn[:2] @ part
        np.testing.assert_allclose(shift, shift[:, :1] + 0 * shift, rtol=0, atol=1e-9)
    start, end = scene.gap
    assert (scene.squeeze > 1) == (end - start > 1000)


def test_the_page_holds_the_element_at_its_pose_and_the_screen_where_it_is(system):
    data = held(scene_page(system, np.ones((8, 8)), []))
    points, receiver = np.array(data["target"]["points"]).T, system.target.receiver
    along = np.broadcast_to(receiver.pose.rotation[:, 2:], points.shape)
    landed = receiver.land(points - along, along)
    rows, columns = data["target"]["shape"]
    hx, hy = system.target.settings.half_width
    u, v = np.meshgrid(np.linspace(-hx, hx, columns), np.linspace(-hy, hy, rows))
    np.testing.assert_allclose([landed.u, landed.v], [u.ravel(), v.ravel()], rtol=0, atol=1e-9)
    hx, hy = system.base.front.half_width
    corner = system.pose.points(np.array([-hx, -hy, 0.0]))
    np.testing.assert_allclose(corner_of(data, 0), corner, rtol=0, atol=1e-5)


def corner_of(data, number):
    """Return the first point of a face of the page, in the scene."""
    *rotation, shift = np.array(data["pose"])
    rows = (np.frombuffer(b64decode(text), "<f4") for _, _, text in data["faces"][number]["points"])
    return Pose(np.transpose(rotation), shift).points(np.array([row[0] for row in rows], float))


@pytest.fixture
def row():
    """A fixed lens, which light meets first, and a free mirror; the file names them the other way round."""
    source, element, target = SCENES["fold up"]
    size = {"half_width": (50, 40)}
    fixed = lens((1, 2, -150), (0, 10, 0)) | {"front": size, "rear": size | {"freeform": None}}
    target = {"kind": "tophat", "half_width": (100, 100), "pixels": (8, 8)} | target
    path = [{"faces": ("L1.front", "L1.rear", "M1")}]
    return System(Problem(source=source, element=[element, fixed], path=path, target=target))


def test_all_elements_of_a_row_stand_in_the_scene_in_the_order_of_the_light(row):
    elements = drawn_elements(row, 21, 21)
    scene = placed(row, elements)
    assert [element.name for element in elements] == ["L1", "M1"]
    seen = [scene(part) for part in (scene.source, *scene.bodies, scene.outlook)]
    assert all(separated(*pair) for pair in pairwise(seen))
    corner = Pose.tilted((1, 2, -150), (0, 10, 0)).points(np.array([-50.0, -40.0, 0.0]))
    np.testing.assert_allclose(elements[0].placed[0].points[:, 0, 0], corner, rtol=0, atol=1e-12)
    page = held(scene_page(row, np.ones((8, 8)), []))
    np.testing.assert_allclose(corner_of(page, 0), corner, rtol=0, atol=1e-4)  # float32 in the mirror's frame
    assert [len(page["faces"]), page["element"]] == [12, "mirror"]
