"""What a blur leaves of a picture: spots narrower than a pixel against a closed form."""

import numpy as np
import pytest

from optics.blur import Blur, LandingShifts
from optics.prediction.blurred_picture import _blurred
from optics.sources import Divergence
from optics.target import Screen


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
