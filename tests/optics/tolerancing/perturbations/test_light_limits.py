"""Limits of the light by choice, amounts that keep them, light that may shift as a whole, and the words."""

from dataclasses import replace
from itertools import takewhile

import numpy as np
import pytest
from hypothesis import example, given, strategies as st

from optics.base.runtime import UserError
from optics.light.analysis import measure, rel_l2, uniformity_metrics, unit_mean
from optics.scene.problem import load_problem
from optics.scene.system import System
from optics.tolerancing.monte_carlo_samples import ErrorModel
from optics.tolerancing.perturbations import (
    LightJudge,
    Perturbation,
    PerturbedLight,
    effect_rows,
    shop_sentences,
    tolerance_budget,
    tolerances_of,
)
from optics.tolerancing.perturbations.light_limits import LightNumbers, bounds_of, limits_of, parts_taken
from optics.tolerancing.perturbations.tolerance_effects import Allowed
from optics.tolerancing.perturbations.tolerance_trials import FREE, amount_of
from tests.cases import EXAMPLES, examples
from tests.optics.cases import small_system
from tests.optics.tolerancing.perturbations.cases import few, rough_system

TOPHAT = {"target.kind": "tophat", "target.shape": "rectangle", "target.lit": [0.5, 0.5]}
FAR = {"target.distance": float("inf"), "target.half_width": [30.0, 30.0]}


def even_system(folder, changes=None):
    """Return a lens whose light is even where it lies: a plane plate in a beam that fills the lit pixels."""
    plate = {"lens.rear.radius": float("inf"), "lens.rear.conic": 0.0, "target.half_width": [19.0, 19.0]}
    return small_system(folder, TOPHAT | plate | (changes or {}))


def budget_of(system, backend, limits=None, floats=False, **amounts):
    target = system.target.irradiance(system.target.screen(), 1.0)
    return tolerance_budget(system, target, backend, few(system, **amounts), limits, floats=floats)


DECENTRE = {"target.decentre_x": 0.2, "source.size": 1.0}


LAMP = {"source.kind": "lambertian", "source.half_width": [0.5, 0.5], "source.half_angle": 14.0}


@pytest.mark.slow
@pytest.mark.parametrize(
    "light",
    [LAMP | {"source.distance": 25.0}, {"source.divergence": 1.0}, {"lens.rear.slope_rms": 0.2}],
    ids=["lambertian", "cone", "rough"],
)
def test_the_noise_of_counted_rays_is_taken_off_rel_l2(tmp_path, backend, light):
    """It leaves what the report says, which counts other rays, or none."""
    system = rough_system(tmp_path, light)
    reported = measure(system, backend)
    perturbed = PerturbedLight(system, backend, per_pixel=16)
    light, _ = perturbed.estimate()
    image = light.irradiance
    off = LightJudge(unit_mean(reported.target), perturbed).numbers(light).rel_l2
    without = reported.metrics["rel_l2_sequential"]
    assert rel_l2(image, reported.target) > without + 0.018
    assert off == pytest.approx(without, abs=0.012)


@pytest.fixture(scope="module")
def even(tmp_path_factory):
    return even_system(tmp_path_factory.mktemp("even"))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("limits", "reached"),
    [
        ({"min_over_mean": 0.8}, "min_over_mean"),
        ({"rel_l2": 0.05}, "rel_l2"),
        ({"min_over_mean": 0.3, "rel_l2": 0.05}, "rel_l2"),
    ],
)
def test_at_the_allowed_amount_every_limit_is_kept_and_one_is_reached(even, backend, limits, reached) -> None:
    """By traces of their own, and the uniformity on boxes."""
    system = even
    found = budget_of(system, backend, limits, **DECENTRE)
    (effect,) = [e for e in found.effects if e.tolerance.name == "target.decentre_x"]
    assert effect.allowed is not None
    assert effect.allowed.limit == reached
    for factor, kept in ((1.0, True), (1.06, False)):
        ok = []
        for sign in (-1, 1):
            p = effect.tolerance.at(sign * factor * effect.allowed.amount)
            light, _ = PerturbedLight(system, backend).estimate(p)
            e = light.irradiance / light.irradiance.mean()
            rel = np.linalg.norm(e - found.target) / np.linalg.norm(found.target)
            u0 = uniformity_metrics(system, light, 0.0)["min_over_mean"]
            ok.append(rel <= limits.get("rel_l2", 9.0) and u0 >= limits.get("min_over_mean", 0.0))
        assert all(ok) is kept
    assert effect.cost == pytest.approx(0.2 / effect.allowed.amount)


