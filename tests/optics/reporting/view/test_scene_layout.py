"""Where things stand in the picture of a scene: in scale, and no lens behind the target."""

import numpy as np
import pytest

from optics.reporting.view.photo_room import photo_room
from optics.reporting.view.scene_layout import LONG, SHORT, block_means, box_of, drawn_elements, placed
from optics.scene.problem import Problem
from optics.scene.system import System


def scene_of(system):
    return placed(system, drawn_elements(system))


def test_a_beam_wider_than_the_lens_does_not_rule_the_picture(made):
    scene = scene_of(made({"source.half_width": [4000.0, 8.0]}))
    assert np.ptp(scene.source, axis=1) == pytest.approx([2 * 1.3 * 10.0, 2 * 8.0, 0.0], rel=1e-14)


def test_every_source_is_drawn_at_its_place():
    """One alone, and an array of round ones that is turned a quarter around y."""
    source = {"kind": "lambertian", "half_width": (1.0, 0.5), "half_angle": 60.0}
    row = {
        "tilt": (0.0, 90.0, 0.0),
        "array": {"columns": 3, "rows": 2, "pitch": (4.0, 6.0)},
        "profile": "round",
    }
    sources = [source | {"position": (1.0, 2.0, -30.0)}, source | {"position": (0.0, 0.0, -15.0)} | row]
    side = {"half_width": (12, 12), "freeform": {"spans": (4, 4)}}
    lens = {"index": 1.5, "thickness": 6, "front": {"half_width": (12, 12)}, "rear": side}
    target = {"kind": "tophat", "distance": 60, "half_width": (30, 30), "pixels": (12, 12)}
    system = System(Problem(source=sources, lens=lens, target=target))
    scene = placed(system, drawn_elements(system))
    first, *others = (source.outline for source in scene.sources)
    assert box_of(first) == pytest.approx(np.array([[0.0, 2.0], [1.5, 2.5], [-30.0, -30.0]]), abs=1e-12)
    middles = {tuple(np.round(box_of(outline).mean(axis=1), 9) + 0.0) for outline in others}
    assert middles == {(0.0, y, z - 15.0) for y in (-3.0, 3.0) for z in (-4.0, 0.0, 4.0)}
    for outline in others:
        assert np.ptp(outline, axis=1) == pytest.approx([0.0, 1.0, 2.0], abs=1e-12)
    assert [lamp.pose for lamp in photo_room(system).lamps] == [s.pose for s in scene.sources]


@pytest.mark.parametrize("distance", [8.0, 60.0, 1000.0, 5e4, 1e7])
@pytest.mark.parametrize("half_width", [2.0, 20.0, 3000.0])
def test_the_target_leaves_the_lens_free(made, distance, half_width):
    """The target lies at the right of the lens, and its drawn distance within limits of the sizes; factors
    differ by 2.5 at most."""
    far = {"target.distance": distance, "target.half_width": [half_width] * 2}
    scene = scene_of(made(far | {"lens.rear.radius": float("inf")}))
    assert scene.box(scene.lens)[1, 0] < scene.box(scene.outlook)[0, 0]
    drawn = distance / scene.squeeze / (half_width + 10.0)
    assert SHORT * (1 - 1e-12) <= drawn <= 2.5 * LONG * (1 + 1e-12)


@pytest.mark.parametrize("position", [(30.0, 0.0, 70.0), (-30.0, 0.0, 70.0), (0.0, -30.0, 30.0)])
def test_a_target_aside_shows_its_face_and_is_drawn_as_it_is(made, position):
    """It faces the lens, and is seen at 15 degrees from its edge; the near one begins beside the lens."""
    tilt = [-np.degrees(np.arctan2(position[1], 60.0)), np.degrees(np.arctan2(position[0], 60.0)), 0.0]
    place = {"target.distance": False, "target.position": list(position), "target.tilt": tilt}
    system = made(place | {"target.half_width": [10.0, 10.0]})
    scene = scene_of(system)
    assert abs(scene.turn[2] @ system.target.receiver.pose.rotation[:, 2]) > np.sin(np.radians(15))
    assert scene.squeeze == 1
    rim = system.target.receiver.points(*10.0 * np.array([[-1, 1, 1, -1], [-1, -1, 1, 1]]))
    assert scene.outlook == pytest.approx(np.stack(rim), abs=1e-13)


def test_things_are_drawn_in_scale_up_to_the_lens_and_shorter_behind_it(made):
    scene = scene_of(made({"target.distance": 1e4}))
    top = scene.lens[2, 1]
    x = np.array([[1.0, -2.0, 3.0], [0.5, 4.0, -1.0], [-30.0, 0.0, top]])
    assert scene(x) == pytest.approx(scene.turn[:2] @ x, abs=1e-13)
    behind = x + np.array([[0.0], [0.0], [top + 1.0]])
    short = np.stack([*behind[:2], top + (behind[2] - top) / scene.squeeze])
    at = behind[2] > top
    assert scene.squeeze > 1
    assert scene(behind[:, at]) == pytest.approx(scene.turn[:2] @ short[:, at], abs=1e-12)


def test_block_means_are_those_of_the_pixels_that_there_are():
    data = np.arange(15.0).reshape(3, 5)
    assert block_means(data, 2).tolist() == [[3.0, 5.0, 6.5], [10.5, 12.5, 14.0]]
    assert block_means(data, 1) is data
