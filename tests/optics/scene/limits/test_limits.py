"""Limits of manufacture: every key is checked from the certified side, with its place, and advice comes
before a design."""

import re
import shlex
import tomllib
from dataclasses import fields, replace
from math import inf

import numpy as np
import pytest
from hypothesis import HealthCheck, given, strategies as st

from optics.base.runtime import UserError
from optics.scene.limits import limit_advice, limit_checks, limit_sentences, require_limits
from optics.scene.problem import Limits, Problem, load_problem
from optics.scene.system import System, volume_of_made
from tests.cases import examples, python
from tests.optics.cases import write_problem
from tests.optics.scene.problem.cases import DENSITY, FREE_FRONT, designed
from thbcad.certified import Enclosure
from thbcad.lens import manufacturability
from thbcad.surfaces import THBSurface


def limited(problem, **limits):
    return replace(problem, limits=Limits(**limits))


def checks_of(problem, found, **limits):
    return limit_checks(limited(problem, **limits), found)


def bounds_of(found):
    """Return key: (certified number, whether it must be at least the limit, unit) of the strictest surface,
    rear free."""
    surfaces = found.surfaces.values()
    return {
        "thickness": (found.thickness.lower, True, "mm"),
        "centre_thickness": (found.centre_thickness.lower, True, "mm"),
        "edge_thickness": (found.edge_thickness.lower, True, "mm"),
        "greatest_thickness": (found.greatest_thickness.upper, False, "mm"),
        "radius": (min(found.rear.concave.lower, found.rear.convex.lower), True, "mm"),
        "concave_radius": (found.rear.concave.lower, True, "mm"),
        "slope": (max(s.slope.upper for s in surfaces), False, "degrees"),
        "sag_range": (max(s.heights.upper for s in surfaces), False, "mm"),
        "feature": (found.rear.feature.wavelengths(550.0), True, "wavelengths"),
        "mass": (found.mass, False, "g"),
    }


KEYS = [field.name for field in fields(Limits) if field.name != "envelope"]


def test_every_key_of_the_table_is_checked(tmp_path):
    problem, _, found = designed(tmp_path)
    assert set(bounds_of(found)) == set(KEYS)
    assert checks_of(problem, found) == []


@pytest.mark.parametrize("key", KEYS)
def test_a_limit_is_kept_up_to_the_certified_bound_and_no_further(tmp_path, key):
    problem, _, found = designed(tmp_path)
    bound, at_least, unit = bounds_of(found)[key]
    assert all(c.ok for c in checks_of(problem, found, **{key: bound}))
    missed = [c for c in checks_of(problem, found, **{key: bound * (1.25 if at_least else 0.8)}) if not c.ok]
    worst = max(missed, key=lambda check: check.value)
    assert worst.value == pytest.approx(bound * (0.25 if at_least else 0.2), rel=1e-12)
    assert (worst.limit, worst.unit) == (0, unit)
    assert f"{'short of' if at_least else 'beyond'} limits.{key}" in worst.name


def test_the_envelope_is_kept_up_to_the_certified_ends_and_no_further(tmp_path):
    """The front is a plane at z = 0, the rear's vertex lies at z = 6 mm."""
    problem, lens, found = designed(tmp_path)
    top = np.nextafter(lens.thickness + found.rear.heights.greatest.upper, inf)
    assert all(c.ok for c in checks_of(problem, found, envelope=(-1e-12, top)))
    low, high = checks_of(problem, found, envelope=(0.5, top - 0.25))
    assert (low.value, low.unit) == (pytest.approx(0.5, abs=1e-12), "mm")
    assert low.name.startswith("least z of the front short of limits.envelope, at x = ")
    assert high.value == pytest.approx(0.25, rel=1e-12)
    assert high.name.startswith("greatest z of the rear beyond limits.envelope, at x = ")
    assert len(checks_of(problem, found, envelope=(-inf, 9.0))) == 1


def test_names_say_where(tmp_path):
    problem, _, found = designed(tmp_path)
    every = {"thickness": 9.0, "radius": 900.0, "slope": 0.1, "sag_range": 0.1, "feature": 1e6, "mass": 0.1}
    names = [c.name for c in checks_of(problem, found, **every)]
    least, low, high = found.thickness, found.rear.heights.least, found.rear.heights.greatest
    assert f"thickness short of limits.thickness, at x = {least.u:.4g}, y = {least.v:.4g} mm" in names
    where = f"between x = {low.u:.4g}, y = {low.v:.4g} and x = {high.u:.4g}, y = {high.v:.4g} mm"
    assert f"range of heights of the rear beyond limits.sag_range, {where}" in names
    assert "smallest feature of the rear short of limits.feature, on level 0" in names
    assert "mass beyond limits.mass" in names
    assert len(set(names)) == len(names) == 8  # slope and heights of both surfaces


