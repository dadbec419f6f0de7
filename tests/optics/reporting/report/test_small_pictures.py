"""Pictures of light for pages: one scale for target and light, red where light is too much."""

import io

import numpy as np
from PIL import Image

from optics.reporting.report import light_pictures

TARGET = np.array([[0.0, 1.0], [4.0, 4.0]])
LIGHT = np.array([[0.0, 2.0], [4.0, 1.0]])


def pixels(png):
    """Return the middles of the four quarters of a picture."""
    picture = np.array(Image.open(io.BytesIO(png))).astype(int)
    quarter = picture.shape[0] // 4
    return picture[quarter :: 2 * quarter, quarter :: 2 * quarter]


def test_target_and_light_have_one_scale():
    (_, target), (_, light), _ = light_pictures(TARGET, LIGHT)
    assert pixels(target).tolist() == [[0, 128], [255, 255]]  # square roots of parts of 4
    assert pixels(light).tolist() == [[0, 180], [255, 128]]


def test_the_difference_is_white_where_there_is_none_red_where_light_is_too_much_and_blue_where_it_lacks():
    *_, (caption, difference) = light_pictures(TARGET, LIGHT)
    (none, much), (_, lacking) = pixels(difference)
    assert none.tolist() == [255, 255, 255]
    assert much[0] > much[2]
    assert lacking[2] > lacking[0]
    assert "133%" in caption  # 3 of a mean of 2.25


def test_large_pictures_are_reduced_and_black_ones_are_shown():
    for shape in ((1500, 40), (3, 2)):
        for _, png in light_pictures(np.zeros(shape), np.zeros(shape)):
            assert 256 < max(Image.open(io.BytesIO(png)).size) <= 512
