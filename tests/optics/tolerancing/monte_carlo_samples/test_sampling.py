"""Made lenses: each is the perturbed lens of its errors; failures are counted; workers change nothing."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from optics.base.runtime import UserError
from optics.base.workers import Worker, worker_pool
from optics.light.analysis import rel_l2
from optics.scene.problem import load_problem
from optics.scene.system import OpticalSystem
from optics.tolerancing.monte_carlo_samples import Draw, ErrorModel, FormTolerance, sample_lenses
from optics.tolerancing.monte_carlo_samples.sampling import FIELDS
from optics.tolerancing.perturbations import PerturbedLight, tolerances_of
from tests.optics.cases import rough, write_problem
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
    system = OpticalSystem(load_problem(write_problem(folder, {"target.pixels": [24, 24]})))
    (sag,) = system.lens.sags
    lens = system.lens.with_sags([THBSurface(sag.space, rough(sag.space, 0.02))])
    target = system.target.irradiance(system.target.screen(), 1.0)
    named = {"lens.decentre_x", "lens.decentre_y", "index"}
    tolerances = tuple(t for t in tolerances_of(system, AMOUNTS) if t.name in named)
    return ErrorModel(system, lens, target, tolerances, forms)


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
    image, fates = PerturbedLight(model.system, model.lens, backend)(errors)
    assert made.rel_l2[3, 1] == pytest.approx(rel_l2(image, model.target), rel=1e-9)
    assert made.efficiency[3, 1] == pytest.approx(fates.on_target, rel=1e-9)
    assert seen[-1] == (16 + 2 * FIELDS, 16 + 2 * FIELDS)
    assert made.failures == ()


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
    made, sets, _ = sample_lenses(ErrorModel(model.system, model.lens, model.target, bad), 16, Here())
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