def test_radii_and_features_are_those_of_free_surfaces(tmp_path):
    """The front's paraboloid of 30 mm is as asked for; a slope is limited wherever it is."""
    limits = {"radius": 35.0, "concave_radius": 35.0, "feature": 1.0, "slope": 10.0}
    problem, _, found = designed(tmp_path, {"lens.front.radius": -30.0, "lens.front.conic": -1.0}, height=0.0)
    missed = {
        c.name.split(" short")[0].split(" beyond")[0]: c.ok for c in checks_of(problem, found, **limits)
    }
    assert missed == {
        "slope of the front": False,
        "radius of the rear": True,
        "concave radius of the rear": True,
        "smallest feature of the rear": True,
        "slope of the rear": False,
    }
    problem, _, found = designed(
        tmp_path, {"lens.front.radius": -30.0, "lens.front.conic": -1.0} | FREE_FRONT, height=0.0
    )
    names = [c.name for c in checks_of(problem, found, **limits) if not c.ok]
    assert any(name.startswith("radius of the front") for name in names)
    assert any(name.startswith("concave radius of the front") for name in names)


def test_a_tool_meets_the_hollows_only(tmp_path):
    """The rear bulges: its radius of 40 mm is convex from the air."""
    problem, _, found = designed(tmp_path, {"lens.rear.radius": -40.0, "lens.thickness": 9.0}, height=0.0)
    (hollow,) = checks_of(problem, found, concave_radius=1000.0)
    assert hollow.ok
    assert hollow.name == "concave radius of the rear short of limits.concave_radius"  # nowhere
    (any_radius,) = checks_of(problem, found, radius=1000.0)
    assert any_radius.value == pytest.approx(960.0, rel=1e-4)


def test_a_mirror_has_a_face_and_a_back():
    beam, screen = {"kind": "collimated", "half_width": (8, 8)}, {"half_width": (10, 10), "pixels": (8, 8)}
    face = {"half_width": (10, 15), "radius": -200.0, "freeform": {"z_freedom": 1.0}}
    mirror = {"kind": "mirror", "name": "M1", "tilt": (45, 0, 0), "thickness": 4, "face": face}
    target = {"kind": "tophat", "position": (0, 60, 0), "tilt": (-90, 0, 0)} | screen
    problem = Problem(source=beam, element=[mirror], target=target)
    checks = checks_of(
        problem, manufacturability(System(problem).base), radius=9.0, slope=2.0, envelope=(0.0, 9.0)
    )
    assert {re.split(" (?:short of|beyond) ", check.name)[0] for check in checks} == {
        "least z of the face",
        "greatest z of the back",
        "radius of the face",
        "slope of the face",
        "slope of the back",
    }


def test_a_limit_between_the_bounds_counts_as_missed(tmp_path):
    """What is not certain is not passed."""
    problem, _, found = designed(tmp_path)
    found = replace(found, thickness=Enclosure(2.0, 3.0, 3.0, 0.0, 0.0))
    (check,) = checks_of(problem, found, thickness=2.5)
    assert check.value == 0.5
    assert not check.ok


# Keys that need each other


def test_a_mass_needs_a_density(tmp_path):
    path = write_problem(tmp_path, {"limits.mass": 5.0})
    with pytest.raises(UserError, match=r"limits\.mass of 5 g needs lens\.density"):
        require_limits(load_problem(path))
    require_limits(load_problem(write_problem(tmp_path, {"limits.mass": 5.0, "lens.density": DENSITY})))
    require_limits(load_problem(write_problem(tmp_path)))


@pytest.mark.parametrize("key", ["thickness", "centre_thickness", "edge_thickness"])
def test_limits_of_thickness_that_contradict_each_other_are_refused(tmp_path, key):
    path = write_problem(tmp_path, {f"limits.{key}": 7.0, "limits.greatest_thickness": 6.5})
    with pytest.raises(
        UserError, match=rf"limits\.{key} of 7 mm is more than limits\.greatest_thickness of 6\.5"
    ):
        require_limits(load_problem(path))


