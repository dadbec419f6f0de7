"""What a problem is told before any tracing, and the nearest geometry that works."""

import math
import re
import tomllib

import numpy as np
import pytest
from PIL import Image

from optics.base.runtime import UserError
from optics.scene.problem import load_problem
from optics.scene.system import can_be_lit, nearest_geometry, solvable_system
from optics.scene.system.soundness import CONIC_SLOPE, advice
from tests.optics.cases import flat_problem, small_system, write_problem
from tests.optics.scene.problem.cases import MIRROR, load_text, refusal

# ---- advice ----


def advised(folder, changes):
    return advice(solvable_system(load_problem(write_problem(folder, changes))))


LAMBERTIAN = {"source.kind": "lambertian", "source.half_width": [0.5, 0.5], "source.distance": 4.0}
BLURRED = LAMBERTIAN | {"optimizer.window": "bspline", "optimizer.lost_flux_weight": 0.0}


def test_the_small_problem_needs_no_advice(tmp_path):
    assert advised(tmp_path, {}) == []


@pytest.mark.parametrize(
    ("changes", "given"),
    [
        (LAMBERTIAN, True),
        (BLURRED, False),
        (BLURRED | {"optimizer.window": "pixel"}, True),
        (BLURRED | {"optimizer.lost_flux_weight": 1.5}, True),
        (BLURRED | {"optimizer.lost_flux_weight": 1.0}, False),
    ],
)
def test_extended_sources_are_told_what_suits_them(tmp_path, changes, given):
    told = " ".join(advised(tmp_path, changes))
    assert ("an extended source blurs its light anyway" in told) == given


@pytest.mark.parametrize(
    ("changes", "given"),
    [
        ({"lens.rear.conic": 0.0, "target.distance": 60.0, "target.half_width": [20.0, 20.0]}, True),
        ({"lens.rear.conic": 0.0, "target.distance": 4.0, "target.half_width": [8.0, 8.0]}, False),
        ({"lens.rear.conic": 0.0, "verify.landing": 2e-7}, False),
        ({"lens.rear.conic": 0.0, "target.distance": math.inf, "target.half_width": [20.0, 20.0]}, False),
        ({"lens.front.radius": 80.0, "lens.front.conic": -2.0}, True),
        ({"lens.front.radius": 80.0, "lens.front.conic": -1.0}, False),
    ],
    ids=str,
)
def test_conics_that_step_holds_as_splines_are_weighed_against_the_limit_of_landing_points(
    tmp_path, changes, given
):
    """2e-9 of the distance against verify.landing, 1e-8 mm unless it is given: 60 mm make 1.2e-7 mm, 4 mm
    make 8e-9 mm."""
    assert CONIC_SLOPE * 60 > 1e-8 > CONIC_SLOPE * 4
    told = " ".join(advised(tmp_path, changes))
    assert ("STEP holds conics other than paraboloids as splines" in told) == given


def test_missed_limits_are_part_of_the_advice(tmp_path):
    (sentence,) = advised(tmp_path, {"limits.thickness": 7.0})
    assert sentence.startswith("before optimisation the thickness is 1 mm short of limits.thickness")


POINT = {"name": "point", "points": ((100, 0),), "least": 4000.0}
CUT = {"name": "cut", "box": ((-150, 20), (150, 80)), "greatest": 500.0}
SMALLER = CUT | {"box": ((-50, 40), (50, 80))}


def advised_of_zones(zone, flux, half_width=(200, 100)):
    """Return what is advised where a lens lights zones on a screen 1 m away with so many lumens."""
    source = {"kind": "collimated", "half_width": (9.5, 9.5), "unit": "lm", "flux": flux}
    target = {"kind": "zones", "distance": 1000.0, "pixels": (48, 24), "half_width": half_width, "zone": zone}
    rear = {"half_width": (10, 10), "radius": "auto", "conic": -1.0}
    return advice(solvable_system(flat_problem(source, target, {"rear": rear})))


@pytest.mark.every(4)
@pytest.mark.parametrize(
    ("zone", "flux", "missed", "remedy", "changes"),
    [
        ([POINT], 1.0, "the lower limit of point at (100, 0)", "raise source.flux", {"flux": 10.0}),
        (
            [POINT],
            1.0,
            "the lower limit of point at (100, 0)",
            "make target.half_width smaller",
            {"half_width": (150, 60)},
        ),
        ([CUT], 400.0, "the upper limit of cut, brightest", "a lower source.flux", {"flux": 100.0}),
        ([CUT], 400.0, "the upper limit of cut, brightest", "make the zone smaller", {"zone": [SMALLER]}),
        (
            [POINT, CUT],
            400.0,
            "the upper limit of cut, brightest",
            "a larger target.half_width",
            {"half_width": (250, 125)},
        ),
    ],
    ids=["more flux", "smaller target", "less flux", "smaller zone", "larger target"],
)
def test_rows_of_zones_that_the_light_aimed_at_misses_are_told_with_what_helps(
    zone, flux, missed, remedy, changes
):
    """Such light is no bound: the design may miss the rows too, and may keep them."""
    given = {"zone": zone, "flux": flux}
    (sentence,) = advised_of_zones(**given)
    assert f"which a design starts to aim at, misses {missed} by " in sentence
    assert "the design may miss it too; " in sentence
    assert remedy in sentence.partition("; ")[2]
    assert advised_of_zones(**(given | changes)) == []


