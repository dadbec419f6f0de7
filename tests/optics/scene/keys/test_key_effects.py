"""Keys that another key leaves without effect are refused; all others change what is solved."""

import math
from copy import copy
from dataclasses import fields, replace

import numpy as np
import pytest

from optics.base.runtime import UserError
from optics.scene.keys import keys_of
from optics.scene.problem import Problem
from optics.scene.sources import (
    CollimatedBeam,
    LambertianArea,
    LuminaireSource,
    PointSource,
    RayFileSource,
)
from optics.scene.system import System, solvable_system
from tests.optics.cases import SMALL, write_problem
from tests.optics.scene.problem.cases import MIRROR, load_text, load_values

SOURCES = {
    "collimated": CollimatedBeam,
    "lambertian": LambertianArea,
    "point": PointSource,
    "rays": RayFileSource,
    "luminaire": LuminaireSource,
}
POINT = {"source.kind": "point"}
RAYS = {"source.kind": "rays", "source.file": "lamp.ray"}
TOPHAT = {"target.kind": "tophat"}
FORMULA = {"target.kind": "function", "target.formula": "1 + x"}
ZONE = {"points": [[0.0, 0.0]], "least": 1.0}
ZONES = {"target.kind": "zones", "target.zone": [ZONE], "source.unit": "lm"}
STOP = {"shape": "rectangle", "half_width": [9.0, 9.0], "position": [0.0, 0.0, -1.0]}
# by key that acts in some problems only: its value, what gives it an effect, and what takes that away
SWITCHED = {
    "source.half_width": ([5.0, 5.0], {}, POINT),
    "source.distance": (3.0, {}, {"source.position": [0.0, 0.0, -3.0]}),
    "source.sigma": ([0.3, 0.3], {"source.profile": "gaussian"}, {}),
    "source.image": ("glow.png", {"source.profile": "image"}, {}),
    "source.file": ("lamp.ray", {"source.kind": "rays"}, {}),
    "source.shift": ([1.0, 2.0], RAYS, {}),
    "source.turn": ([1.0, 2.0, 3.0], RAYS, {}),
    "source.half_angle": (30.0, POINT, {}),
    "source.exponent": (2.0, POINT, {"source.kind": "lambertian"}),
    "source.divergence": (0.2, {}, POINT),
    "source.divergence_profile": ("sun", {}, POINT),
    "lens.corner_radius": (1.0, {"lens.outline": "rounded"}, {}),
    "target.image": ("other.png", {}, TOPHAT),
    "target.formula": ("1 + x", {"target.kind": "function"}, TOPHAT),
    "target.shape": ("ellipse", TOPHAT, {}),
    "target.lit": ([0.5, 0.5], TOPHAT, FORMULA),
    "target.radius": (-90.0, {"target.surface": "sphere"}, {}),
    "target.encoding": ("linear", {}, TOPHAT),
    "target.fit": ("pad", {}, FORMULA),
    "target.seen_from": ("lens", ZONES, TOPHAT),
    "optimizer.step": (0.1, {"optimizer.method": "adam"}, {}),
    "optimizer.memory": (5, {}, {"optimizer.method": "adam"}),
    "optimizer.blur": (0.2, {}, {"optimizer.window": "gaussian"}),
    "optimizer.window_degree": (3, {}, {"optimizer.window": "gaussian"}),
    "optimizer.sigma": (1.5, {"optimizer.window": "gaussian"}, {}),
    "verify.grid": (15, TOPHAT, {}),
    "verify.min_over_mean": (0.9, TOPHAT, {}),
    "verify.min_over_max": (0.9, FORMULA, ZONES),
    "verify.rsd": (0.1, TOPHAT, {}),
    "verify.contrast_error": (0.1, {}, TOPHAT),
}
# the same of tables in lists, and of tables that are left out elsewhere: two problems with the key each
LISTED = {
    "lens.body.land": (
        {"lens.body": {"annulus": True, "land": 5.0}, "lens.front.half_width": [9.0, 9.0]},
        {"lens.body": {"draft": 1.0, "land": 5.0}},
    ),
    "stop.inner": (
        {"stop": [STOP | {"shape": "ring", "inner": [3.0, 3.0]}]},
        {"stop": [STOP | {"inner": [3.0, 3.0]}]},
    ),
}
ELSEWHERE = ("source.others.", "element.")  # with the same records