@pytest.mark.parametrize(("ends", "thickness"), [([3.0, 3.0], 0.0), ([5.0, -1.0], 0.0), ([0.0, 4.0], 4.0)])
def test_an_envelope_must_hold_the_lens(tmp_path, ends, thickness):
    path = write_problem(tmp_path, {"limits.envelope": ends, "limits.thickness": thickness})
    with pytest.raises(
        UserError, match=r"limits\.envelope from z = .* must be higher than the least thickness"
    ):
        require_limits(load_problem(path))


# Remedies

# of the rear's paraboloid of 40 mm over 10 x 10 mm: what it has
SEVERAL = {
    "thickness": 6.0,
    "edge_thickness": 7.25,
    "greatest_thickness": 8.5,
    "slope": 19.47,
    "sag_range": 2.5,
    "concave_radius": 40.0,
    "mass": 3.2527,
}


def test_a_missed_limit_is_told_with_what_came_what_was_wanted_and_a_remedy(tmp_path):
    """The rear's paraboloid of 40 mm over 10 x 10 mm: 2.5 mm high, 6 mm thick in the middle."""
    problem, _, found = designed(tmp_path, height=0.0)

    def told(**limits):
        (sentence,) = limit_sentences(limited(problem, **limits), found)
        return sentence

    assert limit_sentences(problem, found) == []
    assert limit_sentences(limited(problem, thickness=5.9, mass=9.0), found) == []
    assert told(concave_radius=50.0) == (
        "concave radius of the rear: got 39.99 mm, wanted at least 50 mm, at x = 0, y = 0 mm: "
        "--set lens.rear.radius=50"
    )
    assert told(thickness=6.5).endswith("--set lens.thickness=6.501")
    assert told(greatest_thickness=8.0).endswith("--set lens.thickness=5.499")
    assert told(mass=3.0) == (  # 3.2527 g, and 0.476 g for each mm
        "mass: got 3.253 g, wanted at most 3 g: --set lens.thickness=5.469"
    )
    assert "got 8.501 mm, wanted at most 8 mm" in told(envelope=(-1.0, 8.0))
    assert told(envelope=(-1.0, 8.0)).endswith("--set lens.thickness=5.499")
    assert told(envelope=(0.1, 9.0)).endswith("--set lens.front.radius=inf")
    assert told(slope=10.0).endswith("--set target.distance=120.4")  # 60 mm * 19.48 / 10


def test_limits_that_ask_for_the_same_have_one_remedy(tmp_path):
    problem, _, found = designed(tmp_path, height=0.0)
    both = limited(problem, thickness=6.5, centre_thickness=6.2, edge_thickness=8.0)
    (sentence,) = limit_sentences(both, found, crossing=0.1)
    assert sentence.count("wanted at least") == 3
    assert sentence.endswith("cross by 0.1 mm: --set lens.thickness=6.751")  # the edge is 7.25 mm
    (named,) = limit_sentences(both, found, crossing=0.1, element="L1")
    assert named.count("L1: ") == 4


def test_a_lens_that_must_be_thicker_and_thinner_becomes_flatter(tmp_path):
    """6 to 8.5 mm, wanted from 6.5 to 8: the height of 2.5 must become 1.5."""
    problem, _, found = designed(tmp_path, height=0.0)
    (sentence,) = limit_sentences(limited(problem, thickness=6.5, greatest_thickness=8.0, mass=3.2), found)
    key, distance = sentence.rpartition("--set ")[2].split("=")
    assert key == "target.distance"
    assert float(distance) == pytest.approx(60 * 2.5 / 1.5, rel=3e-3)  # both ends by 1e-3 mm


def test_surfaces_that_cross_get_the_thickness_that_a_design_keeps_between_them(tmp_path):
    """A design leaves a twentieth of the thickness: 6 + 1.5 mm are 0.95 of what is needed."""
    problem, _, found = designed(tmp_path, height=0.0)
    (sentence,) = limit_sentences(problem, found, crossing=1.5)
    assert sentence.endswith("cross by 1.5 mm: --set lens.thickness=7.895")


def test_a_remedy_is_no_thickness_below_zero(tmp_path):
    """Raised by 5 mm the lens is 11 mm thick at least and 13.5 mm at most, wanted at most 4 mm."""
    problem, lens, _ = designed(tmp_path, height=0.0)
    (sag,) = lens.sags
    found = manufacturability(lens.with_sags([THBSurface(sag.space, np.full(sag.space.dim, 5.0))]), 1.19)
    (sentence,) = limit_sentences(limited(problem, greatest_thickness=4.0), found)
    assert sentence.endswith("--set limits.greatest_thickness=13.51")


