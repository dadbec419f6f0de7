"""Monte Carlo of a design: records, sentences, figures, and what is refused."""

from contextlib import nullcontext
from dataclasses import replace
from io import BytesIO
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest
from PIL import Image

import optics
from optics.interface.api import design_errors
from optics.interface.api.design_errors import FORM_NM, _forms
from optics.reporting.figures import monte_carlo_figures_of
from optics.scene.problem import load_problem
from optics.tolerancing.monte_carlo_samples import (
    Draw,
    ErrorModel,
    FormTolerance,
    MonteCarlo,
    SampleBatch,
    Sampled,
)
from optics.tolerancing.perturbations import tolerance_budget, tolerances_of
from tests.cases import EXAMPLES
from tests.optics.cases import rough, small_system, write_problem
from thbcad.surfaces import THBSurface

AMOUNTS = {"lens.decentre_x": 0.3, "index": 2e-3}


@pytest.fixture(scope="module")
def made(tmp_path_factory, backend):
    """A Monte Carlo whose numbers are made up, of a real lens."""
    folder = tmp_path_factory.mktemp("made")
    system = small_system(folder, {"target.pixels": [16, 16]})
    (sag,) = system.base.sags
    lens = system.base.with_sags([THBSurface(sag.space, rough(sag.space, 0.02))])
    target = system.target.irradiance(system.target.screen(), 1.0)
    zero = {t.name: 0.0 for t in tolerances_of(system)} | AMOUNTS
    budget = tolerance_budget(system.with_lens(lens), target, backend, zero)
    tolerances = tuple(effect.tolerance for effect in budget.effects)
    model = ErrorModel(
        system.with_lens(lens), target, tolerances, (FormTolerance("rear", 1e-4, (3.0, 10.0)),)
    )
    rng = np.random.default_rng(2)
    rel = budget.rel_l2 + 0.02 * rng.random((8, 16))
    sets = [[Draw((0.1, -0.2), int(n)) for n in rng.integers(1000, size=16)] for _ in range(8)]
    batch = SampleBatch(rel, np.full(rel.shape, 0.9), rel < 1)
    sampled = Sampled(batch, sets, budget.rel_l2**2 + 4e-4)
    return MonteCarlo(sampled, model, budget)


@pytest.mark.slow
def test_rises_of_single_errors_and_forms_add_up(made):
    shares = made.shares()
    assert sum(shares.values()) == pytest.approx(1.0)
    assert set(shares) == {*AMOUNTS, "rear.form"}
    alone = made.budget.expected**2 - made.budget.rel_l2**2
    assert shares["rear.form"] == pytest.approx(4e-4 / (4e-4 + alone), rel=1e-9)
    assert made.expected**2 == pytest.approx(made.budget.expected**2 + 4e-4, rel=1e-12)


@pytest.mark.slow
def test_the_sentences_tell_the_numbers_of_the_record(made):
    data, text = made.data(), " ".join(made.sentences())
    assert f"{data['yield']['value']:.1%} of the lenses" in text
    assert f"{data['rel_l2']['95%']['value']:.2%}" in text
    assert "100 nm rms with periods from 3 to 10 mm" in text
    assert data["forms"] == {"rear.form": {"rms_nm": pytest.approx(100), "periods_mm": [3.0, 10.0]}}


@pytest.mark.slow
def test_the_median_lens_is_one_of_the_lenses(made):
    row, column = made.batch.nearest(0.5)
    np.testing.assert_array_equal(made.irradiance(0.5), made.model.irradiance(made.sampled.sets[row][column]))
    assert (np.sort(made.batch.rel_l2.ravel()) <= made.batch.rel_l2[row, column]).sum() == 64


def test_the_figures_are_pictures(made):
    for caption, png in monte_carlo_figures_of(made):
        assert caption
        assert np.ptp(np.asarray(Image.open(BytesIO(png)).convert("L"))) > 100


def test_a_lens_that_cannot_be_traced_is_not_drawn(made):
    rel = made.batch.rel_l2.copy()
    rel[:, :4] = np.inf  # a quarter of all, so that the 95th percentile is one of them
    broken = replace(made, sampled=made.sampled._replace(batch=replace(made.batch, rel_l2=rel)))
    assert all(png.startswith(b"\x89PNG") for _, png in monte_carlo_figures_of(broken))


def test_the_form_of_a_surface_that_is_not_named_keeps_its_usual_amount():
    both = SimpleNamespace(problem=load_problem(EXAMPLES / "extended_two.toml"))
    forms = {form.name: form.rms for form in _forms(both, {"rear": 30.0}, (2.0, 8.0))}
    assert forms == pytest.approx({"front.form": 1e-6 * FORM_NM, "rear.form": 3e-5})
    assert _forms(both, {"front": 0, "rear": 0}, (2.0, 8.0)) == ()


def test_no_more_workers_start_than_there_are_lenses(made, monkeypatch):
    asked = []
    monkeypatch.setattr(design_errors, "worker_pool", lambda *found: asked.append(found) or nullcontext())
    monkeypatch.setattr(design_errors, "sample_lenses", lambda *found: made.sampled)
    system = made.model.system
    measurement = SimpleNamespace(target=made.model.target)
    parts = {"system": system, "measurement": measurement, "problem": system.problem}
    design = Mock(optics.Design, **parts)
    optics.monte_carlo(design, made.budget, 16, workers=40)
    with pytest.raises(optics.UserError, match="the number of samples"):
        optics.monte_carlo(design, made.budget, 0, workers=40)
    for bad in ((None, made.budget), (design, None), (made.budget, design)):
        with pytest.raises(optics.UserError, match="monte_carlo takes"):
            optics.monte_carlo(*bad)
    assert asked == [(40, None, 16)]


@pytest.mark.slow
def test_a_design_is_made_a_few_times(tmp_path):
    """More form error, worse lenses; the expected rise is that of the lenses but for what so few tell."""
    few = {"target.pixels": [24, 24], "lens.rear.freeform.max_level": 1}
    design = optics.design(load_problem(write_problem(tmp_path, few)))
    budget = optics.tolerances(design, {"target.tilt": 0.0, "source.tilt": 0.0}, limit=0.02)
    runs = [
        optics.monte_carlo(design, budget, 64, {"rear": nm}, (3.0, 10.0), workers=workers)
        for nm, workers in ((50, 2), (400, 1))
    ]
    squares = [run.batch.mean_square() for run in runs]
    assert squares[1].value > squares[0].value
    assert runs[0].batch.efficiency.min() > 0.8
    assert runs[0].expected ** 2 == pytest.approx(squares[0].value, rel=0.3)
    for bad in ({"rear": -1}, {"rear": "x"}, {"side": 3}):
        with pytest.raises(optics.UserError):
            optics.monte_carlo(design, budget, 64, bad)
    with pytest.raises(optics.UserError, match="number of samples"):
        optics.monte_carlo(design, budget, 100)
