"""The picture of a spectrum's light in colour, and its fringe."""

import io
from dataclasses import replace

import numpy as np
from PIL import Image

from optics.analysis import measure
from optics.colour import spectral_lines, white_of
from optics.figures import colour_figures
from optics.problem import load_problem
from optics.system import OpticalSystem
from tests.optics.cases import write_problem

SPECTRAL = {"lens.material": "PC", "source.spectrum": "LED-B3", "target.pixels": [24, 24]}


def measured(folder, backend, changes):
    system = OpticalSystem(load_problem(write_problem(folder, changes, drop=("lens.index",))))
    return system, measure(system, system.lens, backend)


def colours(png):
    return {tuple(p) for p in np.asarray(Image.open(io.BytesIO(png)).convert("RGB")).reshape(-1, 3)}


def test_without_a_spectrum_there_is_no_colour(tmp_path, backend):
    system, measurement = measured(tmp_path, backend, {"lens.material": "PC"})
    assert colour_figures(system, measurement, "mm") == {}


def test_light_as_bright_as_asked_for_is_white(tmp_path, backend):
    """A diagonal of pixels has the colour of the source: the picture is black and white."""
    system, measurement = measured(tmp_path, backend, SPECTRAL)
    white = white_of(spectral_lines("LED-B3"))
    flat = np.multiply.outer(white * measurement.target.max(), np.eye(24))
    figures = colour_figures(system, replace(measurement, colour=flat), "mm")
    assert all(r == g == b for r, g, b in colours(figures["colour"][1]))
    assert (255, 255, 255) in colours(figures["colour"][1])


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
