"""Derivatives of the light by perturbations, and what single tolerances cost."""

import numpy as np
import pytest

from optics.base.runtime import UserError
from optics.light.analysis import rel_l2
from optics.scene.problem import load_problem
from optics.scene.system import System
from optics.tolerancing.perturbations import (
    LinearLight,
    Perturbation,
    PerturbedLight,
    shop_sentences,
    tolerance_budget,
    tolerances_of,
)
from optics.tolerancing.perturbations.light_limits import LightNumbers, missed, parts_taken
from tests.optics.cases import FREE_REAR, FRONT, write_problem
from tests.optics.tolerancing.perturbations.cases import few, rough_system, small_light

MOVING = [  # tolerances that move round light in proportion to their amount
    "lens.decentre_x",
    "lens.defocus",
    "lens.tilt_x",
    "front.tilt_x",
    "thickness",
    "index",
    "rear.power",
    "source.decentre_y",
    "source.tilt_y",
    "source.size",
    "target.decentre_x",
    "target.defocus",
]
WIDE = {"source.half_width": [14.0, 14.0]}
LAMP = {"source.kind": "lambertian", "source.half_width": [0.5, 0.5], "source.distance": 20.0}
TENTH = 0.1  # of a pixel


def of_a_tenth(light, tolerance):
    """Return the perturbation that moves the light by a tenth of a pixel."""
    p = tolerance.at(tolerance.amount)
    return p * (TENTH * light.screen.pitch[0] / light.moved_by(p))


def norm_error(a, b):
    return np.linalg.norm(a - b) / np.linalg.norm(b)


def named(system, names):
    """Return the tolerances of these names."""
    return [t for t in tolerances_of(system) if t.name in names]


@pytest.mark.slow
def test_moved_landing_points_predict_the_change_of_rough_light(tmp_path, backend):
    """Within 2 % of the change at a tenth of a pixel; most of the rest is where corners pass knots."""
    light = small_light(tmp_path, backend)
    linear = LinearLight(light)
    chosen = named(light.system, MOVING)
    assert len(chosen) == len(MOVING)
    for tolerance in chosen:
        p = of_a_tenth(light, tolerance)
        traced = light(p)[0] - linear.irradiance
        assert norm_error(linear.moved(p)[1] - linear.irradiance, traced) < 0.02, tolerance.name


def test_the_derivative_is_that_of_exact_traces(tmp_path, backend):
    light = small_light(tmp_path, backend)
    linear = LinearLight(light)
    for tolerance in named(light.system, ["lens.tilt_x", "index", "target.decentre_x"]):
        p = of_a_tenth(light, tolerance) * 1e-4  # no cell's edge passes many borders of pixels
        difference = (light(p)[0] - light(-p)[0]) / 2
        assert norm_error(linear.derivative(p), difference) < 1e-3, tolerance.name


@pytest.mark.slow
def test_light_that_a_rim_cuts_has_no_derivative(tmp_path, backend):
    linear = LinearLight(small_light(tmp_path, backend, WIDE, per_pixel=2))
    p = Perturbation(lens_shift=(0.2, 0.0, 0.0))
    assert linear.derivative(p) is None
    assert linear.moved(p) is None


@pytest.fixture(scope="module")
def budget(tmp_path_factory, backend):
    system = rough_system(tmp_path_factory.mktemp("budget"))
    target = system.target.irradiance(system.target.screen(), 1.0)
    amounts = few(system, index=0.003, **{"lens.decentre_x": 0.1})
    return (
        system,
        target,
        tolerance_budget(system, target, backend, amounts, limits=0.002),
    )


