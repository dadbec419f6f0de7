"""Rays into pixels: Dr.Jit's accumulation against a loop over rays and pixels."""

import numpy as np
import pytest

from optics.base.runtime import load_backend
from optics.designing.optimisation import MARGIN
from optics.light.measuring.splat import WEIGHT, Splat
from optics.scene.receivers import BoxWindow, BSplineWindow, GaussianWindow, Screen
from oracles.light_formulas import brute_irradiance
from tests.optics.cases import THREADS, on_threads

WINDOWS = [
    BoxWindow(),
    *(BSplineWindow(p) for p in (1, 2, 3, 4, 5)),
    GaussianWindow(0.5, 4.0),
    GaussianWindow(0.9, 3.0),
]
SCREENS = [
    Screen((6.0, 6.0), (20, 20), 0),
    Screen((6.0, 6.0), (20, 20), 4),
    Screen((5.0, 3.0), (15, 21), 3),
    Screen((2.0, 9.0), (31, 17), 2),
]


def splat(backend, screen, window, x, y, flux, light=None):
    """Return the image of rays, (rows, columns) with margin."""
    rays = (backend.Float(np.atleast_1d(a).astype(float)) for a in (x, y, flux))
    return Splat(backend, screen, window, light)(*rays).numpy().reshape(screen.padded, order="F")


def assert_defined(backend, screen, window, rays, light=None):
    """The image is the sum over rays and pixels, to the rounding of a landing point in pixels, times the
    window's slope (at most 2 per pixel), summed over the rays of a pixel."""
    expected = brute_irradiance(screen, window, *rays)
    found = splat(backend, screen, window, *rays, light)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * expected.max())


def rays_within(screen, inset, count=200, seed=3):
    """Return (x, y, flux) of random rays at least `inset` pixels inside the padded screen."""
    rng = np.random.default_rng(seed)
    limits = [h + (screen.margin - inset) * p for h, p in zip(screen.half_width, screen.pitch)]
    x, y = (rng.uniform(-a, a, count) for a in limits)
    return x, y, rng.uniform(0, 1, count)


@pytest.mark.parametrize("screen", SCREENS, ids=repr)
@pytest.mark.parametrize("window", WINDOWS, ids=repr)
def test_image_is_the_sum_over_rays_and_pixels(backend, window, screen):
    assert_defined(backend, screen, window, rays_within(screen, window.taps / 2))


@pytest.mark.parametrize("window", [BSplineWindow(3), GaussianWindow(0.5, 4.0)], ids=repr)
def test_windows_that_reach_over_the_border_deposit_what_lies_inside(backend, window):
    """The definition of E holds for every pixel of the screen, also for rays near the border and beside
    it."""
    screen = Screen((5.0, 3.0), (15, 21), 2)
    assert_defined(backend, screen, window, rays_within(screen, -window.taps))


@pytest.mark.every(2)
@pytest.mark.parametrize("sigma", [1.0, 2.5])
def test_light_near_the_edge_of_the_target_is_measured(backend, sigma):
    """With the design's margin and a Gaussian that a problem may ask for, light on the target's edge is
    seen."""
    screen, window = Screen((10.0, 10.0), (32, 32), MARGIN), GaussianWindow(sigma)
    assert_defined(backend, screen, window, ([9.9, 0.0], [0.3, -9.9], [1.0, 2.0]))


@pytest.mark.parametrize("window", [w for w in WINDOWS if not isinstance(w, GaussianWindow)], ids=repr)
@pytest.mark.parametrize("screen", SCREENS, ids=repr)
def test_every_watt_is_counted(backend, window, screen):
    x, y, flux = rays_within(screen, window.taps / 2)
    total = splat(backend, screen, window, x, y, flux).sum() * screen.pixel_area
    assert total == pytest.approx(
        flux.sum(), rel=1e-13
    )  # 200 rays x at most 36 taps, each rounded to 1.1e-16


