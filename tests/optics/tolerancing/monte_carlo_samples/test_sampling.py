"""Made lenses: random errors, each lens that of its errors, quantiles and yields; workers change nothing."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.stats import norm

from optics.base.runtime import UserError
from optics.base.workers import Worker, worker_pool
from optics.light.analysis import rel_l2
from optics.scene.system import System
from optics.tolerancing.monte_carlo_samples import Draw, ErrorModel, FormTolerance, SampleBatch, sample_lenses
from optics.tolerancing.monte_carlo_samples.random_errors import REPLICATES, draws
from optics.tolerancing.monte_carlo_samples.sample_batch import Range
from optics.tolerancing.monte_carlo_samples.sampling import FIELDS, traced
from optics.tolerancing.perturbations import PerturbedLight, tolerances_of
from tests.optics.cases import flat_problem, rough, small_system
from thbcad.surfaces import THBSurface

AMOUNTS = {"lens.decentre": 0.2, "index": 1e-3}
RIPPLES = FormTolerance("rear", 2e-4, (3.0, 10.0))


class Here:
    """One worker in this process."""

    ended = ()

    def __init__(self):
        self._workers = {"here": Worker(ThreadPoolExecutor(1))}

    def present(self):
        return self._workers

    def lost(self, name):
        raise AssertionError(name)


def model_of(folder, forms=(RIPPLES,)):
    system = small_system(folder, {"target.pixels": [24, 24]})
    (sag,) = system.base.sags
    lens = system.base.with_sags([THBSurface(sag.space, rough(sag.space, 0.02))])
    target = system.target.irradiance(system.target.screen(), 1.0)
    named = {"lens.decentre_x", "lens.decentre_y", "index"}
    tolerances = tuple(t for t in tolerances_of(system, AMOUNTS) if t.name in named)
    return ErrorModel(system.with_lens(lens), target, tolerances, forms)


def test_a_made_lens_is_the_lens_with_all_of_its_errors(tmp_path, backend):
    model = model_of(tmp_path)
    seen = []
    made, sets, _ = sample_lenses(model, 16, Here(), lambda done, of: seen.append((done, of)))
    draw = sets[3][1]
    errors = model.errors(draw)
    x, y, _ = errors.lens_shift
    by_name = dict(zip((t.name for t in model.tolerances), draw.amounts))
    assert (x, y) == pytest.approx((0.2 * by_name["lens.decentre_x"], 0.2 * by_name["lens.decentre_y"]))
    assert errors.index == pytest.approx(1e-3 * by_name["index"])
    image, fates = PerturbedLight(model.system, backend)(errors)
    assert made.rel_l2[3, 1] == pytest.approx(rel_l2(image, model.target), rel=1e-9)
    assert made.efficiency[3, 1] == pytest.approx(fates.on_target, rel=1e-9)
    assert seen[-1] == (16 + 2 * FIELDS, 16 + 2 * FIELDS)
    assert made.failures == ()


@pytest.mark.slow
def test_forms_alone_are_traced_with_both_signs(tmp_path):
    """Their mean rise of rel_l2^2 is quadratic in the rms: what changes sign has cancelled."""
    model = model_of(tmp_path)
    double = replace(model, forms=(replace(RIPPLES, rms=2 * RIPPLES.rms),))
    nominal = rel_l2(model.light()[0], model.target) ** 2
    rise, more = (sample_lenses(m, 16, Here()).by_form - nominal for m in (model, double))
    assert more == pytest.approx(4 * rise, rel=0.05)
    fields = [model.form(seed)[0] for seed in range(FIELDS)]
    squares = [rel_l2(model.light(s * field)[0], model.target) ** 2 for field in fields for s in (1, -1)]
    assert np.mean(squares) - nominal == pytest.approx(rise, rel=1e-9)
    assert sample_lenses(replace(model, forms=()), 16, Here()).by_form is None


def test_a_lens_that_cannot_be_traced_is_a_failed_lens(tmp_path):
    """An index error that leaves air fails in every lens where it is drawn so low."""
    model = model_of(tmp_path)
    bad = tuple(t for t in tolerances_of(model.system, {"index": 0.9}) if t.name == "index")
    made, sets, _ = sample_lenses(ErrorModel(model.system, model.target, bad), 16, Here())
    low = np.array([[draw.amounts[0] * 0.9 <= -0.5 for draw in lenses] for lenses in sets])
    np.testing.assert_array_equal(np.isinf(made.rel_l2), low)
    assert low.any()
    assert "index" in made.failures[0]


def test_bands_that_no_surface_has_are_refused_before_the_work(tmp_path):
    with pytest.raises(UserError, match="band"):
        sample_lenses(model_of(tmp_path, (FormTolerance("rear", 1e-5, (3.0, 500.0)),)), 16, Here())


def test_the_same_seed_draws_the_same_form(tmp_path):
    model = model_of(tmp_path)
    draw = Draw((0.0, 0.0, 0.0), 7)
    jets = [model.errors(draw).rear_error.jet(np.array([1.0]), np.array([2.0])) for _ in range(2)]
    np.testing.assert_array_equal(*jets)


@pytest.mark.slow
def test_processes_change_no_bit(tmp_path):
    model = model_of(tmp_path)
    here = sample_lenses(model, 16, Here())
    with worker_pool(2) as pool:
        there = sample_lenses(model, 16, pool)
    np.testing.assert_array_equal(here.batch.rel_l2, there.batch.rel_l2)


def batch(rel_l2, good=0.15):
    values = np.asarray(rel_l2, dtype=float)
    return SampleBatch(values, np.full(values.shape, 0.9), values <= good)


def test_the_interval_of_a_yield_holds_it_as_often_as_it_says():
    """400 batches of 8 x 64 independent lenses; 0.95 of them hold the truth, within three deviations."""
    rng = np.random.default_rng(4)
    held = 0
    for _ in range(400):
        found = batch(rng.normal(1.0, 0.3, (8, 64))).keeping({"rel_l2": 1.0})
        held += found.low <= 0.5 <= found.high
    assert held / 400 == pytest.approx(0.95, abs=3 * np.sqrt(0.95 * 0.05 / 400))


@pytest.mark.parametrize("part", [0.05, 0.5, 0.95])
def test_the_interval_of_a_quantile_holds_it_nearly_as_often_as_it_says(part):
    """400 batches of 128 independent lenses, 16 of which are few for a quantile: 0.9 and not 0.95."""
    rng, true = np.random.default_rng(5), norm.ppf(part, 1.0, 0.3)
    found = [batch(rng.normal(1.0, 0.3, (8, 16))).quantile(part) for _ in range(400)]
    assert np.mean([one.low <= true <= one.high for one in found]) > 0.9


def test_lenses_of_which_rays_do_not_tell_widen_the_interval_of_the_yield():
    kept = np.ones((8, 64))
    kept[:, :16], kept[:, 16:24] = np.nan, 0.0
    some = replace(batch(np.ones((8, 64))), made=kept)
    no, all_made = (replace(some, made=np.nan_to_num(kept, nan=n)).good for n in (0.0, 1.0))
    assert some.undecided == 0.25
    assert some.good == Range(no.value, no.low, all_made.high)
    assert (some.good.value, no.value, all_made.value) == (0.625, 0.625, 0.875)


def test_a_lens_whose_uniformity_is_not_known_is_undecided():
    """The blur of the wide source leaves too few boxes."""
    source = {"kind": "lambertian", "half_width": (4.0, 4.0), "distance": 10.0, "half_angle": 8.0}
    system = System(flat_problem(source))
    target = system.target.irradiance(system.target.screen(), 1.0)
    made = traced(ErrorModel(system, target, ()), Draw((), 0)).made
    assert np.isnan(made)


@pytest.mark.parametrize(("limit", "value"), [(0.5, 0.0), (2.0, 1.0)])
def test_sets_that_agree_leave_room_for_what_was_not_drawn(limit, value):
    found = batch(np.ones((8, 64))).keeping({"rel_l2": limit})
    assert found.value == value
    assert found.low <= value <= found.high
    # of 512 lenses without one: 3.84 / (512 + 3.84) by Wilson
    assert found.high - found.low == pytest.approx(0.00745, rel=0.01)


def test_quantiles_are_lenses():
    values = np.arange(512.0).reshape(8, 64)
    made = batch(values)
    assert made.quantile(0.5).value == 255
    assert values[made.nearest(0.95)] == made.quantile(0.95).value
    assert made.mean_square().value == pytest.approx(np.mean(np.arange(512.0) ** 2))


def test_the_yield_counts_the_lenses_that_keep_each_limit_that_is_given():
    """Light of 16 lenses; one whose uniformity rays do not tell keeps no limit of it."""
    even = np.tile([0.95, 0.85, 0.75, np.nan], (8, 2))
    light = replace(batch(np.tile([0.1, 0.1, 0.3, 0.1, 0.2, 0.1, 0.1, 0.1], (8, 1))), min_over_mean=even)
    limits = {"rel_l2": 0.15, "min_over_mean": 0.8, "efficiency": 0.85}
    data = light.data(limits)
    assert data["limits"] == limits
    assert {name: kept["value"] for name, kept in data["yield_by_limit"].items()} == {
        "rel_l2": 6 / 8,
        "min_over_mean": 4 / 8,
        "efficiency": 1.0,
    }
    assert data["yield_by_limits"]["value"] == 3 / 8
    assert light.keeping({"min_over_mean": 0.9}).value == 2 / 8


def test_lenses_that_cannot_be_traced_fail():
    values = np.full((8, 4), 0.1)
    values[2, 1] = np.inf
    data = batch(values).data({"rel_l2": 0.2})
    assert data["not_traced"] == 1
    assert data["yield_by_limits"]["value"] == pytest.approx(31 / 32)
    assert data["yield"]["value"] == pytest.approx(31 / 32)
    assert batch(values, good=0.05).data({"rel_l2": 0.2})["yield"]["value"] == 0
    assert data["rel_l2"]["95%"]["value"] == pytest.approx(0.1)


@given(st.integers(0, 40), st.integers(1, 6), st.integers(0, 2**32))
def test_every_set_fills_its_cube_evenly(tolerances, power, seed):
    """2^m Sobol points have one coordinate in each of 2^m equal parts of an axis."""
    each = 2**power
    sets = draws(tolerances, REPLICATES * each, seed)
    assert len(sets) == REPLICATES
    for lenses in sets:
        amounts = np.array([draw.amounts for draw in lenses]).reshape(each, tolerances)
        parts = np.floor((amounts + 1) / 2 * each)
        np.testing.assert_array_equal(np.sort(parts, axis=0), np.tile(np.arange(each)[:, None], tolerances))
    assert len({draw.seed for lenses in sets for draw in lenses}) == REPLICATES * each
    assert draws(tolerances, REPLICATES * each, seed) == sets


def test_sets_are_scrambled_apart():
    sets = draws(3, 16 * REPLICATES, 1)
    assert len({lenses[0].amounts for lenses in sets}) == REPLICATES


@pytest.mark.parametrize("samples", [0, 8, 100, 513, -16, 2.0, True, 1 << 40])
def test_other_numbers_of_samples_are_refused(samples):
    with pytest.raises(UserError, match="number of samples must be"):
        draws(2, samples, 0)


@pytest.mark.parametrize(
    ("surface", "rms", "words"),
    [("side", 1e-5, "front"), ("rear", -1.0, "rms"), ("rear", np.nan, "rms"), ("rear", "much", "rms")],
)
def test_bad_forms_are_refused(tmp_path, surface, rms, words):
    system = small_system(tmp_path)
    with pytest.raises(UserError, match=words):
        FormTolerance(surface, rms, (1.0, 5.0)).drawn(system, 0)


def test_a_form_lies_on_its_surface_alone(tmp_path):
    system = small_system(tmp_path, {"lens.front.half_width": [6.0, 4.0]})
    drawn = FormTolerance("front", 1e-5, (2.0, 8.0)).drawn(system, 3)
    assert drawn.rear_error is None
    x, y = np.meshgrid(np.linspace(-6, 6, 101), np.linspace(-4, 4, 101))
    assert drawn.front_error.jet(x.ravel(), y.ravel())[0].std() == pytest.approx(1e-5, rel=0.05)
