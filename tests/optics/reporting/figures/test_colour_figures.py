"""The picture of a spectrum's light in colour, and its fringe."""

import io
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from optics.light.analysis import measure
from optics.reporting.figures.lens_and_light import colour_figures
from optics.scene.photometry import spectral_lines, white_of
from tests.optics.cases import small_system
from tests.optics.reporting.cases import pixels

SPECTRAL = {"lens.material": "PC", "source.spectrum": "LED-B3", "target.pixels": [24, 24]}


def measured(folder, backend, changes):
    system = small_system(folder, changes, drop=("lens.index",))
    return system, measure(system, backend)


def colours(png):
    return {tuple(p) for p in pixels(png).reshape(-1, 3)}


def test_without_a_spectrum_there_is_no_colour(tmp_path, backend):
    system, measurement = measured(tmp_path, backend, {"lens.material": "PC"})
    assert colour_figures(system, measurement, "mm") == {}


def test_invisible_light_has_no_colour_but_a_shift(tmp_path, backend):
    infrared = {
        "lens.indices": [[550.0, 1.51], [900.0, 1.5], [1000.0, 1.49]],
        "source.spectrum": [[900.0, 1.0], [1000.0, 1.0]],
        "target.pixels": [24, 24],
    }
    system, measurement = measured(tmp_path, backend, infrared)
    assert colour_figures(system, measurement, "mm") == {}
    found = measurement.metrics["colour"]
    assert (found["from_nm"], found["to_nm"], found["fringe"]) == (900.0, 1000.0, None)
    assert found["shift"] > 0


@pytest.mark.slow
@pytest.mark.parametrize("unit", ["W", "lm"])
def test_light_half_as_bright_as_asked_for_is_half_of_white(tmp_path, backend, unit):
    """A diagonal of pixels has the colour of the source: the picture is black and grey.

    The colour of lumens has Y = 1, that of watts what the spectrum has.
    """
    system, measurement = measured(tmp_path, backend, SPECTRAL | {"source.unit": unit})
    white = white_of(spectral_lines("LED-B3"))
    white = white / white[1] if unit == "lm" else white
    flat = np.multiply.outer(0.5 * white * measurement.target.max(), np.eye(24))
    _, png = colour_figures(system, replace(measurement, colour=flat), "mm")["colour"]
    assert all(r == g == b for r, g, b in colours(png))
    grey = np.asarray(Image.open(io.BytesIO(png)).convert("L")).astype(int)
    assert (abs(grey - 188) <= 1).mean() > 0.01  # sRGB of 0.5; text has some pixels of every grey


@pytest.mark.slow
def test_a_red_pixel_is_red(tmp_path, backend):
    system, measurement = measured(tmp_path, backend, SPECTRAL)
    (red,) = spectral_lines(((640.0, 1.0),))
    lit = np.multiply.outer(np.array(red.xyz) * measurement.target.max(), np.ones((24, 24)))
    figures = colour_figures(system, replace(measurement, colour=lit), "mm")
    assert any(r > 200 and max(g, b) < 100 for r, g, b in colours(figures["colour"][1]))


def test_captions_tell_the_shift(tmp_path, backend):
    system, measurement = measured(tmp_path, backend, SPECTRAL)
    caption, _ = colour_figures(system, measurement, "mm")["fringe"]
    shift = measurement.metrics["colour"]["shift"]
    assert f"lands {shift:.3g} mm" in caption
    assert "at 450 and 650 nm" in caption


def test_dark_light_has_figures_too(tmp_path, backend):
    system, measurement = measured(tmp_path, backend, SPECTRAL)
    assert set(colour_figures(system, replace(measurement, colour=np.zeros((3, 24, 24))), "mm")) == {
        "colour",
        "fringe",
    }