def test_limits_that_no_lens_keeps_give_way(tmp_path):
    problem, _, found = designed(tmp_path, height=0.0)
    thick, thin = limit_sentences(limited(problem, thickness=7.0, greatest_thickness=7.1), found)
    assert thick.endswith("--set lens.thickness=7.001")
    assert thin.endswith("--set limits.greatest_thickness=8.501")
    (none,) = limit_sentences(limited(problem, mass=0.3), found)  # 6 mm less
    assert none.endswith("--set limits.mass=3.253")


@examples(25, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.fixed_dictionaries({}, optional={key: st.floats(0.7, 1.4) for key in SEVERAL}))
def test_no_remedy_forbids_another_and_all_can_be_copied(tmp_path, shares):
    problem, _, found = designed(tmp_path, height=0.0)
    limits = {key: SEVERAL[key] * share for key, share in shares.items()}
    sentences = limit_sentences(limited(problem, **limits), found)
    options = [word for s in sentences for word in shlex.split(s.rpartition("--set ")[2])]
    keys = [option.partition("=")[0] for option in options]
    assert len(keys) == len(set(keys)) == len(sentences)
    for option in options:
        key, _, value = option.partition("=")
        problem = problem.with_(**{key: tomllib.loads(f"value = {value}")["value"]})


def test_a_mesh_too_fine_is_told_its_level(tmp_path):
    problem, lens, found = designed(tmp_path, height=0.5)
    (sag,) = lens.sags
    refined = lens.with_sags([sag.refine({0: sag.space.cells[:, 1:]})])
    limits = limited(problem, feature=2e4, concave_radius=30.0)
    (sentence,) = limit_sentences(limits, manufacturability(refined))
    assert sentence.endswith("--set lens.rear.freeform.max_level=0")
    (radius,) = limit_sentences(limits, found)
    assert "--set 'lens.rear.freeform.spans=[" in radius


@pytest.mark.parametrize("key", KEYS)
def test_a_limit_at_the_number_that_came_is_kept(tmp_path, key):
    problem, _, found = designed(tmp_path)
    bound, at_least, _ = bounds_of(found)[key]
    sentences = limit_sentences(limited(problem, **{key: bound * (1.3 if at_least else 0.7)}), found)
    numbers = [float(number) for s in sentences for number in re.findall(r": got (\S+) ", s)]
    allowed = (min if at_least else max)(numbers)
    assert limit_sentences(limited(problem, **{key: allowed}), found) == []


# Advice


def advice(folder, changes):
    problem, lens, _ = designed(folder, changes)
    return limit_advice(problem, lens)


def test_no_limits_need_no_advice(tmp_path):
    assert advice(tmp_path, {}) == []


@pytest.mark.every(2)
@pytest.mark.parametrize(
    ("key", "kept", "broken", "sentence"),
    [
        (
            "radius",
            40.0,
            45.0,
            "before optimisation the radius of the rear is 5 mm short of limits.radius, at x = 0, y = 0 mm",
        ),
        (
            "concave_radius",
            40.0,
            50.0,
            "the concave radius of the rear is 10 mm short of limits.concave_radius",
        ),
        (
            "slope",
            19.5,
            10.0,
            "the slope of the rear is 9.471 degrees beyond limits.slope",
        ),  # atan(sqrt(200) / 40) = 19.471
        (
            "sag_range",
            2.5,
            2.0,
            "the range of heights of the rear is 0.5 mm beyond limits.sag_range",
        ),  # 200 / 80
        ("thickness", 6.0, 7.0, "the thickness is 1 mm short of limits.thickness, at x = 0, y = 0 mm"),
        ("centre_thickness", 6.0, 6.5, "the centre thickness is 0.5 mm short of limits.centre_thickness"),
        (
            "edge_thickness",
            7.25,
            8.25,
            "the edge thickness is 1 mm short of limits.edge_thickness",
        ),  # 6 + 100 / 80
        (
            "mass",
            4.0,
            3.0,
            "the mass is 0.2527 g beyond limits.mass",
        ),  # 400 (6 + 5/6) mm^3 of 1.19 g/cm^3 make 3.2527 g
    ],
)
def test_advice_where_the_conics_alone_miss_a_limit(tmp_path, key, kept, broken, sentence):
    """A limit at the conic's own figure is not called broken for the width of the bounds."""
    assert advice(tmp_path, {f"limits.{key}": kept}) == []
    found = advice(tmp_path, {f"limits.{key}": broken})
    assert len(found) == 1
    assert sentence in found[0]