@pytest.mark.parametrize(
    ("x", "y", "row", "column"),
    [(-2.9, 1.9, 0, 0), (2.9, 1.9, 0, 5), (-2.9, -1.9, 3, 0), (2.4, 0.6, 1, 5), (-0.2, -0.2, 2, 2)],
)
def test_row_0_lies_at_plus_y_and_column_0_at_minus_x(backend, x, y, row, column):
    image = splat(backend, Screen((3.0, 2.0), (6, 4)), BoxWindow(), x, y, 5.0)
    expected = np.zeros((4, 6))
    expected[row, column] = 5.0
    np.testing.assert_allclose(image, expected, rtol=1e-15)


def test_the_margin_moves_the_picture_and_crop_takes_it_back(backend):
    screen = Screen((3.0, 2.0), (6, 4), 3)
    image = splat(backend, screen, BoxWindow(), -2.9, 1.9, 5.0)
    assert image.shape == (10, 12)
    assert image[3, 3] == pytest.approx(5.0, rel=1e-15)
    assert screen.crop(image)[0, 0] == image[3, 3]
    np.testing.assert_array_equal(screen.pad(screen.crop(image)), image)


@pytest.mark.parametrize(
    ("x", "y"),
    [(5.1, 0.0), (-5.1, 0.0), (0.0, 4.1), (0.0, -4.1), (np.nan, 0.0), (np.inf, 0.0), (1e300, -1e300)],
)
def test_rays_whose_window_misses_the_screen_leave_no_light(backend, x, y):
    assert not splat(backend, Screen((3.0, 2.0), (6, 4)), BSplineWindow(3), x, y, 5.0).any()


@pytest.mark.slow
def test_single_precision_finds_every_pixel_of_the_largest_screen():
    """Pixel numbers of 4112 x 4112 pixels pass 2^24, beyond which float32 skips whole numbers."""
    single = load_backend("single", 1)
    screen = Screen((2048.0, 2048.0), (4096, 4096), 8)
    x, y = np.array([2047.5, 2046.5, 2047.5]), np.array([-2047.5, -2046.5, -2044.5])
    image = splat(single, screen, BoxWindow(), x, y, [1.0, 2.0, 4.0])
    found = {(int(r), int(c)): float(image[r, c]) for r, c in np.argwhere(image)}
    assert found == {(8 + 4095, 8 + 4095): 1.0, (8 + 4094, 8 + 4094): 2.0, (8 + 4092, 8 + 4095): 4.0}


@pytest.mark.every(3)
@pytest.mark.parametrize("light", [None, 1e5])
@pytest.mark.parametrize("window", [BoxWindow(), BSplineWindow(3), GaussianWindow(0.3, 4.0)], ids=repr)
def test_no_order_and_no_number_of_threads_changes_a_bit(backend, window, light):
    """2^17 rays are shared by several threads; of one pixel each has many."""
    screen = Screen((6.0, 6.0), (20, 20), 4)
    rays = np.array(rays_within(screen, 0, 1 << 17))
    orders = slice(None), np.random.default_rng(1).permutation(1 << 17)

    def image(order):
        return Splat(backend, screen, window, light)(*(backend.array(r) for r in rays[:, order])).numpy()

    found = [on_threads(threads, image, order) for threads in THREADS for order in orders]
    assert len({f.tobytes() for f in found}) == 1
    # of the 2^17 numbers on a pixel each is rounded by half a quantum, 2^-61 of the light
    assert_defined(backend, screen, window, rays[:, :4000], light)


@pytest.mark.parametrize("window", [*WINDOWS, GaussianWindow(0.3, 4.0)], ids=repr)
def test_the_weights_of_a_ray_sum_up_to_less_than_their_bound(window):
    t = np.linspace(0, 1, 1001)
    of_ray = np.sum([np.broadcast_to(w, t.shape) for w in window.weights(t, np.exp)], axis=0)
    assert of_ray.max() ** 2 < WEIGHT
