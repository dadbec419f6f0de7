"""Uniformity on boxes, against closed forms, brute force and geometry."""

from math import hypot, inf

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.ndimage import gaussian_filter
from scipy.special import ndtri

from optics.scene.photometry import RASTER, BoxGrid, LitRegion, edge_width

HALF = (3.0, 2.0)
WHOLE = LitRegion((-3.0, 3.0), (-2.0, 2.0), np.ones((RASTER, RASTER), dtype=bool))
GRID = 21


def disk(radius):
    """A disk in a square screen of half-width 1."""
    t = (np.arange(RASTER) + 0.5) / RASTER * 2 - 1
    reach = 1 / RASTER  # half a cell: it lies in the disk where its farthest corner does
    far = np.hypot(*np.meshgrid(np.abs(t) + reach, np.abs(t) + reach))
    return LitRegion((-radius, radius), (-radius, radius), far <= 1)


def uniformity(light, region=WHOLE, blur=0.0, drift=0.0):
    """Uniformity of light on boxes, (grid, grid) or replicates of it."""
    draws = light if light.ndim == 3 else light[None]
    return BoxGrid(region, draws.shape[1], blur).uniformity(draws, drift)


def test_even_light_is_even_and_the_border_is_left_out():
    """A margin of 2.5 % of the shorter side reaches into the outermost of 21 boxes, and no further."""
    found = uniformity(np.full((GRID, GRID), 7.0))
    assert (found.mean, found.min_over_mean, found.min_over_max, found.rsd) == pytest.approx((7, 1, 1, 0))
    assert (found.grid, found.boxes) == (21, 19 * 19)
    assert found.box == pytest.approx((6 / 21, 4 / 21))
    assert found.margin == pytest.approx(0.1)


@given(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))
def test_a_plane_of_light_has_the_ratios_of_its_outermost_boxes(a, b):
    """E = 2 + a x + b y: a box has the value in its middle."""
    at = (2 * np.arange(GRID) + 1 - GRID) / GRID
    found = uniformity(2 + a * at[None, :] - b * at[:, None])
    swing = (abs(a) + abs(b)) * 18 / 21
    middles = (np.arange(19) - 9) * 2 / 21
    rsd = hypot(a * middles.std(), b * middles.std()) / 2
    assert found.min_over_mean == pytest.approx(1 - swing / 2, rel=1e-12)
    assert found.min_over_max == pytest.approx((2 - swing) / (2 + swing), rel=1e-12)
    assert found.rsd == pytest.approx(rsd, rel=1e-9, abs=1e-12)


def test_one_dark_box_is_seen():
    light = np.ones((GRID, GRID))
    light[10, 10] = 0.2
    found = uniformity(light)
    assert found.min_over_mean == pytest.approx(0.2 / (1 - 0.8 / 361))
    assert found.min_over_max == pytest.approx(0.2)


@pytest.mark.parametrize(("blur", "grid"), [(0.0, 21), (0.1, 21), (0.2, 15), (0.05, 13)])
def test_boxes_of_a_disk_lie_in_it_with_its_margin_taken_off(blur, grid):
    radius = 0.8
    found = uniformity(np.ones((grid, grid)), disk(radius), blur)
    margin = max(0.025 * 2 * radius, blur)
    assert found.margin == margin
    edges = radius * (2 * np.arange(grid + 1) / grid - 1)
    reach = np.maximum(np.abs(edges[:-1]), np.abs(edges[1:]))
    corners = np.hypot(*np.meshgrid(reach, reach))  # the farthest corner of each box
    cells = 3 * 2 * radius / RASTER  # of the raster, by which it may err
    sure, possible = (corners <= radius - margin - cells).sum(), (corners <= radius - margin + cells).sum()
    assert sure <= found.boxes <= possible


def test_with_less_than_half_of_the_region_nothing_is_said():
    found = BoxGrid(disk(0.8), GRID, 0.3).without_light()
    assert found.min_over_mean is found.min_over_max is found.rsd is None
    assert found.reason.startswith("a margin of 0.3, the larger of 2.5% of the region's shorter side")
    assert "leaves boxes on 33% of the region" in found.reason


@pytest.mark.parametrize("light", [np.zeros((GRID, GRID)), -np.full((GRID, GRID), 1e-20)])
def test_dark_regions_have_no_uniformity(light):
    assert uniformity(light).reason == "the region is dark"


