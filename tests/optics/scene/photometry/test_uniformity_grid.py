"""Uniformity on boxes, against closed forms, brute force and geometry."""

from math import hypot, inf

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.ndimage import gaussian_filter
from scipy.special import ndtri

from optics.scene.photometry import RASTER, LitRegion, edge_width, uniformity
from optics.scene.receivers import with_mirror_images

HALF = (3.0, 2.0)
WHOLE = LitRegion((-3.0, 3.0), (-2.0, 2.0), np.ones((RASTER, RASTER), dtype=bool))
STEP = RASTER // 2


def disk(radius):
    """A disk in a square screen of half-width 1."""
    t = (np.arange(RASTER) + 0.5) / RASTER * 2 - 1
    reach = 1 / RASTER  # half a cell: it lies in the disk where its farthest corner does
    far = np.hypot(*np.meshgrid(np.abs(t) + reach, np.abs(t) + reach))
    return LitRegion((-radius, radius), (-radius, radius), far <= 1)


def test_even_light_is_even_and_the_border_is_left_out():
    """A margin of 2.5 % of the shorter side reaches into the outermost of 21 boxes, and no further."""
    found = uniformity(np.full((60, 90), 7.0), WHOLE, HALF)
    assert (found.mean, found.min_over_mean, found.min_over_max, found.rsd) == pytest.approx((7, 1, 1, 0))
    assert (found.grid, found.boxes) == (21, 19 * 19)
    assert found.box == pytest.approx((6 / 21, 4 / 21))
    assert found.margin == pytest.approx(0.1)


@given(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))
def test_a_plane_of_light_has_the_ratios_of_its_outermost_boxes(a, b):
    """E = 2 + a x + b y on pixels that tile the boxes: a box has the value in its middle."""
    columns, rows = 21 * 6, 21 * 4
    x, y = (
        HALF[0] * (2 * np.arange(columns) + 1 - columns) / columns,
        HALF[1] * (rows - 1 - 2 * np.arange(rows)) / rows,
    )
    found = uniformity(2 + a * x[None, :] / 3 + b * y[:, None] / 2, WHOLE, HALF)
    swing = (abs(a) + abs(b)) * 18 / 21
    middles = (np.arange(19) - 9) * 2 / 21
    rsd = hypot(a * middles.std(), b * middles.std()) / 2
    assert found.min_over_mean == pytest.approx(1 - swing / 2, rel=1e-12)
    assert found.min_over_max == pytest.approx((2 - swing) / (2 + swing), rel=1e-12)
    assert found.rsd == pytest.approx(rsd, rel=1e-9, abs=1e-12)


@given(st.integers(0, 10**6), st.integers(25, 40), st.integers(25, 40), st.integers(9, 25))
def test_boxes_hold_the_means_of_the_pixels_that_they_cover(seed, rows, columns, grid):
    """Against the light on a raster so fine that pixels and boxes are whole numbers of its points."""
    light = np.random.default_rng(seed).uniform(0.5, 1, (rows, columns))
    found = uniformity(light, WHOLE, HALF, grid=grid)
    fine = light.repeat(grid, axis=0).repeat(grid, axis=1)
    means = fine.reshape(grid, rows, grid, columns).mean(axis=(1, 3))
    inner = means[1:-1, 1:-1]  # 2.5 % of the height reach into one box: grid < 40
    assert found.mean == pytest.approx(inner.mean(), rel=1e-12)
    assert found.min_over_mean == pytest.approx(inner.min() / inner.mean(), rel=1e-12)
    assert found.rsd == pytest.approx(inner.std() / inner.mean(), rel=1e-9)


@pytest.mark.parametrize(("pixels", "width"), [(21, 1), (20, 2), (10, 3), (7, 3)])
def test_no_box_is_smaller_than_a_pixel(pixels, width):
    found = uniformity(np.ones((pixels, pixels)), WHOLE, HALF)
    assert found.box == pytest.approx((width * 6 / 21, width * 4 / 21))
    assert found.min_over_mean == pytest.approx(1)


def test_pixels_too_large_for_boxes_tell_nothing():
    found = uniformity(np.ones((2, 2)), WHOLE, HALF)
    assert found.min_over_mean is None
    assert found.few_pixels
    assert found.reason == (
        "boxes of 0.857 x 0.571 are smaller than a pixel of 3 x 2; --set target.pixels=[7,7] has smaller ones"
    )


def test_one_dark_box_is_seen():
    light = np.ones((21 * 4, 21 * 4))
    light[40:44, 40:44] = 0.2
    found = uniformity(light, WHOLE, HALF)
    assert found.min_over_mean == pytest.approx(0.2 / (1 - 0.8 / 361))
    assert found.min_over_max == pytest.approx(0.2)


@pytest.mark.parametrize(("blur", "grid"), [(0.0, 21), (0.1, 21), (0.2, 15), (0.05, 13)])
def test_boxes_of_a_disk_lie_in_it_with_its_margin_taken_off(blur, grid):
    radius, screen = 0.8, (1.0, 1.0)
    found = uniformity(np.ones((50, 50)), disk(radius), screen, blur=blur, grid=grid)
    margin = max(0.025 * 2 * radius, blur)
    assert found.margin == margin
    edges = radius * (2 * np.arange(grid + 1) / grid - 1)
    reach = np.maximum(np.abs(edges[:-1]), np.abs(edges[1:]))
    corners = np.hypot(*np.meshgrid(reach, reach))  # the farthest corner of each box
    cells = 3 * 2 * radius / RASTER  # of the raster, by which it may err
    sure, possible = (corners <= radius - margin - cells).sum(), (corners <= radius - margin + cells).sum()
    assert sure <= found.boxes <= possible


