"""Files and pictures of the light: the same bytes, numbers at their pixels, one scale that leads back."""

import io
import re
import zipfile

import numpy as np
import pytest
from PIL import Image

from optics.reporting.report import light_pictures
from optics.reporting.report.irradiance_files import light_files
from optics.scene.photometry import units_of
from optics.scene.receivers import FarField, Screen

PLANE = Screen((20.0, 10.0), (40, 20))
WATTS = units_of("W").in_plane
FAR = Screen((3.0, 3.0), (4, 6), receiver=FarField())


def light(screen, brightest=3e-4):
    rows, columns = screen.shape
    return brightest * np.random.default_rng(1).uniform(0, 1, (rows, columns))


def arrays(files):
    return np.load(io.BytesIO(files["irradiance.npz"]), allow_pickle=False)


def grey(files):
    return Image.open(io.BytesIO(files["irradiance_16bit.png"]))


def test_the_arrays_hold_every_bit_and_carry_no_date():
    image, target = light(PLANE), light(PLANE)[::-1]
    files = light_files(image, target, PLANE, WATTS)
    with arrays(files) as stored:
        assert (stored["irradiance"] == image).all()
        assert (stored["target"] == target).all()
    with zipfile.ZipFile(io.BytesIO(files["irradiance.npz"])) as archive:
        assert {entry.date_time for entry in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}


@pytest.mark.parametrize(
    ("screen", "flux", "units"),
    [
        (PLANE, "W", ("W/mm^2", "mm")),
        (FAR, "W", ("W/degree^2", "degrees")),
        (PLANE, "lm", ("lm/mm^2", "mm")),
        (FAR, "lm", ("lm/degree^2", "degrees")),
    ],
)
def test_the_axes_are_the_centres_of_pixels_with_row_0_at_plus_y(screen, flux, units):
    density = units_of(flux).density(screen.angular)
    with arrays(light_files(light(screen), light(screen), screen, density)) as stored:
        x, y = stored["x"], stored["y"]
        assert (str(stored["unit"]), str(stored["axes_unit"])) == units
    (px, py), (hx, hy) = screen.pitch, screen.half_width
    assert x == pytest.approx(-hx + px * (np.arange(screen.pixels[0]) + 0.5), abs=1e-14 * hx)
    assert y == pytest.approx(hy - py * (np.arange(screen.pixels[1]) + 0.5), abs=1e-14 * hy)


def test_the_picture_has_one_grey_value_per_pixel_and_its_scale_gives_the_irradiance_back():
    image = light(PLANE)
    with grey(light_files(image, image, PLANE, WATTS)) as picture:
        values, text, gamma = np.asarray(picture), picture.text["Scale"], picture.info["gamma"]
    number, rest = re.fullmatch(r"(\S+) (.*)", text).groups()
    assert (rest, gamma) == ("W/mm^2 per grey level, linear", 1.0)
    assert (values.dtype, values.max()) == (np.uint16, 65535)
    # half a grey level
    np.testing.assert_allclose(values * float(number), image, rtol=0, atol=0.5001 * float(number))


@pytest.mark.parametrize("value", [0.0, -1e-20])
def test_a_dark_target_is_black(value):
    dark = np.full(PLANE.shape, value)
    with grey(light_files(dark, light(PLANE), PLANE, WATTS)) as picture:
        assert not np.asarray(picture).any()
        assert picture.text["Scale"].startswith("0.0 W/mm^2")


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
