"""What bands of period cost: the pixels' MTF, the formula in expectation against random probes, limits."""

import json
from functools import partial

import numpy as np
import pytest

from optics.base.runtime import UserError
from optics.light.analysis import measure, rel_l2
from optics.tolerancing.form_errors import (
    BandFormula,
    form_errors_of,
    form_rows,
    form_sentences,
    local_formula_of,
    pixel_mtf,
)
from optics.tolerancing.form_errors.allowed_errors import _Probed
from optics.tolerancing.form_errors.period_bands import on_target, period_bands_of
from optics.tolerancing.perturbations import Sine, random_field, shortest_period
from tests.optics.cases import WIDE
from tests.optics.tolerancing.form_errors.cases import PLATE, system_and_lens

RISE = 0.02


@pytest.mark.parametrize("frequency", [(0.1, 0.0), (0.3, 0.8), (1.1, -0.4)])
def test_the_mtf_is_the_mean_of_a_wave_over_a_pixel(frequency):
    pitch, fine = (0.8, 0.5), 400
    x, y = (p * ((np.arange(fine) + 0.5) / fine - 0.5) for p in pitch)
    wave = np.cos(2 * np.pi * (frequency[0] * x[:, None] + frequency[1] * y))
    assert pixel_mtf(frequency, pitch) == pytest.approx(wave.mean(), abs=1e-5)


def test_a_wave_keeps_its_phase_from_the_surface_to_the_target():
    generator = np.random.default_rng(1)
    landing, surface = generator.normal(size=(2, 2, 2, 5)) + 3 * np.eye(2)[:, :, None]
    step, waves = generator.normal(size=2), (0.3, -0.7)
    on_surface = np.einsum("i,ijk,j->k", waves, surface, step)
    there = np.einsum("ik,ijk,j->k", on_target(waves, landing, surface), landing, step)
    np.testing.assert_allclose(there, on_surface, rtol=1e-12)


def test_bands_reach_from_half_a_millimetre_to_the_width_of_the_lens():
    assert period_bands_of((50.0, 40.0))[0] == (0.5, 1.0)
    assert period_bands_of((50.0, 40.0))[-1] == (25.0, 100.0)
    assert period_bands_of((10.0, 10.0))[-1] == (10.0, 20.0)
    assert period_bands_of((0.2, 0.2)) == [(0.2, 0.4)]


@pytest.mark.parametrize("half_width", [(250.0, 40.0), (2e3, 2e3), (1e6, 1.0)])
def test_wide_lenses_have_bands_that_random_fields_can_hold(half_width):
    bands = period_bands_of(half_width)
    assert bands[0][0] >= shortest_period(half_width)
    assert bands[-1][1] == 2 * half_width[0]
    assert bands == [band for band in bands if band[0] < band[1]]


SLOW = pytest.mark.slow


@pytest.mark.parametrize(
    "band", [pytest.param((1.0, 2.0), marks=SLOW), (2.0, 5.0), pytest.param((5.0, 10.0), marks=SLOW)]
)
def test_random_probes_cost_what_the_formula_expects(tmp_path, backend, band):
    system, lens = system_and_lens(tmp_path, PLATE, bumps=0.003)
    formula = local_formula_of(system.with_lens(lens), "rear", backend, (256, 256))
    probes = [random_field(band, 1e-6, lens.rear.half_width, seed) for seed in range(4)]
    squares = [np.square(formula.linear_change(p)).sum() for p in probes]
    norm = np.sqrt(np.mean(squares)) / np.linalg.norm(formula.irradiance) / 1e-6
    assert BandFormula(formula).change(band).norm == pytest.approx(norm, rel=0.15)


@pytest.mark.slow
def test_the_allowed_rms_brings_the_stated_rise(tmp_path, backend):
    system, lens = system_and_lens(tmp_path)
    steps = []
    found = form_errors_of(system.with_lens(lens), backend, RISE, lambda *step: steps.append(step))
    assert json.loads(json.dumps(found.data())) == found.data()
    assert [number for _, number, _ in steps] == [*range(10)]
    assert len(form_rows(found)) == len(steps) == steps[0][2]
    for cost in found.sides:
        for band in cost.bands[:3]:
            assert band.traced_rel_l2 - found.rel_l2 == pytest.approx(RISE, rel=0.35)
        assert cost.danger.slope_cost == max(band.slope_cost for band in cost.bands)
        assert cost.bands[0].allowed_rms < cost.bands[-1].allowed_rms
    assert "Peak to valley alone misleads on the rear" in " ".join(form_sentences(found))