@pytest.mark.parametrize("half_width", [19.0, 21.0])
def test_a_beam_that_is_dark_before_the_lens_is_refused(tmp_path, half_width):
    """The outer quarters of the picture glow: beyond 9.5 mm, before 10 mm of lens, or beyond 10.5 mm."""
    glow = np.full((8, 8), 255, dtype=np.uint8)
    glow[2:6, 2:6] = 0
    Image.fromarray(glow).save(tmp_path / "glow.png")
    changes = {"source.profile": "image", "source.image": "glow.png", "source.half_width": [half_width] * 2}
    problem = load_problem(write_problem(tmp_path, changes))
    if half_width == 19.0:
        assert solvable_system(problem)
    else:
        with pytest.raises(UserError, match=r"source\.image is dark wherever it meets the lens"):
            solvable_system(problem)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"limits.mass": 1.0}, "needs lens.density"),
        ({"lens.thickness": 1.0, "lens.rear.radius": -20.0}, "the surfaces cross"),
        ({"target.half_width": [200.0, 20.0]}, "degrees aside from the beam"),
        (
            LAMBERTIAN
            | {"source.half_width": [5.0, 5.0], "source.distance": 0.1, "lens.front.radius": -20.0},
            "source",
        ),
    ],
    ids=["mass", "crossing", "reach", "source"],
)
def test_problems_that_cannot_be_solved_are_refused_before_any_tracing(tmp_path, changes, words):
    with pytest.raises(UserError, match=words):
        solvable_system(load_problem(write_problem(tmp_path, changes)))


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


@pytest.mark.every(3)
@pytest.mark.parametrize("case", [*OF_LENS, *OF_MIRROR])
def test_what_a_refusal_proposes_is_not_refused(tmp_path, case):
    if case in OF_LENS:
        problem = load_problem(write_problem(tmp_path, OF_LENS[case]))
    else:
        problem = load_text(tmp_path, MIRROR).with_(**OF_MIRROR[case])
    proposed = options(refusal(solvable_system, problem))
    assert proposed
    for change in proposed:
        assert can_be_lit(solvable_system(problem.with_(**change)))


@pytest.mark.parametrize(
    "changes",
    [
        {"target.position": (0, 0, 60), "target.tilt": (0, 0, 0)},
        FAR | {"target.tilt": (0, 0, 0)},
        # eight times as far away the target would stand at the origin
        {"element.M1.position": (0, 0, 80), "element.M1.tilt": (0, 0, 0), "target.half_width": (5, 5)}
        | {"target.position": (0, 0, 70), "target.tilt": (0, 0, 0)},
    ],
    ids=["straight on", "far field straight on", "to the origin"],
)
def test_a_way_that_has_no_direction_or_length_is_not_proposed(tmp_path, changes):
    """No mirror lets light go straight on."""
    sentence = refusal(solvable_system, load_text(tmp_path, MIRROR).with_(**changes))
    assert "of the light is asked for" in sentence
    assert "element.M1.tilt" not in sentence


def test_the_nearest_distance_is_the_least_that_serves(tmp_path):
    """The last pixel's centre lies at 200 (31 / 32) mm, the beam ends at 9.5 mm: it is arccos(1 / 1.5) aside
    from 165 mm.  The next of 64 steps up to the eightfold distance is 3.3 % farther, and has three digits."""
    wide = load_problem(write_problem(tmp_path, OF_LENS["wide"] | {"target.pixels": [32, 32]}))
    assert wide.target.kind == "image"
    (change,) = options(refusal(solvable_system, wide))
    needed = (200 * 31 / 32 - 9.5) / np.tan(np.arccos(1 / 1.5))
    assert needed < change["target.distance"] < 1.033 * needed + 0.5


def test_a_target_is_turned_no_farther_than_it_must(tmp_path):
    """A small target with its back to the lens, on the axis: 75 degrees of incidence and no step more."""
    changes = OF_LENS["turned away"] | {"target.half_width": [0.5, 0.5]}
    system = small_system(tmp_path, changes)
    (tilt,) = (c["target.tilt"] for o in nearest_geometry(system, can_be_lit) for c in options(o))
    turned = system.elsewhere(system.problem.with_(**{"target.tilt": tilt})).target.receiver.pose
    assert 75 - 180 / 64 < np.degrees(np.arccos(turned.rotation[2, 2])) < 75


def test_a_smaller_target_is_proposed_only_where_no_other_place_serves(tmp_path):
    ball = load_problem(write_problem(tmp_path, OF_LENS["ball"]))
    assert [*options(refusal(solvable_system, ball))[0]] == ["target.half_width"]
    system = small_system(tmp_path, {})
    assert nearest_geometry(system, lambda other: False) == []


def test_traces_may_be_apart_by_roundings_of_the_way_to_a_far_target(tmp_path):
    """10 km away the last digit of a landing point is 2e-9 mm."""
    near, far = (
        small_system(tmp_path, {"target.distance": distance}).traced_within for distance in (300.0, 1e7)
    )
    assert near.landing == 1e-8
    assert 1e-7 < far.landing < 1e-6
    assert far.irradiance == near.irradiance
