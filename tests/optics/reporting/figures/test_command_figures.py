"""Pictures of a trace: light in the units that people read."""

import numpy as np
import pytest

from optics.light.analysis import Measurement
from optics.reporting.figures import command_figures
from optics.scene.photometry import units_of
from optics.scene.receivers import FarField, Plane, Screen


@pytest.mark.parametrize(
    ("flux", "angular", "label", "factor"),
    [
        ("W", False, "irradiance in W/m^2", 1e6),
        ("lm", False, "illuminance in lx", 1e6),
        ("W", True, "intensity in W/sr", 180**2 / np.pi**2),
        ("lm", True, "intensity in cd", 180**2 / np.pi**2),
    ],
)
def test_a_picture_of_light_has_its_unit_and_its_numbers(monkeypatch, flux, angular, label, factor):
    drawn = {}

    def kept(data, half_width, unit, text, colours, limits):
        drawn.update(data=data, words=(unit, text), limits=limits)
        return b""

    monkeypatch.setattr(command_figures, "plane_figure", kept)
    screen = Screen((20.0, 10.0), (4, 3), receiver=FarField() if angular else Plane())
    image = np.arange(12.0).reshape(3, 4)
    command_figures.irradiance_figure(image, screen, units_of(flux).density(angular))
    np.testing.assert_allclose(drawn["data"], factor * image, rtol=1e-15)
    assert drawn["words"] == ("degrees" if angular else "mm", label)
    assert drawn["limits"] == pytest.approx((0, 11 * factor))


def test_light_that_does_not_arrive_is_drawn_dark():
    light = np.ones((3, 4))
    designed = Measurement(light, light, {"rel_l2": 0.0})
    with np.errstate(invalid="raise"):
        png = command_figures.relit_figure(
            designed, Measurement(0 * light, light, {"rel_l2": 1.0}), Screen((20.0, 10.0), (4, 3)), "sun"
        )
    assert png.startswith(b"\x89PNG")