def test_a_budget_holds_what_exact_traces_say(budget, backend):
    system, target, found = budget
    assert [e.tolerance.name for e in found.effects] == ["lens.decentre_x", "index"]
    effect = found.effects[1]
    irradiance, fates = PerturbedLight(system, backend)(Perturbation(index=0.003))
    assert effect.ends[1].rel_l2 == pytest.approx(rel_l2(irradiance, target), rel=1e-12)
    assert effect.ends[1].efficiency == pytest.approx(fates.on_target, rel=1e-12)
    assert effect.moves[1] == pytest.approx(effect.moves[0] / (40 / 48))
    assert np.allclose(found.irradiance + effect.change, irradiance / irradiance.mean())
    assert sum(found.shares().values()) == pytest.approx(1.0)
    rises = [(e.ends[0].rel_l2 ** 2 + e.ends[1].rel_l2 ** 2) / 2 - found.rel_l2**2 for e in found.effects]
    assert found.expected**2 == pytest.approx(found.rel_l2**2 + sum(rises) / 3)


def test_at_the_amount_that_is_allowed_rel_l2_rises_by_the_limit(budget, backend):
    system, target, found = budget
    for effect in found.effects:
        amount, there = effect.allowed.amount, effect.allowed.light.rel_l2
        lights = [PerturbedLight(system, backend)(effect.tolerance.at(s * amount)) for s in (-1, 1)]
        assert there == pytest.approx(max(rel_l2(light, target) for light, _ in lights), rel=1e-12)
        assert there == pytest.approx(found.rel_l2 + 0.002, abs=2e-4)


def test_an_error_that_leaves_the_lit_region_dark_has_a_uniformity_of_0(tmp_path, backend):
    keys = {"target.kind": "tophat", "target.lit": [0.2, 0.2], "target.half_width": [40.0, 40.0]}
    system = rough_system(tmp_path, keys, 0.0)
    target = system.target.irradiance(system.target.screen(), 1.0)
    amounts = few(system, **{"target.decentre_x": 22.0})
    (effect,) = tolerance_budget(system, target, backend, amounts).effects
    assert [end.min_over_mean for end in effect.ends] == [0.0, 0.0]
    assert effect.ends[1].efficiency > 0.5
    assert effect.allowed.amount < 22.0


def test_a_limit_that_light_does_not_tell_is_missed():
    known, unknown = LightNumbers(0.1, 0.9, 0.9), LightNumbers(0.1, 0.9, None)
    assert parts_taken({"min_over_mean": 0.7}, known, unknown) == {"min_over_mean": np.inf}
    assert missed({"min_over_mean": 0.7}, unknown) == {"min_over_mean": 0.7}


@pytest.mark.slow
def test_an_amount_that_puts_out_the_light_is_no_free_one(budget, backend):
    """No ray then tells how far light moves."""
    system, target, found = budget
    (effect,) = tolerance_budget(
        system, target, backend, few(system, **{"lens.decentre_x": 500.0}), limits=0.002
    ).effects
    assert effect.ends[1].efficiency == 0
    assert 0.4 < effect.allowed.amount / found.effects[0].allowed.amount < 1.01  # both use 40 % at least


@pytest.mark.parametrize(
    ("name", "amount", "words"),
    [
        ("thickness", 100.0, "thickness = 100 mm: no lens has such an error: thickness must be a positive"),
        ("index", 2.0, "index = 2: no lens has such an error: index must be"),
        ("source.size", 100.0, "source.size = 100 %: a source whose size changes by -100% has none left"),
    ],
)
def test_what_no_lens_can_be_is_one_sentence(tmp_path, backend, name, amount, words):
    system = rough_system(tmp_path)
    with pytest.raises(UserError, match=words):
        tolerance_budget(system, np.ones((48, 48)), backend, few(system, **{name: amount}))


def test_the_shop_is_told_amounts_with_units(budget):
    *_, found = budget
    lines = shop_sentences(found)
    assert any("Hold lens.decentre_x within +- " in line and " mm (" in line for line in lines)
    assert f"{found.rel_l2:.2%}" in lines[0]
    assert f"{found.expected:.2%} (root" in lines[-1]


def test_an_extended_source_has_a_budget(tmp_path, backend):
    system = rough_system(tmp_path, LAMP)
    target = system.target.irradiance(system.target.screen(), 1.0)
    amounts = few(system, **{"source.decentre_x": 0.5, "source.size": 20.0})
    found = tolerance_budget(system, target, backend, amounts)
    assert [e.tolerance.name for e in found.effects] == ["source.decentre_x", "source.size"]
    assert found.effects[0].derivative_error is None
    assert found.effects[0].moves[0] > 0.1


