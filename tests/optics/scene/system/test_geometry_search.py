"""The nearest geometry that works, as sentences name it: as it is written, light can be sent there."""

import re
import tomllib

import numpy as np
import pytest

from optics.base.runtime import UserError
from optics.scene.problem import load_problem
from optics.scene.system import OpticalSystem, can_be_lit, nearest_geometry, solvable_system
from tests.optics.cases import write_problem
from tests.optics.scene.problem.cases import MIRROR, load_text

AWAY, INF = {"target.distance": False}, float("inf")
FAR = {"target.surface": "far_field", "target.position": False, "target.half_width": (20.0, 20.0)}
OF_LENS = {
    "turned away": {"target.tilt": [180.0, 0.0, 0.0]},
    "turned aside": {"target.tilt": [0.0, 130.0, 0.0]},
    "before the lens": AWAY | {"target.position": [0.0, 0.0, -60.0]},
    "far field behind": {"target.distance": INF, "target.tilt": [120.0, 0.0, 0.0]},
    "far aside": AWAY | {"target.position": [150.0, 0.0, 60.0], "target.tilt": [0.0, 45.0, 0.0]},
    "wide": {"target.half_width": [200.0, 20.0]},
    "ball": {
        "target.kind": "tophat",
        "target.image": "",
        "target.lit": [1.0, 1.0],
        "target.surface": "sphere",
        "target.radius": 13.0,
    },
}
OF_MIRROR = {
    "behind the mirror": {"target.position": (0, -60, 0)},
    "its back": {"target.tilt": (90, 0, 0)},
    "half of it": {"target.position": (0, 30, 40)},
    "far field": FAR | {"target.tilt": (90, 0, 0)},
}


def options(sentence):
    """Return the changes that a sentence proposes, each {key: value}."""
    found = re.findall(r"--set '?([\w.]+)=(\[[^]]*\]|[^' ]+)", sentence)
    return [{key: tomllib.loads(f"value = {value}")["value"]} for key, value in found]


def refused(problem):
    with pytest.raises(UserError) as caught:
        solvable_system(problem)
    return str(caught.value)


@pytest.mark.every(3)
@pytest.mark.parametrize("case", [*OF_LENS, *OF_MIRROR])
def test_what_a_refusal_proposes_is_not_refused(tmp_path, case):
    if case in OF_LENS:
        problem = load_problem(write_problem(tmp_path, OF_LENS[case]))
    else:
        problem = load_text(tmp_path, MIRROR).with_(**OF_MIRROR[case])
    proposed = options(refused(problem))
    assert proposed
    for change in proposed:
        assert can_be_lit(solvable_system(problem.with_(**change)))


def test_the_nearest_distance_is_the_least_that_serves(tmp_path):
    """The last pixel's centre lies at 200 (31 / 32) mm, the beam ends at 9.5 mm: it is arccos(1 / 1.5) aside
    from 165 mm.  The next of 64 steps up to the eightfold distance is 3.3 % farther, and has three digits."""
    wide = load_problem(write_problem(tmp_path, OF_LENS["wide"] | {"target.pixels": [32, 32]}))
    assert wide.target.kind == "image"
    (change,) = options(refused(wide))
    needed = (200 * 31 / 32 - 9.5) / np.tan(np.arccos(1 / 1.5))
    assert needed < change["target.distance"] < 1.033 * needed + 0.5


def test_a_target_is_turned_no_farther_than_it_must(tmp_path):
    """A small target with its back to the lens, on the axis: 75 degrees of incidence and no step more."""
    changes = OF_LENS["turned away"] | {"target.half_width": [0.5, 0.5]}
    system = OpticalSystem(load_problem(write_problem(tmp_path, changes)))
    (tilt,) = (c["target.tilt"] for o in nearest_geometry(system, can_be_lit) for c in options(o))
    turned = system.elsewhere(system.problem.with_(**{"target.tilt": tilt})).target.receiver.pose.rotation[
        2, 2
    ]
    assert 75 - 180 / 64 < np.degrees(np.arccos(turned)) < 75


def test_a_smaller_target_is_proposed_only_where_no_other_place_serves(tmp_path):
    assert [*options(refused(load_problem(write_problem(tmp_path, OF_LENS["ball"]))))[0]] == [
        "target.half_width"
    ]
    system = OpticalSystem(load_problem(write_problem(tmp_path, {})))
    assert nearest_geometry(system, lambda other: False) == []
