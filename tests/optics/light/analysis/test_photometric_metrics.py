"""Peaks, beams, means and uniformity of light whose closed form is known, in watts and in lumens."""

import re
from math import cos, pi, radians

import numpy as np
import pytest

from optics.light.analysis import measure, photometric_lines
from optics.scene.photometry import units_of
from optics.scene.problem import load_problem
from optics.scene.system import solvable_system
from tests.cases import EXAMPLES
from tests.optics.cases import small_system
from tests.optics.light.analysis.cases import through_plate

PLATE = {"lens.rear.radius": np.inf, "source.flux": 500.0}
SQUARE = PLATE | {  # parallel light behind a plane plate: as wide as the beam, and even
    "target.kind": "tophat",
    "target.half_width": [19.0, 19.0],
    "target.lit": [0.52, 0.52],  # pixels at its rim, which no light meets, are lit in part
    "target.pixels": [40, 40],
}
CONE = PLATE | {
    "source.kind": "point",
    "source.distance": 10.0,
    "source.half_angle": 20.0,
    "target.kind": "function",
    "target.formula": "r < 0.6",
    "target.distance": np.inf,
    "target.half_width": [25.0, 25.0],
    "target.pixels": [101, 101],
}
ON_AXIS = 0.96**2  # of the light passes both faces
WORST = 3e-3  # error of the worst of 2773 pixels: the cone's cells have folds along the diagonals


@pytest.fixture
def metrics(tmp_path, backend):
    """A function from changes of the problem to the metrics of its unoptimised lens."""

    def made(changes):
        system = small_system(tmp_path, changes)
        return measure(system, backend).metrics

    return made


@pytest.mark.slow
def test_an_isotropic_point_behind_a_window_has_the_intensity_of_its_cone(metrics):
    """500 lm in a cone of 20 degrees are 500 / (2 pi (1 - cos 20)) cd, less Fresnel's losses."""
    intensity = 500 / (2 * pi * (1 - cos(radians(20))))
    found = metrics(CONE | {"source.unit": "lm"})
    beam, even = found["beam"], found["uniformity"]
    assert even["lit_mean_cd"] == pytest.approx(ON_AXIS * intensity, rel=3e-4)  # 4e-4 less at the rim
    assert beam["peak_cd"] == pytest.approx(ON_AXIS * intensity, rel=WORST)
    assert beam["peak_cd_per_klm"] == pytest.approx(2 * beam["peak_cd"], rel=1e-14)
    for angle in ("beam_angle_c0", "beam_angle_c90", "field_angle_c0", "field_angle_c90"):
        assert beam[angle] == pytest.approx(40, abs=50 / 101)  # a pixel
    darkest = through_plate(radians(15.0)) / ON_AXIS  # at the rim of the lit disk, 0.9996
    assert even["min_over_max"] == pytest.approx(darkest, abs=2 * WORST)
    assert even["noise"] < WORST / 5  # the greatest of all boxes
    assert even["box_degrees"] == pytest.approx([30 / 21] * 2)  # the disk is 30 degrees wide
    assert "target_mean_lx" not in found


def test_parallel_light_behind_a_window_has_its_illuminance(metrics):
    """500 lm on a beam of 19 mm x 19 mm, lit in the middle of a target of 38 mm x 38 mm."""
    found = metrics(SQUARE | {"source.unit": "lm"})
    lux = 500 * ON_AXIS / 0.019**2
    even = found["uniformity"]
    assert even["lit_mean_lx"] == pytest.approx(lux, rel=1e-9)
    assert found["target_mean_lx"] == pytest.approx(lux / 4, rel=1e-9)
    assert (even["min_over_mean"], even["min_over_max"]) == pytest.approx((1, 1), abs=1e-9)
    assert even["boxes"] == 19 * 19
    assert even["box_mm"] == pytest.approx([38 * 0.52 / 21] * 2)
    assert "beam" not in found