def test_the_far_field_has_tolerances_without_places(tmp_path, backend):
    system = rough_system(tmp_path, {"target.distance": float("inf"), "target.half_width": [15.0, 15.0]})
    names = [t.name for t in tolerances_of(system)]
    assert "target.tilt_x" in names
    assert "target.decentre_x" not in names
    light = small_light(
        tmp_path, backend, {"target.distance": float("inf"), "target.half_width": [15.0, 15.0]}
    )
    # the target turns by a degree, and so do the angles near its middle
    assert light.moved_by(Perturbation(target_tilt=(np.radians(1.0), 0, 0))) == pytest.approx(1.0, rel=0.05)
    assert light.moved_by(Perturbation(lens_shift=(0.1, 0, 0))) > 0.01


def test_a_target_that_follows_the_light_goes_back_where_it_alone_was_moved(tmp_path, backend):
    """Along its own axes, which are those of a tilted target."""
    system = rough_system(tmp_path, {"target.tilt": [30.0, -20.0, 40.0]})
    light = PerturbedLight(system, backend, floats=True)
    moved = Perturbation(target_shift=(0.3, -0.2, 0.0))
    assert light.aimed(moved).target_shift == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)


@pytest.mark.parametrize(
    ("amounts", "words"),
    [
        ({"lens.decenter_x": 1.0}, "did you mean lens.decentre_x"),
        ({"ind": 0.1}, "did you mean index"),
        ({"thickne": 0.1}, "did you mean thickness"),
        ({"target.defoc": 0.1}, "did you mean target.defocus"),
        ({"lens.tilt": float("nan")}, "must be a number from 0"),
        ({"index": -1.0}, "must be a number from 0"),
        ({"lens.decentre": 1e300}, r"must be a number from 0 to 1e\+06"),
        ({"index": "much"}, "must be a number from 0"),
        ({"title": "small"}, "there is no tolerance 'title'"),
        ({"temperature": 20.0}, "names no material"),
        ({"front.power": 1.0}, "the front is plane"),
        ({"front.decentre": 1.0}, "the front is plane"),
    ],
)
def test_bad_amounts_are_one_sentence(tmp_path, amounts, words):
    system = rough_system(tmp_path)
    with pytest.raises(UserError, match=words) as error:
        tolerances_of(system, amounts)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("kind", [np.float32, np.int64, np.float64, int])
def test_amounts_are_numbers_of_any_kind(tmp_path, kind):
    system = rough_system(tmp_path)
    (row, *_) = tolerances_of(system, {"target.defocus": kind(2)})
    assert row == tolerances_of(system, {"target.defocus": 2.0})[0]


@pytest.mark.parametrize(
    ("changes", "names"),
    [
        ({}, ["tilt_x", "tilt_y"]),
        ({"lens.front.radius": 80.0}, ["decentre_x", "decentre_y", "tilt_x", "tilt_y", "power"]),
        (FRONT, ["decentre_x", "decentre_y", "tilt_x", "tilt_y", "tilt_z"]),
    ],
    ids=["plane", "conic", "free"],
)
def test_a_front_is_askew_in_the_ways_that_move_it(tmp_path, changes, names):
    problem = load_problem(write_problem(tmp_path, changes, drop=FREE_REAR if changes is FRONT else ()))
    found = [t.name for t in tolerances_of(System(problem)) if t.name.startswith("front.")]
    assert found == [f"front.{name}" for name in names]


def test_a_name_without_an_axis_stands_for_all_axes(tmp_path):
    system = rough_system(tmp_path)
    amounts = {t.name: t.amount for t in tolerances_of(system, {"lens.tilt": 0.7, "temperature": 0})}
    assert [amounts[f"lens.tilt_{axis}"] for axis in "xyz"] == [0.7] * 3
    assert "rear.power" in amounts
    assert "rear.power" not in {t.name for t in tolerances_of(system, {"rear.power": 0})}
