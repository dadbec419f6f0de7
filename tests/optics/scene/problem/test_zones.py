"""Zones of a problem file: what is refused, in one sentence each, and what is kept."""

import re

import numpy as np
import pytest

import optics
from optics import UserError
from optics.scene.problem import load_problem
from tests.optics.cases import write_problem
from tests.optics.scene.problem.cases import load_text, refusal

ZONES = {"source.unit": "lm", "target.distance": np.inf, "target.half_width": [16.0, 8.0]}
POINT = {"points": [[0, 0]], "least": 5.0}

REFUSED = {
    "outside": ({"points": [[0, 9]], "least": 5.0}, r"zone 0: \(0, 9\) lies outside .* \[16, 8\]; make"),
    "by the goniometer": ({"points": [[15, 7.9]], "least": 5.0}, r"\(15, 7.9\) lies outside"),
    "no way round": ({"points": [[0, 185]], "least": 5.0}, r"\(0, 185\) lies outside"),
    "crossed limits": (POINT | {"greatest": 4.0}, "zone 0: least must be at most greatest, got 5 and 4"),
    "no limit": ({"points": [[0, 0]]}, "zone 0 has no limit; give it least or greatest"),
    "no place": ({"least": 5.0}, "zone 0 must have one of points, box, line and polygon, got none"),
    "two places": (POINT | {"line": [[0, 0], [1, 1]]}, "zone 0 must have one of .*, got points and line"),
    "half a box": ({"box": [[0, 0]], "least": 1.0}, r"zone 0: box must be 2 rows \[H, V\], got 1"),
    "two corners": ({"polygon": [[0, 0], [1, 1]], "least": 1.0}, "polygon must be at least 3 rows"),
    "lx far away": (POINT | {"unit": "lx"}, "zone 0 has limits in lx, and a target in the far field .* cd"),
    "unknown key": (POINT | {"lest": 5.0}, r"unknown key target.zone\[0\].lest \(did you mean .*least"),
    "three numbers": ({"points": [[0, 0, 0]], "least": 1.0}, r"points\[0\] must be a list of 2 numbers"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_zone_that_cannot_be_meant_is_refused(case, tmp_path):
    zone, sentence = REFUSED[case]
    assert re.search(sentence, refusal(load_problem, write_problem(tmp_path, ZONES), {"target.zone": [zone]}))


OTHERS = {
    "watts": ({"source.unit": "W", "target.zone": [POINT]}, "source.unit is 'W'; set it to \"lm\""),
    "regulation": ({"target.regulation": "UB2"}, "regulation must be one of .*'FMVSS 108 UB2'.*, got 'UB2'"),
    "near": (
        {"target.regulation": "FMVSS 108 UB2", "target.distance": 60.0},
        "limits in cd, .* has light in lx",
    ),
    "narrow": (
        {"target.regulation": "FMVSS 108 UB2", "target.half_width": [10.0, 8.0]},
        r"FMVSS 108 UB2: \(-12, 0\) lies outside the target",
    ),
    "fine": (
        {"target.zone": [POINT], "target.aperture": 1e-3},
        r"target.aperture = 0.001 is read on too many pixels; it must be at least 0.0\d+",
    ),
    "none": (
        {"target.kind": "zones", "target.image": "", "verify.contrast_error": 0.25},
        r"needs a \[\[target.zone\]\] or target.regulation; add one",
    ),
}


@pytest.mark.parametrize("case", OTHERS)
def test_zones_that_do_not_go_with_their_problem_are_refused(case, tmp_path):
    changes, sentence = OTHERS[case]
    with pytest.raises(UserError, match=sentence):
        load_problem(write_problem(tmp_path, ZONES), changes)


def test_zones_of_a_file_come_back_from_its_own_text_and_keys_change_by_their_names(tmp_path):
    zones = [{"name": "hot", "points": [[0, 0]], "least": 5.0}, {"line": [[-9, 0], [9, 0]], "greatest": 9.0}]
    problem = load_problem(write_problem(tmp_path, ZONES | {"target.kind": "zones"}), {"target.zone": zones})
    assert load_text(tmp_path, problem.to_toml()) == problem
    brighter = problem.with_(**{"target.zone.hot.least": 7.0})
    assert brighter.target.zone == (
        optics.Zone(name="hot", points=((0, 0),), least=7.0),
        problem.target.zone[1],
    )
    assert [name for name, _ in problem.target.zones] == ["hot", "zone 1"]