def test_the_efficiency_may_be_the_limit(tmp_path, backend) -> None:
    """Light that fills the target leaves it as the target shifts: 2 % of its width lose 1 % of the light."""
    system = even_system(tmp_path, {"target.half_width": [10.0, 10.0], "target.lit": [0.9, 0.9]})
    found = budget_of(system, backend, {"efficiency": 0.9}, **{"target.decentre_x": 0.2})
    (effect,) = found.effects
    assert effect.allowed.limit == "efficiency"
    assert 0.9 <= effect.allowed.light.efficiency < 0.9 + 0.03 * (found.light.efficiency - 0.9)


def test_uniform_light_is_judged_by_uniformity_and_efficiency_unless_limits_are_given(even, backend) -> None:
    system = even
    usual = budget_of(system, backend, index=1e-3)
    wanted = {"min_over_mean": 0.7, "efficiency": pytest.approx(0.99 * usual.light.efficiency)}
    assert usual.bounds == wanted
    rise = budget_of(system, backend, 0.02, index=1e-3)
    assert rise.bounds == {"rel_l2": pytest.approx(rise.rel_l2 + 0.02)}


def test_a_picture_is_judged_by_rel_l2_and_has_no_uniformity(tmp_path, backend) -> None:
    system = rough_system(tmp_path)
    found = budget_of(system, backend, index=1e-3)
    assert [*found.bounds] == ["rel_l2", "efficiency"]
    with pytest.raises(UserError, match=r"min_over_mean is not known of this light: .* is not uniform"):
        budget_of(system, backend, {"min_over_mean": 0.7}, index=1e-3)


@pytest.mark.parametrize("changes", [{}, FAR], ids=["plane", "far field"])
def test_a_shift_of_the_whole_light_costs_nothing_where_it_floats(tmp_path, backend, changes) -> None:
    """The target follows the light: what only shifts leaves the picture as it is, and shapes are kept."""
    system = rough_system(tmp_path, TOPHAT | {"target.half_width": [40.0, 40.0]} | changes)
    stands, follows = (PerturbedLight(system, backend, floats=f) for f in (False, True))
    nominal = stands()[0]
    name = {"target_tilt": (0.0, 0.01, 0.0)} if changes else {"target_shift": (0.7, -0.3, 0.0)}
    shift = Perturbation(**name)
    moved = np.linalg.norm(stands(shift)[0] - nominal)
    assert np.linalg.norm(follows(shift)[0] - nominal) < 1e-3 * moved
    wider = Perturbation(rear_power=0.02)
    both = follows(wider + shift)[0]
    alone = follows(wider)[0]
    assert np.linalg.norm(both - alone) < 0.01 * np.linalg.norm(alone - nominal)


def test_made_lenses_float_as_their_budget_does(even) -> None:
    system = even
    target = system.target.irradiance(system.target.screen(), 1.0)
    shift = Perturbation(target_shift=(0.4, 0.0, 0.0))
    lights = [ErrorModel(system, target, (), (), floats).light for floats in (False, True)]
    moved = [np.linalg.norm(light(shift)[0] - light()[0]) for light in lights]
    assert moved[1] < 1e-3 * moved[0]


@pytest.mark.slow
def test_what_floats_is_not_what_is_held(even, backend) -> None:
    system = even
    stands = budget_of(system, backend, **DECENTRE)
    floats = budget_of(system, backend, floats=True, **DECENTRE)
    cost = [{e.tolerance.name: e.cost for e in found.effects} for found in (stands, floats)]
    assert cost[0]["target.decentre_x"] > 0
    assert cost[1]["target.decentre_x"] == 0
    assert cost[1]["source.size"] == pytest.approx(cost[0]["source.size"], rel=0.05)
    assert "No care needed: target.decentre_x" in " ".join(shop_sentences(floats))
    assert "may shift as a whole" in shop_sentences(floats)[0]


def limited(budget):
    return [e.tolerance.name for e in budget.effects if e.allowed is not None]


@pytest.mark.slow
def test_all_amounts_times_what_is_told_keep_rel_l2_together(even, backend) -> None:
    """By a budget of these amounts: its expected rel_l2 is the limit, to second order."""
    system = even
    found = budget_of(system, backend, {"rel_l2": 0.05}, **DECENTRE)
    less = {name: found.together * amount for name, amount in DECENTRE.items()}
    again = budget_of(system, backend, {"rel_l2": 0.05}, **less)
    assert again.expected == pytest.approx(0.05, rel=0.03)
    assert again.together == pytest.approx(1, rel=0.06)
    assert f"where every amount is multiplied by {found.together:.2g}" in " ".join(shop_sentences(found))
    uniform = budget_of(system, backend, {"min_over_mean": 0.7}, **DECENTRE)
    assert uniform.together is None
    assert "--samples" in shop_sentences(uniform)[-1]
    loose = replace(found, bounds={"rel_l2": 50.0})
    free, dear = (
        replace(loose, effects=tuple(replace(e, allowed=allowed(e)) for e in found.effects))
        for allowed in (lambda e: None, lambda e: Allowed(0.5 * e.tolerance.amount, found.light, "rel_l2"))
    )
    assert "multiplied by 100 or more: these amounts together keep it so." in " ".join(shop_sentences(free))
    assert "multiplied by 100 or more: hold first what costs" in " ".join(shop_sentences(dear))
    tight = replace(found, bounds={"rel_l2": found.rel_l2 + 1e-6})
    assert "hold all amounts together closer." in " ".join(shop_sentences(tight))


