"""The density to ask for where light lands beside its place."""

import numpy as np
import pytest

from optics.designing.transport import prewarped
from oracles.error_measures import relative

GRID = (160, 128)


def centres(shape):
    x, y = ((2 * np.arange(n) + 1) / n - 1 for n in shape)
    return np.broadcast_arrays(x[:, None], y[None, :])


def wave(x, y):
    """Return a density with detail of a few cells, and none near the border."""
    return np.exp(-6 * (x**2 + y**2)) * (1.5 + np.sin(25 * x) * np.cos(18 * y))


def beside(x, y):
    """Return d of up to two cells, smooth, in units of half the target."""
    return 0.02 * np.cos(1.5 * x + 0.4), -0.015 * np.sin(2 * y + x)


@pytest.mark.parametrize("rows", [1, 7, 1000])
def test_it_does_not_depend_on_the_rows_that_are_made_at_a_time(rows, monkeypatch):
    x, y = centres(GRID)
    share = 0.5 + 0.4 * x * y
    asked = [prewarped(wave(x, y), (x, y), beside(x, y), np.ones(GRID), share=share)]
    monkeypatch.setattr("optics.designing.transport.prewarp.STRIP", rows)
    asked.append(prewarped(wave(x, y), (x, y), beside(x, y), np.ones(GRID), share=share))
    assert asked[0].tobytes() == asked[1].tobytes()


def test_the_density_is_that_beyond_the_offset():
    """g(y) = T(y + d) det(1 + Dd).

    What is known of T are means of cells: d, 1.3 cells long on average, is rounded to half cells, by 0.14
    cells in each direction.
    """
    x, y = centres(GRID)
    dx, dy = beside(x, y)
    asked = prewarped(wave(x, y), (x, y), (dx, dy), np.ones(GRID))
    stretch = (1 - 0.03 * np.sin(1.5 * x + 0.4)) * (1 - 0.03 * np.cos(2 * y + x))
    exact = wave(x + dx, y + dy) * stretch
    assert np.hypot(dx * GRID[0] / 2, dy * GRID[1] / 2).mean() == pytest.approx(1.3, abs=0.05)
    assert relative(asked, exact) < 0.2 / 1.3 * relative(wave(x, y), exact)


@pytest.mark.parametrize("light", ["everywhere", "in one quarter"])
def test_a_constant_offset_shifts_the_density(light):
    """Also where light is known in one quarter only: elsewhere the offset of the nearest counts."""
    x, y = centres(GRID)
    flux = np.ones(GRID) if light == "everywhere" else np.where((x > 0) & (y > 0), 1.0, 0.0)
    asked = prewarped(wave(x, y), (x, y), (x * 0 + 6 / GRID[0], x * 0 - 4 / GRID[1]), flux)
    np.testing.assert_allclose(asked[5:-5, 5:-5], wave(x, y)[8:-2, 3:-7], rtol=0, atol=1e-12)


def test_light_is_not_asked_for_where_it_would_land_beside_the_target():
    x, y = centres(GRID)
    asked = prewarped(np.ones(GRID), (x, y), (x * 0 + 20 / GRID[0], x * 0), np.ones(GRID))
    assert (asked[-10:] == 0).all()
    assert (asked[:-10] > 0).all()


def test_what_is_wanted_is_asked_for_where_all_of_it_would_land_beside_the_target():
    x, y = centres(GRID)
    asked = prewarped(wave(x, y), (x, y), (x * 0 + 3, x * 0), np.ones(GRID))
    np.testing.assert_array_equal(asked, wave(x, y))


def test_fine_bins_follow_an_offset_as_uneven_as_the_picture():
    """d of 1.5 cells, with a period of 16: bins are smoothed by one bin of s cells, which flattens it.

    exp(-(2 pi s / 16)^2 / 2) of it remains: 0.29 for s = 4, 0.73 for s = 2.  What lacks is as 0.71 to 0.27.
    """
    x, y = centres(GRID)
    k = np.pi * GRID[0] / 16
    d, slope = 3 / GRID[0] * np.sin(k * x), 3 / GRID[0] * k * np.cos(k * x)
    exact = wave(x + d, y) * (1 + slope)
    of_bins = [
        relative(prewarped(wave(x, y), (x, y), (d, y * 0), np.ones(GRID), f), exact) for f in (False, True)
    ]
    assert of_bins[1] < 0.6 * of_bins[0]


def test_light_that_is_lost_on_the_way_is_asked_for_once_more():
    """g(y) s(y) = T(y) where nothing lands beside; s is known by smoothed means of bins of four cells.

    That errs by s'' (4 / 160 * 2)^2 / 2 < 1e-3 for s'' below 0.6, and more in the bins at the border.
    """
    x, y = centres(GRID)
    share = 0.9 - 0.3 * x**2
    asked = prewarped(wave(x, y), (x, y), (x * 0, x * 0), np.ones(GRID), share=share)
    inner = np.s_[12:-12, 12:-12]
    np.testing.assert_allclose((asked * share)[inner], wave(x, y)[inner], rtol=0.01)
