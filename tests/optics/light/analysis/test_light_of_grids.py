"""The light of a lens from three grids of cells: extrapolated, with an error that is the error."""

from dataclasses import replace
from itertools import pairwise
from math import prod

import numpy as np
import pytest
from scipy.fft import dctn

from optics.light.analysis import light_of_cells, measure
from optics.light.analysis.light_of_cells import extrapolated
from optics.light.analysis.metrics import rel_l2
from tests.optics.light.analysis.cases import WHOLE, Made

WAVES = 6  # in each direction, the longest on the target


@pytest.fixture
def beam(tmp_path, backend):
    return Made(tmp_path, WHOLE["beam"], backend)


def long_waves(image):
    return dctn(image)[:WAVES, :WAVES]


@pytest.mark.every(3)
@pytest.mark.parametrize("name", [name for name in WHOLE if name != "round beam"])
def test_extrapolation_takes_off_what_is_smooth(tmp_path, backend, name):
    """At least half of the finer grid's error in long waves; how the edge of a round beam cuts cells is not.

    The error of the reference is 1 / 84 of it, by the square of the cells' size.
    """
    case = Made(tmp_path, WHOLE[name], backend)
    fine, coarse = (case.light(n, n)[0] for n in (131, 67))
    found, exact = extrapolated(fine, coarse, (131 / 67) ** 2), case.light(1201, 1203)[0]
    errors = [np.linalg.norm(long_waves(image - exact)) for image in (found, fine)]
    assert errors[0] < errors[1] / 2


def test_extrapolated_light_is_nowhere_negative_and_has_the_flux_of_the_finer_grid():
    fine, coarse = np.array([[0.0, 1.0], [4.0, 0.0]]), np.array([[3.0, 1.0], [1.0, 0.0]])
    found = extrapolated(fine, coarse, 4.0)
    np.testing.assert_allclose(found, np.array([[0, 1], [5, 0]]) * 5 / 6, rtol=1e-15)
    assert not extrapolated(0 * fine, 0 * fine, 4.0).any()


def test_three_grids_of_cells_give_the_image_and_its_error(beam, monkeypatch):
    """The image is that of the finer two.  No grid has lines in common with another."""
    given = [*np.random.default_rng(3).uniform(1, 1.2, (3, 48, 48))]
    images, real, grids, borders = iter(given), light_of_cells.images_of_cells, [], []

    def watched(path, screens, cells, backend, found):
        grids.append(cells.emitted.shape)
        borders.append((found.cells, found.bisections))
        return [next(images)], real(path, screens, cells, backend)[1]

    monkeypatch.setattr(light_of_cells, "images_of_cells", watched)
    result = measure(beam.system, beam.backend)
    numbers = [n for grid in grids for n in grid]
    assert all(n % k for n in numbers for k in range(2, n))
    assert borders == [(2000, 20), (1000, 20), (500, 20)]
    ratios = [prod(fine) / prod(coarse) for fine, coarse in pairwise(grids)]
    assert ratios == pytest.approx([4, 4], rel=0.12)
    light, coarser = (extrapolated(*pair, ratio) for pair, ratio in zip(pairwise(given), ratios))
    np.testing.assert_array_equal(result.irradiance, light)
    target = np.linalg.norm(result.target / result.target.mean())
    difference = np.linalg.norm(light - coarser) / light.mean() / target
    between, ratio = difference / result.metrics["rel_l2_floor"], ratios[0] ** light_of_cells.ORDER
    assert ratio - 1 < between < np.sqrt(ratio**2 + 1)
    assert between == pytest.approx(ratio, rel=0.15)
    assert result.metrics["estimator"] == "cells"


def test_the_finest_grid_has_cells_for_every_pixel_and_span(beam, monkeypatch):
    """Ten for a pixel up to 1024 in all, then four, on large screens three; no fewer than 256."""
    grids = []

    def watched(path, screens, cells, backend, borders):
        grids.append(cells.emitted.shape)
        return [np.ones(screen.shape) for screen in screens], fates

    _, fates = beam.light(11, 11)
    monkeypatch.setattr(light_of_cells, "images_of_cells", watched)
    path = beam.system.path
    for pixels in ((4, 48), (200, 400), (600, 900)):
        light_of_cells.grid_irradiance(beam.system, path, replace(beam.screen, pixels=pixels), beam.backend)
    assert grids[::3] == [
        (257, 487),
        (1031, 1601),
        (2053, 2707),
    ]  # primes from 256, 480, 1024, 1600, 2048, 2700


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "within", "most"),
    [("beam", 0.2, 2), ("curved front", 0.2, 2), ("point", 0.3, 2.1), ("far field", 0.3, 2)],
)
def test_the_error_that_is_told_is_the_error(tmp_path, backend, monkeypatch, name, within, most):
    """In the mean over three sizes, each within twice: how cells lie to the pixels moves either error.  The
    middle lines of a cone's cells lie on lines of pixels, which takes more off some sizes than off others.
    rel_l2 is off by no more than it says, twice.
    """
    case, ratios = Made(tmp_path, WHOLE[name], backend), []
    counts = (2412, 1202) if case.system.source.kinked else (2411, 1201)  # cells of a cone are an even number
    fine, coarse = (case.light(n, n)[0] for n in counts)
    exact = extrapolated(fine, coarse, (counts[0] / counts[1]) ** 2) / case.screen.projection()
    for cells in (256, 512, 1024):
        monkeypatch.setattr(light_of_cells, "_cells", lambda *_, cells=cells: cells)
        result = measure(case.system.with_lens(case.lens), case.backend)
        error = np.linalg.norm(result.irradiance - exact) / np.linalg.norm(result.target)
        ratios.append(result.metrics["rel_l2_floor"] / error)
        away = rel_l2(exact, result.target) - result.metrics["rel_l2_debiased"]
        assert abs(away) < 2 * result.metrics["rel_l2_error"]
    assert np.exp(np.mean(np.log(ratios))) == pytest.approx(1, rel=within)
    assert min(ratios) > 1 / 2
    assert max(ratios) < most


def test_the_floor_is_the_size_of_the_error_of_an_almost_linear_map(tmp_path, backend, monkeypatch):
    """Against 4 times as many cells in each direction, within a small factor: next to nothing is left, and
    that of higher order."""
    case = Made(tmp_path, WHOLE["beam"], backend, height=0.0)
    usual = measure(case.system.with_lens(case.lens), backend)
    for name in ("LEAST_CELLS", "MORE_PER_PIXEL", "CHEAP"):
        monkeypatch.setattr(light_of_cells, name, 4 * getattr(light_of_cells, name))
    exact = measure(case.system.with_lens(case.lens), backend)
    error = np.linalg.norm(usual.irradiance - exact.irradiance) / np.linalg.norm(usual.target)
    assert 0.3 < usual.metrics["rel_l2_floor"] / error < 3
    assert exact.metrics["rel_l2_floor"] < usual.metrics["rel_l2_floor"] / 4


def test_light_beside_the_target_has_the_error_of_its_cells(tmp_path, backend):
    """Rim cells of a round beam lie across its rim: the finest grid is off by what it tells."""
    changes = {"source.profile": "round", "target.half_width": [9.0, 7.0]}
    made = Made(tmp_path, changes, backend, height=0.02)
    found = measure(made.system, backend).metrics
    _, fine = made.light(1021, 1021)
    off = abs(found["stray"] - fine.off_target / made.system.problem.flux)
    assert found["stray_error"] > 0
    assert off < 3 * found["stray_error"]
    assert found["lit_efficiency_error"] >= found["stray_error"]