def test_the_reason_why_no_uniformity_is_known_is_said(even, tmp_path, backend) -> None:
    unknown = "min_over_mean is not known of this light: the light asked for is not uniform;"
    with pytest.raises(UserError, match=unknown):
        budget_of(rough_system(tmp_path), backend, {"min_over_mean": 0.7}, index=1e-3)
    system = even_system(tmp_path, {"lens.rear.slope_rms": 0.15})
    with pytest.raises(UserError, match=r"leaves boxes on \d+% of the region; .*; limit rel_l2 or"):
        budget_of(system, backend, {"min_over_mean": 0.7}, index=1e-3)


@pytest.mark.slow
def test_five_errors_are_said_in_the_order_of_cost_and_all_are_in_the_table(even, backend) -> None:
    system = even
    chosen = {t.name: t.amount for t in tolerances_of(system) if t.name.startswith(("target.", "lens.tilt"))}
    made = {"front.tilt_x": 0.1, "index": 1e-3}
    amounts = chosen | DECENTRE | made
    found = budget_of(system, backend, 0.01, **amounts)
    lines = shop_sentences(found)
    ranked = [e.tolerance.name for e in found.by_cost()]
    for holder, chosen in (
        ("The shop", [name for name in ranked if name in made]),
        ("Who mounts part, source and target", [name for name in ranked if name not in made]),
    ):
        k = lines.index(f"{holder} must hold, the costliest first:") + 1
        said = [line.split()[2] for line in takewhile(lambda line: line[:1].isdigit(), lines[k:])]
        assert said == chosen[: len(said)]
        costly = [e.tolerance.name for e in found.effects if e.cost > 0.25]
        assert len(said) == min(5, len([n for n in chosen if n in costly]))
    easy = [e for e in found.by_cost() if 0 < e.cost <= 0.25 and e.tolerance.name not in made]
    (line,) = (line for line in lines if "usual amounts of the other" in line)
    assert f"of the other {len(easy)} will do" in line
    assert f"each alone is at most {easy[0].cost:.0%}" in line
    assert f"The nearest is {easy[0].tolerance.name}: " in line
    assert [row[0] for row in effect_rows(found)] == ranked
    assert {*ranked} == {*amounts}
    costs = [e.cost for e in found.by_cost()]
    assert costs == sorted(costs, reverse=True)
    assert [*found.data()["tolerances"]] == ranked


def test_where_every_usual_amount_will_do_nothing_must_be_held(even, backend) -> None:
    system = even
    found = budget_of(system, backend, {"min_over_mean": 0.1}, **{"front.tilt_x": 1e-3})
    lines = shop_sentences(found)
    assert not any("must hold" in line for line in lines)
    assert any(line.startswith(("The shop: the usual amounts will do", "No care needed")) for line in lines)


def test_light_that_a_shifted_lens_loses_is_limited_where_nothing_is_said(even, backend) -> None:
    """The beam is 9.5 mm wide to each side, the lens 10 mm: 0.5 mm cost nothing, each mm more 1/19 of it."""
    system = even
    found = budget_of(system, backend, **{"lens.decentre_x": 0.2})
    (effect,) = found.effects
    assert effect.allowed is not None
    assert effect.allowed.amount < 0.5 + 19 * 0.011


def test_a_limit_that_the_design_misses_is_said_and_allows_nothing(even, backend) -> None:
    system = even
    found = budget_of(system, backend, {"min_over_mean": 0.7, "efficiency": 0.95}, **DECENTRE)
    assert [e.allowed for e in found.effects] == [None, None]
    assert found.data()["missed_by_the_design"] == ["efficiency"]
    (line,) = (line for line in shop_sentences(found) if "misses" in line)
    assert "--limit" in line
    assert not any(line.startswith("No care needed") for line in shop_sentences(found))


def test_counted_rays_are_said_to_make_the_uniformity_uncertain(even, backend) -> None:
    system = even
    found = replace(budget_of(system, backend, index=1e-3), noise=0.18)
    assert "the noise of a lit pixel is 18%" in shop_sentences(found)[-1]