def text_of(folder, changes):
    return load_values(folder, SMALL | changes).to_toml()


def test_every_key_that_acts_in_some_problems_only_is_among_the_cases():
    switched = {key.name for key in keys_of(Problem) if key.limits.get("only")}
    assert {name for name in switched if not name.startswith(ELSEWHERE)} == {*SWITCHED, *LISTED}


@pytest.mark.parametrize("key", SWITCHED)
def test_a_key_is_taken_where_it_has_an_effect_and_refused_where_it_has_none(tmp_path, key):
    value, acting, idle = SWITCHED[key]
    missing = {"corner_radius": {"lens.corner_radius": 2.0}, "radius": {"target.radius": 90.0}}
    other = acting | missing.get(key.rpartition(".")[2], {})
    needed = ("source.image", "source.file", "target.formula")
    before = "" if key in needed else text_of(tmp_path, other)
    assert text_of(tmp_path, acting | {key: value}) != before
    with pytest.raises(UserError, match=rf"{key} has no effect with [\w.]+ = .*; leave it out, which is "):
        load_values(tmp_path, SMALL | idle | {key: value})


def test_zones_have_a_margin_whatever_the_kind_of_target(tmp_path):
    """The loss of a design has the zones of every target."""
    zones = {"source.unit": "lm", "target.zone": [ZONE | {"margin": 0.1}]}
    for kind in ({"target.kind": "zones"}, TOPHAT, {}):
        assert load_values(tmp_path, SMALL | zones | kind).target.zone[0].margin == 0.1


@pytest.mark.parametrize("key", LISTED)
def test_a_key_of_a_list_is_taken_and_refused_likewise(tmp_path, key):
    acting, idle = LISTED[key]
    assert load_values(tmp_path, SMALL | acting)
    table, _, name = key.rpartition(".")
    with pytest.raises(UserError, match=rf"{table}(\[0\])?\.{name} has no effect with "):
        load_values(tmp_path, SMALL | idle)


def test_a_key_of_an_element_or_of_a_further_source_is_refused_by_its_name(tmp_path):
    with pytest.raises(
        UserError, match=r"element\.M1\.corner_radius has no effect with element\.M1\.outline"
    ):
        load_text(tmp_path, MIRROR.replace('name = "M1"', 'name = "M1"\ncorner_radius = 2.0'))
    first = {"kind": "point", "position": [0.0, 0.0, -30.0]}
    second = first | {"name": "B", "sigma": [0.1, 0.1]}
    with pytest.raises(UserError, match=r"source\[1\]\.sigma has no effect with source\[1\]\.profile"):
        load_values(tmp_path, SMALL).with_(source=first | {"others": [second]})


@pytest.mark.parametrize(("kind", "offered"), [("rays", False), ("point", True)])
def test_another_key_is_offered_only_where_that_has_an_effect(tmp_path, kind, offered):
    lamp = {"source.kind": kind, "source.divergence": 0.2} | ({} if offered else {"source.file": "lamp.ray"})
    with pytest.raises(UserError, match=r"source\.divergence has no effect") as caught:
        load_values(tmp_path, SMALL | lamp)
    assert ("set source.half_angle, " in str(caught.value)) == offered


@pytest.mark.parametrize("kind", SOURCES)
def test_keys_of_a_source_act_where_its_class_takes_them(kind):
    """The schema agrees with the fields of the classes that make the light."""
    names = {"picture": "image"}
    taken = {names.get(field.name, field.name) for field in fields(SOURCES[kind])}
    if "divergence" in taken:
        taken.add("divergence_profile")
    by_kind = {
        key.name.removeprefix("source."): key.limits["only"]["kind"]
        for key in keys_of(Problem)
        if key.name.startswith("source.")
        and key.name.count(".") == 1
        and "kind" in key.limits.get("only", {})
    }
    assert {"half_width", "half_angle", "exponent", "file", "shift", "turn"} <= by_kind.keys()
    assert {key for key, kinds in by_kind.items() if kind in kinds} == taken & by_kind.keys()


def test_the_distance_of_a_source_with_a_position_changes_no_ray(tmp_path):
    """Which is why it is refused there."""
    problem = load_values(tmp_path, SMALL | POINT | {"source.position": [0.0, 0.0, -30.0]})
    moved = copy(problem)
    moved.__dict__["source"] = replace(problem.source, distance=99.0)
    for mine, other in zip(*(System(p).source.parts((9, 9)) for p in (problem, moved)), strict=True):
        np.testing.assert_allclose(mine.origin, other.origin, atol=1e-12)
        np.testing.assert_array_equal(mine.direction, other.direction)


