"""What a lens delivers, measured on fresh rays."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from optics.analysis import metrics
from optics.analysis.metrics import compare, measure
from optics.problem import load_problem
from optics.system import base_lens, target_light
from tests.optics.cases import picture, write_problem

PLATE = {"lens.rear.radius": np.inf, "target.half_width": [9.5, 9.5]}


def measured(folder, backend, changes=None, image=None):
    problem = load_problem(write_problem(folder, changes, image))
    return measure(backend, problem, base_lens(problem), target_light(problem))


def test_equal_pictures_have_no_error():
    light = picture().astype(float)
    figures = compare(3 * light, light)
    assert figures["rel_l2"] == pytest.approx(0, abs=1e-15)
    assert figures["psnr_db"] > 300
    assert figures["ssim"] == pytest.approx(1, abs=1e-12)


def test_figures_follow_their_formulas():
    rng = np.random.default_rng(1)
    e, t = rng.uniform(0.5, 1, (2, 20, 30))
    figures = compare(7 * e, 0.1 * t)
    e, t = e / e.mean(), t / t.mean()
    assert figures["rel_l2"] == pytest.approx(np.sqrt(((e - t) ** 2).sum() / (t**2).sum()), rel=1e-12)
    assert figures["psnr_db"] == pytest.approx(10 * np.log10(t.max() ** 2 / ((e - t) ** 2).mean()), rel=1e-12)
    assert -1 <= figures["ssim"] <= 1


def test_a_dark_screen_is_an_error_of_one():
    assert compare(np.zeros((8, 8)), np.ones((8, 8)))["rel_l2"] == 1.0


def test_a_plate_makes_a_uniform_square(tmp_path, backend):
    """A source as large as the target behind a plane plate: E = T everywhere but for the grid of rays against
    the pixels."""
    result = measured(tmp_path, backend, PLATE, np.full((48, 48), 255, dtype=np.uint8))
    figures = result.figures
    assert figures["efficiency"] == pytest.approx(0.96**2, rel=1e-12)
    assert figures["stray"] == pytest.approx(0, abs=1e-12)
    # a pixel holds 11 +- 1 rays in each direction
    assert figures["rel_l2"] < 1 / 11
    assert 0 < figures["rel_l2_floor"] < 1 / 11
    assert result.irradiance.sum() * (19 / 48) ** 2 == pytest.approx(
        0.96**2, rel=1e-3
    )  # light at the rim is shared with pixels beyond


def test_half_the_light_beside_the_target_is_stray(tmp_path, backend):
    """Target 4.75 mm high under a source of 9.5 mm: half of the light misses, to the half ray at the edge."""
    changes = PLATE | {"target.half_width": [9.5, 4.75]}
    figures = measured(tmp_path, backend, changes, np.full((24, 48), 255, dtype=np.uint8)).figures
    assert figures["efficiency"] == pytest.approx(0.96**2 / 2, abs=1 / 500)
    assert figures["efficiency"] + figures["stray"] == pytest.approx(0.96**2, rel=1e-12)


def test_fluxes_of_the_budget_sum_to_the_source(tmp_path, backend):
    figures = measured(tmp_path, backend, {"source.half_width": [14.0, 11.0], "source.flux": 3.0}).figures
    budget = figures["flux_budget_w"]
    assert sum(budget.values()) == pytest.approx(3.0, rel=1e-12)
    assert budget["on_target"] == pytest.approx(figures["efficiency"] * 3.0, rel=1e-15)
    assert budget["beside_lens"] == pytest.approx(3.0 * (1 - 100 / 154), rel=1e-12)


def test_two_ray_sets_give_the_mean_and_its_error(tmp_path, backend, monkeypatch):
    """E = (A + B) / 2, and half their difference is what the mean is known to."""
    first, second = np.random.default_rng(3).uniform(1, 2, (2, 48, 48))
    given = iter([first, second])
    trace, parts, grids = metrics._trace, metrics.ray_parts, []

    def watched(problem, counts, *arguments):
        made = list(parts(problem, counts, *arguments))
        steps = 2 * 9.5 / np.array(counts)
        shift = np.array([made[0].x[0], made[0].y[0]]) + 9.5 - steps / 2
        grids.append((tuple(counts), tuple(shift / steps)))
        return iter(made)

    monkeypatch.setattr(metrics, "_trace", lambda *arguments: (next(given), trace(*arguments)[1]))
    monkeypatch.setattr(metrics, "ray_parts", watched)
    result = measured(tmp_path, backend)
    np.testing.assert_allclose(result.irradiance, (first + second) / 2, rtol=1e-15)
    expected = np.linalg.norm(first - second) / 2 / np.linalg.norm(result.target)
    assert result.figures["rel_l2_floor"] == pytest.approx(expected, rel=1e-14)
    assert grids[0][0] != grids[1][0]
    assert grids[0][1] != grids[1][1]
    assert all(
        0.001 < abs(shift) <= 0.5 for _, shifts in grids for shift in shifts
    )  # nor is it the optimiser's set


def test_tracing_in_slices_changes_nothing(tmp_path, backend, monkeypatch):
    whole = measured(tmp_path, backend)
    monkeypatch.setattr(metrics, "RAYS_AT_ONCE", 50_000)
    sliced = measured(tmp_path, backend)
    np.testing.assert_allclose(
        sliced.irradiance, whole.irradiance, rtol=0, atol=1e-12 * whole.irradiance.max()
    )
    assert sliced.figures["flux_budget_w"] == pytest.approx(whole.figures["flux_budget_w"], abs=1e-12)


def test_the_seed_moves_the_rays_and_only_it(tmp_path, backend):
    problem = load_problem(write_problem(tmp_path))
    lens, light = base_lens(problem), target_light(problem)
    first, again = (measure(backend, problem, lens, light) for _ in range(2))
    other = measure(backend, replace(problem, run=replace(problem.run, seed=1)), lens, light)
    np.testing.assert_allclose(
        again.irradiance, first.irradiance, rtol=0, atol=1e-12 * first.irradiance.max()
    )
    assert not np.allclose(other.irradiance, first.irradiance, rtol=1e-6)


def test_the_floor_is_the_size_of_the_estimators_error(tmp_path, backend, monkeypatch):
    """Against 8 times as many rays per direction, the error lies within a small factor of the floor that was
    told."""
    small = {"target.pixels": [24, 24]}
    usual = measured(tmp_path, backend, small)
    monkeypatch.setattr(metrics, "RAYS_PER_PIXEL", 8 * metrics.RAYS_PER_PIXEL)
    exact = measured(tmp_path, backend, small)
    error = np.linalg.norm(usual.irradiance - exact.irradiance) / np.linalg.norm(usual.target)
    assert 0.3 < error / usual.figures["rel_l2_floor"] < 3
    assert exact.figures["rel_l2_floor"] < usual.figures["rel_l2_floor"] / 4


@pytest.mark.parametrize("pixels", [[2, 2], [3, 2], [3, 3], [5, 40]])
def test_figures_of_coarse_targets_are_numbers(tmp_path, backend, pixels):
    """metrics.json must be JSON: it knows no NaN and no Infinity."""
    figures = measured(tmp_path, backend, {"target.pixels": pixels}).figures
    assert json.loads(json.dumps(figures, allow_nan=False)) == figures