def test_advice_on_levels_too_fine_for_the_features(tmp_path):
    """Level 0 has spans of 5 mm: features of 15 mm are 27273 wavelengths, those of level 2 6818."""
    assert advice(tmp_path, {"limits.feature": 6800.0}) == []
    (sentence,) = advice(tmp_path, {"limits.feature": 6900.0})
    assert sentence == (
        "limits.feature holds up to level 1, but lens.rear.freeform.max_level is 2: the mesh stays at level 1"
    )
    (sentence,) = advice(tmp_path, {"limits.feature": 30000.0})
    assert (
        sentence
        == "limits.feature is 30000 wavelengths, but level 0 of lens.rear.freeform has 2.727e+04: take "
        "fewer spans"
    )
    assert advice(tmp_path, {"limits.feature": 20000.0} | FREE_FRONT) == [
        f"limits.feature holds up to level 0, but lens.{name}.freeform.max_level is {level}: "
        "the mesh stays at level 0"
        for name, level in (("front", 1), ("rear", 2))
    ]


@pytest.mark.slow
def test_advice_does_not_load_the_cad_kernel(tmp_path):
    write_problem(tmp_path, {"limits.radius": 50.0})
    program = (
        "import sys; from optics.scene.limits import limit_advice; "
        "from optics.scene.problem import load_problem; "
        "from optics.scene.system import System; p = load_problem(sys.argv[1]); "
        "print(len(limit_advice(p, System(p).base)), 'OCP' in sys.modules)"
    )
    done = python(program, tmp_path / "problem.toml", check=True)
    assert done.stdout.split() == ["1", "False"]


def test_a_mass_needs_the_density_of_every_free_element():
    size = {"half_width": (10, 10)}
    free = size | {"radius": 40.0, "freeform": {"z_freedom": 1.0}}
    lens = {"kind": "lens", "index": 1.5, "thickness": 6, "front": size, "rear": free}
    problem = Problem(
        source={"kind": "collimated", "half_width": (8, 8)},
        element=[
            lens | {"name": "L1"},
            lens | {"name": "L2", "position": (0, 0, 20), "density": 1.2},
        ],
        target={"kind": "tophat", "position": (0, 0, 90), "half_width": (9, 9), "pixels": (16, 16)},
        limits={"mass": 9.0},
    )
    with pytest.raises(UserError, match=r"limits.mass of 9 g needs element.L1.density"):
        require_limits(problem)


@pytest.mark.parametrize("changes", [{}, {"lens.front.half_width": [6.0, 8.0]}, {"lens.outline": "round"}])
def test_the_thickness_told_for_a_mass_keeps_it_and_hardly_more(tmp_path, changes):
    """Of front and rear of unequal size the volume grows with neither area."""
    problem, lens, found = designed(tmp_path, changes)
    (sentence,) = limit_sentences(limited(problem, mass=0.9 * found.mass), found)
    thickness = float(sentence.rpartition("=")[2])
    mass = manufacturability(replace(lens, thickness=thickness), found.density).mass
    assert 0.899 * found.mass < mass <= 0.9 * found.mass


def test_the_radius_told_for_a_slope_of_a_paraboloid_keeps_it_at_once(tmp_path):
    steep = {"lens.front.radius": -14.0, "lens.front.conic": -1.0, "lens.thickness": 20.0}
    problem, _, found = designed(tmp_path, steep)
    sentences = limit_sentences(limited(problem, slope=30.0), found)
    radius = float(next(s for s in sentences if "slope of the front" in s).rpartition("=")[2])
    corner = np.hypot(*problem.lens.front.half_width)
    assert np.degrees(np.arctan(corner / abs(radius))) == pytest.approx(30.0, abs=0.01)


def test_a_height_that_is_the_limit_by_its_formula_keeps_it(tmp_path):
    """10 x 10 mm of a paraboloid of 40 mm are 2.5 mm high; certified bounds are a rounding wider."""
    problem, _, found = designed(tmp_path, height=0.0)
    assert found.rear.heights.upper > 2.5
    assert limit_sentences(limited(problem, sag_range=2.5), found) == []
    assert limit_sentences(limited(problem, sag_range=2.4999), found)


def test_advice_weighs_what_is_made(tmp_path):
    """Four lenses and their land: more than four times one lens."""
    plate = {"lens.array.columns": 2, "lens.array.rows": 2, "lens.array.pitch": 22.0}
    problem, lens, found = designed(tmp_path, plate, height=0.0)
    limits = limited(problem, mass=1.0)
    alone = 4 * found.mass
    made = volume_of_made(problem.optic, lens)
    (sentence,) = limit_advice(limits, lens, made)
    assert float(re.search(r"mass is (\S+) g beyond", sentence)[1]) > alone - 1.0
