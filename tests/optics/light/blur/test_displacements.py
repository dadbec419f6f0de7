"""The displaced pictures of the lenses of a plate as a blur: whole pixels, parts of them, adjoint and aim."""

import numpy as np
import pytest

from optics.base.runtime import UserError
from optics.light.blur import Displacements, aimed_light
from optics.scene.receivers import Screen

SCREEN = Screen((16.0, 12.0), (32, 24))  # of 1 mm
TWO = Displacements(np.array([-1.5, 1.5]), np.array([0.0]))
SIX = Displacements(np.array([-4.3, 0.0, 4.3]), np.array([-1.9, 1.9]))


def test_whole_pixels_move_the_light_and_parts_share_it():
    """1.5 mm are 3 half pixels: in whole pixels half of the light goes to each of two."""
    whole, parts = TWO.onto(SCREEN, 2), TWO.onto(SCREEN)
    assert (parts.wide.pixels, whole.wide.pixels) == ((36, 28), (72, 56))
    point = np.zeros((28, 36))
    point[14, 20] = 1.0
    assert parts(point)[12, [16, 17, 19, 20]] == pytest.approx([0.25] * 4)
    fine = np.zeros((56, 72))
    fine[28, 40] = 1.0
    moved = whole.convolution(fine)
    assert moved[28, [37, 43]] == pytest.approx([0.5, 0.5])
    assert moved.sum() == pytest.approx(1.0)


@pytest.mark.parametrize(("times", "margin"), [(1, 0), (3, 2)])
def test_back_is_the_adjoint(times, margin):
    displaced, rng = SIX.onto(SCREEN, times, margin), np.random.default_rng(1)
    light, image = rng.normal(size=displaced.wide.padded), rng.normal(size=SCREEN.shape)
    assert np.vdot(displaced(light), image) == pytest.approx(np.vdot(light, displaced.back(image)), rel=1e-12)
    assert displaced(np.ones(displaced.wide.padded)) == pytest.approx(1.0)


@pytest.mark.parametrize(("pitch", "parts"), [(4.0, 1), (3.0, 2), (1.0, 2), (4.3, 7)])
def test_pixels_are_cut_where_lenses_stand_between_them(pitch, parts):
    """Half a pitch is 2, 1.5 and 0.5 pixels of 1 mm, and 15.05 sevenths of one."""
    moved = Displacements(np.array([-pitch, pitch]) / 2, np.array([0.0]))
    assert moved.parts(SCREEN, 4) == parts


def test_six_lenses_aim_at_light_whose_sum_is_the_picture():
    """What is aimed at brings back much of what a rectangle lacks at its borders, displaced."""
    picture = np.zeros(SCREEN.shape)
    picture[4:-4, 6:-6] = 1.0
    displaced = SIX.onto(SCREEN)
    wide, light = aimed_light(SIX, SCREEN, picture)
    assert wide.pixels == (42, 34)
    assert light.min() >= 0

    def off(image):
        image = image * np.vdot(image, picture) / np.vdot(image, image)
        return np.linalg.norm(image - picture) / np.linalg.norm(picture)

    assert off(displaced(light)) < 0.6 * off(displaced(displaced.spread(picture)))


def test_lenses_over_more_pixels_than_memory_holds_are_refused():
    far = Displacements(np.array([-900.0, 900.0]), np.array([0.0]))
    with pytest.raises(UserError, match=r"lens\.array lie over 3600 pixels, and the target has 64"):
        far.widened(Screen((16.0, 16.0), (64, 64)))
