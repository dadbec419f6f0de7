"""What a blur leaves of a picture: closed forms of borders and strokes, and what is said of it."""

import re

import numpy as np
import pytest

from optics.designing.prediction import blur_limits, blur_sentence
from optics.designing.prediction.blurred_picture import _blurred, stroke_width
from optics.light.analysis import rel_l2
from optics.light.blur import Blur, LandingShifts, aimed_light, blur_of
from optics.scene.receivers import Screen
from optics.scene.sources import Divergence
from tests.optics.cases import WIDE, small_system


@pytest.mark.parametrize("parts", [0.8, 2.0])
def test_a_disk_takes_light_over_the_border_of_what_is_lit(parts):
    """A disk of radius r moves the light of a band 2 r / (3 pi) wide over a straight border.

    parts : the diameter of the disk in pixels.
    """
    screen, radius = Screen((20.0, 20.0), (40, 40)), parts / 2
    shifts = LandingShifts(*[radius / np.sin(np.radians(0.5)) * np.eye(2)] * 3, 0.0)
    picture = np.zeros((40, 40))
    picture[:, :20] = 1.0
    found = _blurred(Blur(Divergence("uniform", 0.5), (0.0, 0.0), shifts), picture, screen)
    assert found[20, 20:30].sum() == pytest.approx(2 * radius / (3 * np.pi), rel=0.05)


@pytest.mark.parametrize("width", [4, 8, 20])
def test_a_stroke_is_as_wide_as_it_is(width):
    picture = np.zeros((60, 90))
    picture[20 : 20 + width, :] = 1.0
    assert stroke_width(picture, (0.5, 0.5)) == pytest.approx(
        0.5 * width, rel=0.1
    )  # its ends are borders too


def test_the_kernel_of_a_spot_wider_than_the_target_is_not_made(tmp_path, backend, monkeypatch):
    """5 degrees at 1 m are 170 mm: the kernel on 128 pixels of 20 mm would have (14 * 2300)^2 numbers."""
    changes = {
        "source.divergence": 5.0,
        "target.distance": 1000.0,
        "target.half_width": [10.0, 10.0],
        "target.pixels": [128, 128],
    }
    system = small_system(tmp_path, changes)
    monkeypatch.setattr(Blur, "kernel", None)
    limits = blur_limits(system, backend)
    assert limits.least is None
    assert limits.width > 8 * 20.0


def test_in_the_far_field_the_blurred_picture_is_an_intensity(tmp_path, backend):
    """An intensity that is even within +-40 degrees, blurred by 4 as an irradiance."""
    system = small_system(tmp_path, WIDE | {"source.divergence": 4.0})
    limits = blur_limits(system, backend)
    blur = blur_of(system, system.path, backend)
    screen = system.target.screen()
    asked = system.target.irradiance(screen, 1.0)
    blurred = _blurred(blur, asked, screen)
    solid_angles = screen.projection()
    assert np.ptp(asked / solid_angles) < 1e-12 * asked.max()
    assert limits.plain == pytest.approx(rel_l2(blurred / solid_angles, np.ones(asked.shape)), rel=1e-9)
    assert limits.plain != pytest.approx(rel_l2(blurred, asked), rel=1e-2)
    # no light of the model is better: neither the picture, nor what is made to be blurred
    made = blur.onto(screen)(aimed_light(blur, screen, asked)[1])
    assert limits.least < rel_l2(made / solid_angles, np.ones(asked.shape)) < limits.plain


def test_what_is_said_of_the_sun_and_of_a_wide_beam(tmp_path, backend):
    """0.53 degrees at 60 mm are 0.56 mm; a beam of 60 degrees is wider than the target."""
    for degrees, said in ((0.0, "the sun blurs 0.5[67] mm"), (30.0, "the spot is wider than the target")):
        changes = {"source.divergence_profile": "sun", "source.divergence": degrees, "source.distance": 3.0}
        system = small_system(tmp_path, changes, name=f"{degrees}.toml")
        limits = blur_limits(system, backend)
        sentence = blur_sentence(system, limits)
        assert re.search(said, sentence)
        assert limits.least is None or 0 <= limits.least <= limits.plain