@pytest.mark.parametrize(
    ("limits", "words"),
    [
        ({"u0": 0.7}, "there is no limit 'u0'; there are rise, rel_l2, min_over_mean, efficiency"),
        ({"min_over_mean": 70.0}, "the limit of min_over_mean must lie between 0 and 1"),
        ({"efficiency": float("nan")}, "the limit of efficiency must lie"),
        ({"rel_l2": True}, "the limit of rel_l2 must lie"),
        (20, "the limit of rise must lie between 0 and 1, such as 0.05 or 5%, got 20"),
        ({"rise": 0.0}, "limit must be a positive rise"),
        (-1.0, "limit must be a positive rise"),
        ({}, "give a limit at least"),
    ],
)
def test_bad_limits_are_one_sentence(limits, words) -> None:
    with pytest.raises(UserError, match=words) as error:
        limits_of(limits, {})
    assert "\n" not in str(error.value)


def test_of_a_rise_and_a_limit_the_lower_one_holds() -> None:
    design = LightNumbers(0.04, 0.9, 0.8)
    assert bounds_of({"rise": 0.02, "rel_l2": 0.05}, design, "") == {"rel_l2": 0.05}
    assert bounds_of({"rise": 0.02, "rel_l2": 0.5}, design, "") == {"rel_l2": pytest.approx(0.06)}


def test_the_design_takes_nothing_of_its_limits_and_the_limits_are_one() -> None:
    design, bounds = LightNumbers(0.04, 0.9, 0.8), {"rel_l2": 0.06, "min_over_mean": 0.7, "efficiency": 0.85}
    assert set(parts_taken(bounds, design, design).values()) == {0.0}
    at = parts_taken(bounds, design, LightNumbers(0.06, 0.85, 0.7))
    assert [*at.values()] == pytest.approx([1, 1, 1])


@examples(200)
@given(st.floats(0.5, 4.0), st.floats(-1.9, 1.9), st.floats(0.0, 0.9))
def test_the_allowed_amount_keeps_the_limits_and_uses_them(power: float, decade: float, still: float) -> None:
    """Whatever the power of the amount, and where nothing happens up to a part of it."""
    first, edge = 0.05, 0.05 * 10**decade

    def taken(amount: float) -> float:
        return max(0.0, (amount / edge - still) / (1 - still)) ** power

    found = amount_of(taken, (first, taken(first)))
    assert found is not None
    assert found[1] <= 1
    assert found[0] > (0.9 if still == 0 else 0.8) * edge


@examples(200)
@given(st.floats(0.3, 6.0), st.floats(0.3, 6.0), st.floats(0.2, 2.0), st.floats(-1.5, 1.5))
@example(0.6, 5.2, 0.9, -0.7)
def test_it_does_so_where_the_power_changes_on_the_way(
    low: float, high: float, bend: float, decade: float
) -> None:
    """Up to a part of the edge light suffers with one power of the amount, and with another beyond."""
    first, edge = 0.05, 0.05 * 10**decade

    def grown(part: float) -> float:
        return part**low if part < bend else bend**low * (part / bend) ** high

    def taken(amount: float) -> float:
        return grown(amount / edge) / grown(1.0)

    found = amount_of(taken, (first, taken(first)))
    assert found is not None
    assert found[1] <= 1
    assert found[0] > 0.9 * edge


def test_errors_that_reach_no_limit_are_free() -> None:
    tried = []

    def taken(amount: float) -> float:
        tried.append(amount)
        return -1e-9

    def ends(amount: float) -> float:
        if amount > 2:
            raise UserError("no lens")
        return 1e-3 * amount

    assert amount_of(taken, (0.05, -1e-9)) is None
    assert max(tried) == pytest.approx(FREE * 0.05)
    assert amount_of(ends, (0.5, 5e-4)) is None
    assert amount_of(lambda amount: 5.0, (0.5, 5.0)) == (0.0, 0.0)


def test_one_source_out_leaves_the_light_of_the_others(backend):
    """As `weight = 0` of that source does, but for its share of the flux, which is missing."""
    problem = load_problem(EXAMPLES / "two_sources.toml", {"target.pixels": [24, 24]})
    system = System(problem)
    budget = budget_of(system, backend, **{"target.decentre_x": 0.2})
    alone = System(problem.with_(**{"source.others.right.weight": 0.0}))
    lit = budget_of(alone, backend, **{"target.decentre_x": 0.2}).light
    without = budget.outages[1]
    assert without.rel_l2 == pytest.approx(lit.rel_l2, rel=0.02)  # other rays of the same source
    assert without.efficiency == pytest.approx(lit.efficiency / 2, rel=5e-3)
    assert sum(light.efficiency for light in budget.outages) == pytest.approx(
        budget.light.efficiency, rel=5e-3
    )
    assert "With one of 2 sources out" in " ".join(shop_sentences(budget))
    assert len(budget.data()["one_source_out"]) == 2
