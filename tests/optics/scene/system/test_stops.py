"""Where stops may stand."""

import re

import pytest

from optics.base.runtime import UserError
from optics.scene.problem import Problem
from optics.scene.system import solvable_system

INSIDE = "stop.rim reaches into the lens, which may fill z = -1 to 11 mm"


SIZE = {"half_width": (10, 10)}
LENS = {"index": 1.5, "thickness": 6, "front": SIZE, "rear": SIZE | {"freeform": {"z_freedom": 1.0}}}
BEAM = {"kind": "collimated", "half_width": (8, 8), "distance": 20}
SCREEN = {"kind": "tophat", "half_width": (12, 12), "pixels": (16, 16)}


def rim(**stop):
    """Return a list of one stop, by what differs from a hole of 3 mm at z = 3 mm."""
    return [{"name": "rim", "shape": "ellipse", "half_width": (3, 3), "position": (0, 0, 3), **stop}]


def refusal(**stop: object) -> str:
    """Return why a stop is refused, "" where it is not: beside a lens of 20 x 20 x 6 mm, z_freedom 5 mm."""
    lens = LENS | {"front": SIZE | {"radius": -50.5}, "rear": SIZE, "outline": "round"}
    problem = Problem(source=BEAM, lens=lens, target=SCREEN | {"distance": 60}, stop=rim(**stop))
    try:
        solvable_system(problem)
    except UserError as error:
        return str(error)
    return ""


@pytest.mark.parametrize(
    "stop",
    [
        {},
        {"hole": False},
        {"half_width": (9.9, 9.9)},
        {"half_width": (9.9, 9.9), "position": (0, 0, -0.5)},
        {"position": (12.9, 0, 3), "hole": False},
        {"position": (9, 9, 3), "hole": False},
        {"shape": "ring", "half_width": (12, 12), "inner": (9.9, 9.9), "hole": False},
        {"position": (0, 0, 25), "tilt": (0, 70, 0)},
    ],
)
def test_a_stop_in_the_glass_is_refused(stop):
    assert refusal(**stop).startswith(INSIDE)


@pytest.mark.parametrize(
    "stop",
    [
        {"half_width": (10.1, 10.1)},
        {"position": (0, 0, -1.5)},
        {"position": (0, 0, 11.5), "hole": False},
        {"position": (13.1, 0, 3), "hole": False},
        {"position": (9.5, 9.5, 3), "hole": False},  # beside the corner that a round lens has not
        {"shape": "ring", "half_width": (12, 12), "inner": (10.1, 10.1), "hole": False},
        {"position": (0, 0, 25), "tilt": (0, 70, 0), "hole": False},
    ],
)
def test_a_stop_that_leaves_room_for_the_lens_is_taken(stop):
    assert refusal(**stop) == ""


@pytest.mark.parametrize(
    ("z", "words"),
    [
        (-19.9, r"stop\.rim reaches to z = -20\.4.* mm, but the source is at z = -20 mm"),
        (66.0, r"stop\.rim reaches to z = 66\.5.* mm, but the target is at z = 66 mm"),
    ],
)
def test_a_stop_before_the_source_or_behind_the_target_is_refused(z, words):
    assert re.search(words, refusal(position=(0, 0, z), tilt=(10, 0, 0)))


@pytest.mark.parametrize(
    ("stop", "named"),
    [
        ({"position": (0, 0, -37)}, "element.L1"),
        ({"position": (0, 0, 3)}, "element.M1"),
        ({"position": (0, 0, 3), "half_width": (30, 30)}, ""),
        ({"position": (0, 8, 8), "hole": False}, "element.M1"),
        ({"position": (0, 0, 12), "hole": False}, ""),  # behind the tilted blank
        ({"position": (0, 0, -12)}, ""),  # the mirror reaches to z = -14 mm, but far beside the hole
        ({"position": (0, 0, -60)}, ""),
    ],
)
def test_a_stop_is_kept_out_of_every_element_where_that_lies(stop, named):
    """L1 fills z = -40 to -34 mm; the free face of M1 lies about y = z, its blank 4 mm behind."""
    lens = {"kind": "lens", "name": "L1", "index": 1.5, "thickness": 6, "position": (0, 0, -40)}
    lens |= {"front": SIZE, "rear": SIZE | {"freeform": False}}
    face = {"half_width": (14, 20), "radius": float("inf"), "conic": 0, "freeform": {"z_freedom": 1}}
    mirror = {"kind": "mirror", "name": "M1", "tilt": (45, 0, 0), "thickness": 4, "face": face}
    target = SCREEN | {"position": (0, 60, 0), "tilt": (-90, 0, 0)}
    source = BEAM | {"distance": 100}
    problem = Problem(source=source, element=[lens, mirror], target=target, stop=rim(**stop))
    if not named:
        solvable_system(problem)
        return
    with pytest.raises(UserError, match=f"stop.rim reaches into {named}, which may fill"):
        solvable_system(problem)


def test_no_plane_of_a_source_that_is_placed_bounds_a_stop():
    """As `source.distance` tells it, at -60 mm; the distance that a placed one does not use is 2 mm."""

    def system(**source):
        point = {"kind": "point", "half_angle": 10.0, **source}
        stop = rim(position=(0, 0, -20))
        return solvable_system(Problem(source=point, lens=LENS, target=SCREEN | {"distance": 60}, stop=stop))

    plain, there = system(distance=60), system(position=(0, 0, -60))
    assert [s.pose for s in plain.stops] == [s.pose for s in there.stops]


@pytest.mark.parametrize(
    "target", [{"distance": 60}, {"position": (0, 0, 66)}, {"distance": 60, "tilt": (0, 0, 90)}]
)
def test_no_stop_lies_behind_a_target_however_that_is_placed(target):
    problem = Problem(source=BEAM, lens=LENS, target=SCREEN | target, stop=rim(position=(0, 0, 70)))
    with pytest.raises(UserError, match="but the target is at z = 66 mm"):
        solvable_system(problem)