@pytest.mark.slow
@pytest.mark.parametrize("case", [SQUARE, CONE], ids=["plane", "far field"])
def test_the_unit_changes_names_and_no_number(metrics, case):
    watts, lumens = metrics(case), metrics(case | {"source.unit": "lm"})
    renamed = {
        "fates_lm": "fates_w",
        **{f"{name}_lm": f"{name}_w" for name in ("lit", "lit_direct", "target")},
        "target_mean_lx": "target_mean_w_m2",
        "lit_mean_lx": "lit_mean_w_m2",
        "lit_mean_cd": "lit_mean_w_sr",
        "peak_cd": "peak_w_sr",
    }

    def in_watts(group):
        return {
            renamed.get(name, name): in_watts(value) if isinstance(value, dict) else value
            for name, value in group.items()
            if name != "peak_cd_per_klm"
        }

    assert in_watts(lumens) == watts
    assert list(map(str, watts)) == [renamed.get(name, name) for name in lumens]


def test_a_picture_has_a_mean_and_no_uniformity(metrics):
    found = metrics(PLATE)
    assert found["target_mean_w_m2"] == pytest.approx(500 * ON_AXIS / 0.04**2, rel=1e-9)
    assert "uniformity" not in found
    assert photometric_lines(found, units_of("W")) == []


def test_sentences_name_units_and_boxes(metrics):
    beam, even = photometric_lines(metrics(CONE | {"source.unit": "lm"}), units_of("lm"))
    assert re.match(r"peak intensity 12\d\d cd \(24\d\d cd/klm\); beam angle 40 degrees in C0-C180, ", beam)
    assert "in C90-C270; field angle" in beam
    assert even.startswith("uniformity U0 = I_min/I_mean 1.000, I_min/I_max ")
    assert " boxes of 1.43 x 1.43 degrees" in even
    assert even.endswith(" degrees wide")
    assert re.search(r"; mean 12\d\d cd; edge from 90 to 10 % ", even)
    (plane,) = photometric_lines(metrics(SQUARE), units_of("W"))
    assert plane.startswith(
        "uniformity U0 = E_min/E_mean 1.000, E_min/E_max 1.000, rsd 0.000 on 361 boxes of "
    )
    assert "; mean 1.276e+06 W/m^2; edge" in plane


@pytest.mark.slow
def test_a_beam_that_fills_the_target_has_no_angle(metrics):
    found = metrics(CONE | {"target.half_width": [15.0, 15.0]})
    assert found["beam"]["beam_angle_c0"] is None
    pixel = 30 / 101
    assert found["beam"]["beam_angle_c0_at_least"] == pytest.approx(30 - pixel)  # between pixel centres
    assert "beam angle beyond the target" in photometric_lines(found, units_of("W"))[0]


def test_the_mean_on_a_sphere_is_flux_over_area(backend):
    """A point in the middle of a sphere lights it evenly; chart pixels far from its equator are small."""
    problem = load_problem(
        EXAMPLES / "wall_washer.toml",
        {"target.surface": "sphere", "target.radius": -1600.0, "target.half_width": (1500.0, 2000.0)}
        | {"target.tilt": (0.0, 0.0, 0.0), "target.pixels": (48, 64), "lens.rear.radius": -52.0}
        | {"lens.rear.freeform.z_freedom": 6.0},
    )
    system = solvable_system(problem)
    found = measure(system, backend).metrics
    area = 2 * 1500.0 * 2 * 1600.0 * np.sin(2000 / 1600.0)  # mm^2
    flux = found["efficiency"] * system.problem.flux
    assert found["target_mean_w_m2"] == pytest.approx(1e6 * flux / area, rel=1e-3)


def test_light_that_lights_every_pixel_is_all_on_the_lit_region(tmp_path, backend):
    """Every pixel is lit, so that both efficiencies are one."""
    rough = {"lens.rear.slope_rms": 0.02, "target.kind": "tophat", "target.lit": (1.0, 1.0)}
    system = small_system(tmp_path, rough | {"target.half_width": (90.0, 90.0)})
    found = measure(system, backend).metrics
    assert found["lit_efficiency"] == pytest.approx(found["efficiency"], rel=1e-12)
