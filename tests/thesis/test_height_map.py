"""The height map by an optimiser: its least losses, its batches, and where it is refined."""

import numpy as np
import pytest

import optics
from examples.height_map import ALPHA, indicator, leaf_mean, mark
from examples.thesis.height_map_by_adam import SAMPLES, batches


@pytest.fixture(scope="module")
def done():
    """Two batches of Adam."""
    return batches([optics.Adam(0.05), optics.Adam(0.017)], 100)


@pytest.mark.slow
def test_adam_comes_close_to_the_least_squares_of_the_first_mesh(done):
    """The least loss is that of numpy's least squares with the full matrix."""
    matrix = done[0].surface.space.collocation(SAMPLES.u, SAMPLES.v).toarray()
    _, squares, *_ = np.linalg.lstsq(matrix, SAMPLES.values)
    assert done[0].least == pytest.approx(np.sqrt(squares[0]), rel=1e-9)
    assert done[0].least <= min(done[0].losses) < 1.001 * done[0].least


def test_a_batch_begins_with_the_surface_of_the_one_before(done):
    first, second = done
    assert second.surface.space.dim > first.surface.space.dim
    assert second.losses[0] == pytest.approx(min(first.losses), rel=1e-12)
    assert min(second.losses) < second.losses[0]


def test_the_loss_is_the_norm_of_the_residuals(done):
    surface = done[1].surface
    residual = surface(SAMPLES.u, SAMPLES.v) - SAMPLES.values
    assert min(done[1].losses) == pytest.approx(np.sqrt(np.sum(residual**2)), rel=1e-12)
    assert indicator(surface, SAMPLES).sum() == pytest.approx(np.abs(residual).sum(), rel=1e-12)


def test_cells_above_alpha_times_the_mean_are_marked(done):
    surface = done[1].surface
    sums, cells = indicator(surface, SAMPLES), surface.space.cells
    marked = {(level, *cell) for level, rows in mark(surface, SAMPLES).items() for cell in rows.tolist()}
    wanted = {tuple(cell) for cell, total in zip(cells.tolist(), sums) if total > ALPHA * sums.mean()}
    assert marked == wanted
    everything = mark(surface, SAMPLES, 0.5, lambda space, sums: 0 * leaf_mean(space, sums))
    assert sum(map(len, everything.values())) == np.count_nonzero(sums > 0)