def test_no_file_is_read_that_the_problem_has_no_use_for(tmp_path):
    """Such a file would be copied into the result, whatever it holds."""
    secret = tmp_path / "secret"
    secret.write_text("private")
    for key in ("target.image", "source.image", "source.file"):
        with pytest.raises(UserError, match="has no effect"):
            load_values(tmp_path, SMALL | TOPHAT | {key: str(secret)})


def test_limits_of_light_that_a_formula_does_not_ask_for_are_refused(tmp_path):
    varying, even = FORMULA, {"target.kind": "function", "target.formula": "r < 0.5"}
    assert solvable_system(
        load_values(tmp_path, SMALL | even | {"verify.rsd": 0.1, "verify.contrast_error": 0.25})
    )
    for light, limit, words in (
        (varying, {"verify.rsd": 0.1}, r"verify\.rsd has no effect .* varies over the target"),
        (even, {"verify.contrast_error": 0.1}, r"verify\.contrast_error has no effect .* uniform where"),
    ):
        with pytest.raises(UserError, match=words):
            solvable_system(load_values(tmp_path, SMALL | {"verify.contrast_error": 0.25} | light | limit))


def test_one_lens_has_one_index(tmp_path):
    table = {"lens.indices": [[500.0, 1.6], [600.0, 1.59]]}
    for changes, words in (
        (
            {"lens.material": "N-BK7", "lens.index": 1.9},
            r'lens\.index = 1\.9 contradicts lens\.material = "N-BK7"',
        ),
        (table | {"lens.index": 1.5}, r"lens\.index = 1\.5 contradicts lens\.indices, which have 1\.59432"),
        (
            table | {"lens.index": "auto", "lens.material": "N-BK7"},
            r"index = 1\.59432 contradicts lens\.material",
        ),
        (
            {"lens.absorption": 0.1, "lens.absorptions": [[500, 0.2], [600, 0.2]]},
            "contradicts lens.absorptions",
        ),
    ):
        with pytest.raises(UserError, match=words):
            solvable_system(load_values_of(tmp_path, changes))
    # N-BK7 has n = 1.51852 at 550 nm (Sellmeier's law of the data sheet): within 1e-3 is the same glass
    for index in (1.5177, 1.5194):
        assert solvable_system(load_values_of(tmp_path, {"lens.material": "N-BK7", "lens.index": index}))
    assert solvable_system(load_values_of(tmp_path, {"lens.material": "my blend", "lens.index": 1.9}))


@pytest.mark.parametrize(
    ("index", "same"), [(1.4923, True), (1.4962, True), (1.4922, False), (1.4964, False)]
)
def test_grades_of_one_material_may_differ_by_its_accuracy(tmp_path, index, same):
    """PMMA has n = 1.49428 at 550 nm, and its grades lie within 0.002."""
    problem = load_values_of(tmp_path, {"lens.material": "PMMA", "lens.index": index})
    if same:
        assert solvable_system(problem)
        return
    with pytest.raises(UserError, match=r'contradicts lens\.material = "PMMA"'):
        solvable_system(problem)


@pytest.mark.parametrize(("nm", "seen"), [(1000.0, False), (300.0, False), (380.0, True), (780.0, True)])
def test_lumens_are_those_of_visible_light(tmp_path, nm, seen):
    changes = {"source.unit": "lm", "source.wavelength": nm}
    if seen:
        assert load_values(tmp_path, SMALL | changes).source.unit == "lm"
        return
    with pytest.raises(
        UserError, match=r'source\.unit = "lm" counts visible light, 380 to 780 nm, and .* is \d+ nm'
    ):
        load_values(tmp_path, SMALL | changes)
    assert load_values(tmp_path, SMALL | changes | {"source.spectrum": "A"})


def load_values_of(folder, changes):
    """Return the small problem with its picture, and other values."""
    write_problem(folder)
    return load_values(folder, SMALL | TOPHAT | changes)


def test_infinity_is_a_default_that_may_stand(tmp_path):
    assert load_values(tmp_path, SMALL | {"target.radius": math.inf}).target.radius == math.inf