@pytest.mark.slow
@pytest.mark.parametrize(
    "spectrum", [pytest.param({}, marks=SLOW), {"lens.material": "PC", "source.spectrum": "LED-B3"}]
)
def test_rel_l2_is_that_of_the_far_field_at_the_design_wavelength(tmp_path, backend, spectrum):
    system, lens = system_and_lens(tmp_path, WIDE | spectrum)
    found = form_errors_of(system.with_lens(lens), backend, RISE)
    metrics = measure(system.with_lens(lens), backend).metrics
    measured = metrics["rel_l2_design_wavelength"] if spectrum else metrics["rel_l2_sequential"]
    # both count cells, though not as many; irradiances would be 0.03 off
    assert found.rel_l2 == pytest.approx(measured, rel=1e-3)
    for band in found.sides[1].bands[1:4]:
        assert band.by_formula == pytest.approx(band.change_per_mm, rel=0.15)
    said = [
        sentence for sentence in form_sentences(found) if "at the design wavelength alone, 550 nm" in sentence
    ]
    assert len(said) == bool(spectrum)


@pytest.mark.parametrize("rise", [0.0, -1.0, np.nan, np.inf])
def test_a_rise_that_is_not_positive_is_refused(tmp_path, backend, rise):
    system, lens = system_and_lens(tmp_path)
    with pytest.raises(UserError, match="must be positive, got"):
        form_errors_of(system.with_lens(lens), backend, rise)


def probed_plate(folder, backend, cells):
    """Return the rear of a bumpy plate, to be probed by so many cells each way."""
    system, lens = system_and_lens(folder, PLATE, bumps=0.003)
    target = system.target.irradiance(system.target.screen(), 1.0)
    formula_of = partial(local_formula_of, system.with_lens(lens), "rear", backend)
    return _Probed(formula_of((cells, cells)), target, lens.rear.outline, formula_of)


@pytest.mark.slow
@pytest.mark.parametrize("band", [(1.0, 2.0), pytest.param((2.0, 5.0), marks=SLOW)])
def test_the_cost_of_short_ripples_is_that_of_many_more_cells(tmp_path, backend, band):
    """As many cells as a band asks for, and what they leave of it, against four times as many."""
    usual, fine, again = (probed_plate(tmp_path, backend, n).cost(band, RISE)[0] for n in (48, 640, 48))
    assert usual.change_per_mm == pytest.approx(fine.change_per_mm, rel=0.03)
    assert usual.traced_rel_l2 == again.traced_rel_l2


@pytest.mark.slow
def test_light_that_ends_before_the_rim_starts_from_the_same_rel_l2_as_the_report(tmp_path, backend):
    """A top hat's edge shows cells that end a ten-thousandth too early."""
    beam = {"target.kind": "tophat", "target.lit": [0.75, 0.75], "target.pixels": [160, 160]}
    system, lens = system_and_lens(tmp_path, PLATE | beam | {"target.half_width": [12.6, 12.6]})
    own = local_formula_of(system.with_lens(lens), "rear", backend, (640, 640))
    target = system.target.irradiance(system.target.screen(), 1.0)
    report = measure(system.with_lens(lens), backend).metrics["rel_l2_sequential"]
    assert rel_l2(own.irradiance / own.shown, target) == pytest.approx(report, rel=1e-3)


@pytest.mark.every(3)
@pytest.mark.parametrize("period", [1.05, 1.4, 1.9])
def test_no_regular_ripple_of_the_allowed_height_brings_more_than_the_rise(tmp_path, backend, period):
    """Of any period and direction of the band, each with 25 cells on it."""
    probed = probed_plate(tmp_path, backend, 160)
    cost, _ = probed.cost((1.0, 2.0), RISE)
    fine = probed.finer((480, 480))
    for direction in (11.0, 34.0, 80.0):
        ripple = Sine(cost.allowed_pv_sine / 2, period, direction)
        rise = rel_l2(fine.traced_irradiance(ripple) / fine.shown, probed.target) - probed.rel_l2
        assert rise < 1.05 * RISE