def test_a_stripe_of_few_boxes_is_not_judged():
    t = (np.arange(RASTER) + 0.5) / RASTER
    stripe = LitRegion((-1, 1), (-1, 1), np.abs(t - t[:, None]) < 0.09)
    assert "leaves boxes on" in uniformity(np.ones((GRID, GRID)), stripe).reason


@pytest.mark.parametrize(("noise", "dark"), [(0.003, 1.0), (0.03, 1.0), (0.003, 0.8), (0.01, 0.8)], ids=str)
def test_errors_are_those_of_repetitions(noise, dark):
    """Light measured 300 times by 8 replicates: all numbers are right on average and spread as is said.

    The naive minimum of even light is 2.9 errors too low.
    """
    rng, true = np.random.default_rng(5), np.ones((GRID, GRID))
    true[10, 10] = dark
    exact, found = uniformity(true), []
    for _ in range(300):
        found.append(uniformity(true + np.sqrt(8) * noise * rng.normal(size=(8, GRID, GRID))))
    for name in ("min_over_mean", "min_over_max", "rsd"):
        values, told = (np.array([getattr(f, name + end) for f in found]) for end in ("", "_error"))
        error = np.sqrt(np.mean(told**2))
        if name != "rsd" or exact.rsd > noise / 2:  # noise alone has a spread of its own
            assert abs(values.mean() - getattr(exact, name)) < 0.4 * error
            assert values.std() == pytest.approx(error, rel=0.25)


@pytest.mark.parametrize("share", [0.3, -0.3, 0.05])
def test_a_drift_is_told_and_not_taken_off(share):
    """Waves that are off by a share of themselves: rsd and U0 stay as they are, with that error."""
    x = np.linspace(-1, 1, GRID)
    waves = 0.02 * np.cos(3 * x) * np.cos(2 * x)[:, None]
    shown, plain, true = (
        uniformity(1 + light, drift=known)
        for light, known in ((waves, share * waves), (waves, 0.0), ((1 + share) * waves, 0.0))
    )
    assert shown.rsd == plain.rsd
    assert abs(true.rsd - shown.rsd) == pytest.approx(shown.rsd_error, rel=abs(share))
    assert abs(true.min_over_mean - shown.min_over_mean) <= shown.min_over_mean_error
    assert shown.min_over_mean_error < 1.7 * abs(true.min_over_mean - shown.min_over_mean)


@given(st.floats(1.5, 4.0))
def test_the_edge_of_a_blurred_step_has_the_width_of_its_blur(sigma):
    """Between 90 and 10 % a Gaussian edge is 2.563 sigma wide; pixels widen it in squares."""
    lit = np.zeros((120, 160), dtype=bool)
    lit[30:90, 40:120] = True
    light = gaussian_filter(lit.astype(float), sigma)
    wide = edge_width(light, lit, 1.0, (0.5, 0.5))
    assert wide == pytest.approx(2 * ndtri(0.9) * 0.5 * hypot(sigma, 12**-0.5), rel=0.06)  # corners round it


def test_a_sharp_edge_between_pixels_is_narrower_than_a_pixel_and_no_edge_has_no_width():
    lit = np.zeros((20, 20), dtype=bool)
    lit[5:15, 5:15] = True
    assert edge_width(lit * 3.0, lit, 3.0, (2.0, 2.0)) == pytest.approx(1.6, rel=0.05)  # corners are farther
    assert edge_width(np.ones((20, 20)), np.ones((20, 20), dtype=bool), 1.0, (1, 1)) is None
    assert edge_width(np.ones((20, 20)), lit, 1.0, (1, 1)) is None


def test_regions_of_pixels_are_those_pixels():
    lit = np.zeros((10, 20), dtype=bool)
    lit[2:5, 4:16] = True
    lit[2, 4] = False
    region = LitRegion.of_pixels(lit, (4.0, 1.0))
    assert (region.x, region.y) == (pytest.approx((-2.4, 2.4)), pytest.approx((0.0, 0.6)))
    assert region.inside.mean() == pytest.approx(35 / 36)
    assert (region.inside[0, 0], region.inside[-1, 0], region.inside[0, -1]) == (False, True, True)
    assert LitRegion.of_pixels(np.zeros((3, 3), dtype=bool), HALF) is None
    assert region.depth.max() == pytest.approx(0.3, abs=0.02)
    assert region.depth.min() < 0 < inf