def test_with_less_than_half_of_the_region_nothing_is_said():
    found = uniformity(np.ones((50, 50)), disk(0.8), (1.0, 1.0), blur=0.3)
    assert found.min_over_mean is found.min_over_max is found.rsd is None
    assert found.reason.startswith("a margin of 0.3, the larger of 2.5% of the region's shorter side")
    assert "leaves boxes on 33% of the region" in found.reason


@pytest.mark.parametrize("light", [np.zeros((4, 4)), -np.full((4, 4), 1e-20)])
def test_dark_regions_have_no_uniformity(light):
    assert uniformity(light, WHOLE, HALF).reason == "the region is dark"


def test_boxes_grow_until_their_noise_is_below_one_per_cent():
    """A pixel's noise of 10 % is 1 % in a box of 100 pixels: 210 / 21 pixels each way."""
    light, noise = np.ones((210, 210)), np.full((210, 210), 0.1)
    square = LitRegion((-1, 1), (-1, 1), np.ones((RASTER, RASTER), dtype=bool))
    for times, width in ((0.999, 1), (1.999, 2), (2.999, 3)):
        found = uniformity(light, square, (1, 1), times * noise)
        assert found.box == pytest.approx([width * 2 / 21] * 2)
        assert found.boxes == (20 - width) ** 2
        assert found.left == pytest.approx((19 / 21) ** 2)
    found = uniformity(light, square, (1, 1), 4 * noise)
    assert found.min_over_mean is None
    assert found.reason == "the noise of boxes of 0.286 x 0.286 is 1.3% of the mean"


@pytest.mark.parametrize("noise", [0.0, 0.1, 0.3])
def test_a_dark_rim_shows_however_noisy_the_light_is(noise):
    """Boxes that noise makes larger still reach the rim of a disk; where they hide it, nothing is said."""
    x = 1 - 2 * (np.arange(200) + 0.5) / 200
    light = (np.hypot(x, x[:, None]) < 0.8 * 7.7 / 9).astype(float)
    found = uniformity(light, disk(0.8), (1, 1), np.full(light.shape, noise))
    assert found.min_over_mean is None if noise > 0.2 else found.min_over_mean < 0.7


def test_a_stripe_of_few_boxes_is_not_judged():
    t = (np.arange(RASTER) + 0.5) / RASTER
    stripe = LitRegion((-1, 1), (-1, 1), np.abs(t - t[:, None]) < 0.09)
    assert "leaves boxes on" in uniformity(np.ones((40, 40)), stripe, (1, 1)).reason


@pytest.mark.slow
@pytest.mark.parametrize("axes", [(), (1,), (0, 1)], ids=str)
def test_errors_are_those_of_repetitions(axes):
    """Light of one dark box, measured 400 times: the scatter of U0, and the mean of rsd, are as is said.

    Where errors are their own mirror images, those of that box, which is in the middle, are larger.
    """
    rng, true = np.random.default_rng(5), np.ones((84, 84))
    true[40:44, 40:44] = 0.8
    noise = np.full(true.shape, 0.018)
    exact = uniformity(true, WHOLE, HALF)

    def measured():
        errors = with_mirror_images(rng.normal(size=true.shape), axes) / np.sqrt(2 ** len(axes))
        return uniformity(true + noise * errors, WHOLE, HALF, noise, axes=axes)

    found = [measured() for _ in range(400)]
    scatter = np.std([f.min_over_mean for f in found])
    assert scatter == pytest.approx(
        found[0].min_over_mean_error, rel=0.15
    )  # 3.5 % of 400 repetitions, 4 times
    assert np.std([f.min_over_max for f in found]) == pytest.approx(found[0].min_over_max_error, rel=0.4)
    assert found[0].min_over_mean_error == pytest.approx(0.018 / 4 * np.sqrt(2 ** len(axes)), rel=0.01)
    spread = np.std([f.rsd for f in found])
    assert abs(np.mean([f.rsd for f in found]) - exact.rsd) < 4 * spread / 20
    assert spread == pytest.approx(found[0].rsd_error, rel=0.2)


@pytest.mark.parametrize("share", [0.3, -0.3, 0.05])
def test_a_drift_is_told_and_not_taken_off(share):
    """Waves that are off by a share of themselves: rsd stays as it is, and it and U0 are off by what is told.
    Of as much noise a third would be told, which averages out over a box."""
    x = np.linspace(-1, 1, 63)
    waves = 0.02 * np.cos(3 * x) * np.cos(2 * x)[:, None]
    drift = share * waves
    shown, noisy, plain, true = (
        uniformity(1 + light, WHOLE, HALF, noise, drift=known)
        for light, noise, known in (
            (waves, 0 * drift, drift),
            (waves, drift, 0.0),
            (waves, None, 0.0),
            (waves + drift, None, 0.0),
        )
    )
    assert shown.rsd == plain.rsd > noisy.rsd
    assert abs(true.rsd - shown.rsd) == pytest.approx(shown.rsd_error, rel=abs(share))
    assert abs(true.min_over_mean - shown.min_over_mean) == pytest.approx(shown.min_over_mean_error, rel=0.1)
    assert noisy.min_over_mean_error == pytest.approx(shown.min_over_mean_error / 3, rel=0.1)


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
