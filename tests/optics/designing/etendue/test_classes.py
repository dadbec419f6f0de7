"""What the two bounds do not forbid: light of stretched images, and of images of different sizes."""

import numpy as np
import pytest

from optics.designing.etendue import (
    FIXED_QUICK,
    blur_sentence,
    one_blur,
    reached_sentences,
    universal_bound,
)
from optics.designing.etendue.problem_bounds import SEARCH_QUICK
from optics.designing.etendue.throughput_bound import image_area
from optics.light.analysis import rel_l2
from tests.optics.cases import HOLLOW, example_system, small_system

EFFICIENCY = 0.9216
STRIPES = HOLLOW | {
    "source.kind": "lambertian",
    "source.half_width": [0.5, 0.5],
    "target.fit": "stretch",
    "target.encoding": "linear",
    "target.half_width": [320.0, 320.0],
    "target.pixels": [32, 32],
}


def covered(first, last, n):
    """Return the shares of n pixels that an interval covers."""
    return np.diff(np.clip(np.arange(n + 1), first, last))


@pytest.fixture
def stripes(tmp_path):
    """The problem of two upright stripes, 2 pixels wide and apart, 26 pixels high."""
    light = np.zeros((32, 32), dtype=np.uint8)
    light[3:29, 13:15] = light[3:29, 17:19] = 255
    return small_system(tmp_path, STRIPES, light)


@pytest.mark.slow
def test_a_stretched_image_of_the_same_area_is_not_forbidden(stripes):
    """Images of 2 x 13 pixels draw it, two in each stripe; squares of their area, or less, cannot."""
    screen = stripes.target.screen()
    target = stripes.target.irradiance(screen, 1.0)
    squares = one_blur(stripes, EFFICIENCY, FIXED_QUICK, any_form=False)
    area = np.prod(squares.width)
    assert 20 < area < 2 * 13
    light = np.zeros((32, 32))
    for top in (3, 16):
        for left in (13, 17):
            light += np.outer(covered(top, top + 13, 32), covered(left, left + 2, 32))
    attained = rel_l2(light, target)
    assert attained < 0.055
    free = one_blur(stripes, EFFICIENCY, SEARCH_QUICK)
    assert squares.bound.lower_bound >= 0.4472
    assert free.bound.lower_bound <= attained
    assert universal_bound(stripes).least_rel_l2(EFFICIENCY) <= attained


@pytest.mark.parametrize("profile", ["uniform", "round"])
def test_the_area_of_images_is_that_of_what_shines(tmp_path, profile):
    """Of a round source an image is a disk, and its square has more than the area that etendue asks for."""
    system = small_system(tmp_path, STRIPES | {"source.profile": profile})
    images = one_blur(system, EFFICIENCY, FIXED_QUICK, any_form=False)
    least = image_area(system, EFFICIENCY, 0.25)
    assert 4 * np.prod(images.half_width) * images.filled == pytest.approx(least)
    pixels = least / system.target.screen().pixel_area
    assert f"at least {pixels:.4g} square pixels" in blur_sentence(images)


def sheared(step, count):
    """Return light of upright images on the crescent of extended.toml, and the mean of their areas.

    Images 96 pixels high follow its parabola.  They are `count` steps wide, one at every step from its left
    to its right; narrower ones fill both ends.  All have the same irradiance.  In square pixels.
    """
    first, last = 32.0, 224.0
    middle = np.arange(first, last - count * step + step / 2, step)
    parts = step * np.arange(1, count)
    left = np.concatenate([middle, np.full(count - 1, first), last - parts])
    width = np.concatenate([np.full(len(middle), count * step), parts, parts])
    light = np.zeros((256, 256))
    for x, w in zip(left, width):
        centre = 80 + (x + w / 2 - 128) ** 2 / 96
        light += np.outer(covered(centre - 48, centre + 48, 256), covered(x, x + w, 256))
    return light, float(96 * width.mean())


def test_images_of_different_sizes_are_outside_the_class_of_one_blur():
    """They draw the crescent 6 times better than one blur in the source's proportions may."""
    system = example_system("extended")
    screen = system.target.screen()
    light, mean = sheared(0.25, 6)
    attained = rel_l2(light, system.target.irradiance(screen, 1.0))
    needed = image_area(system, EFFICIENCY, attained) / screen.pixel_area
    assert attained < 0.016
    assert mean >= needed > 100  # etendue asks for no more
    assert universal_bound(system).least_rel_l2(EFFICIENCY) <= attained


@pytest.mark.slow
def test_a_design_with_such_images_is_told_which_class_it_left():
    system = example_system("extended")
    found = reached_sentences(system, {"rel_l2_debiased": 0.016, "efficiency": EFFICIENCY})
    (every, _, free), (alike,) = found.background, found.limits
    bound = one_blur(system, EFFICIENCY, FIXED_QUICK, any_form=False).bound.lower_bound
    assert bound > 0.08
    assert alike.endswith("left the class: its images of the source are not all alike")
    assert "left" not in every + free
