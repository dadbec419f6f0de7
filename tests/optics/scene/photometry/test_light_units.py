"""Units of light: words, and factors that agree with areas and solid angles."""

import numpy as np
import pytest

from optics.scene.photometry import units_of


@pytest.mark.parametrize(
    ("flux", "plane", "far", "name"),
    [("W", "W/m^2", "W/sr", "fates_w"), ("lm", "lx", "cd", "fates_lm")],
)
def test_watts_and_lumens_have_their_own_words(flux, plane, far, name):
    units = units_of(flux)
    assert (units.flux, units.key("fates"), units.luminous) == (flux, name, flux == "lm")
    assert (units.density(False).shown, units.density(True).shown) == (plane, far)
    assert (units.density(False).stored, units.density(True).stored) == (f"{flux}/mm^2", f"{flux}/degree^2")


def test_a_flux_on_a_square_metre_and_in_a_small_square_of_directions():
    """12 W on 1 m^2; and 3 lm in 0.01 x 0.02 rad around the axis, where angles and solid angles agree."""
    assert units_of("W").in_plane.text(12 / 1000**2) == "12 W/m^2"
    stored = 3 / np.prod(np.degrees([0.01, 0.02]))
    assert units_of("lm").in_far_field.factor * stored == pytest.approx(3 / (0.01 * 0.02), rel=1e-14)
