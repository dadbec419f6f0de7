"""A whole design in a named material, measured in white light: saved, read back, run again."""

import json

import numpy as np
import pytest

import optics
from optics.scene.problem import load_problem
from tests.optics.cases import assert_gradient_of_loss, write_problem

WHITE = {
    "target.kind": "tophat",
    "optimizer.iterations": [4],
    "lens.rear.freeform.max_level": 1,
    "lens.material": "N-BK7",
    "lens.absorption": "auto",
    "source.spectrum": "LED-B3",
    "target.pixels": [16, 16],
}


@pytest.mark.parametrize("window", ["cells", "pixel"])
def test_gradient_with_absorption_is_that_of_the_loss(tmp_path, window):
    system = optics.System(load_problem(write_problem(tmp_path, {"lens.absorption": 0.02})))
    assert_gradient_of_loss(system, (97, 97), window)


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """(Design, the folder that it was saved to)."""
    folder = tmp_path_factory.mktemp("white")
    design = optics.design(load_problem(write_problem(folder, WHITE, drop=("lens.index",))))
    return design, design.save(folder / "result")


@pytest.mark.slow
def test_the_result_holds_numbers_for_what_the_material_told(done):
    design, folder = done
    lens = load_problem(folder / "problem.toml").lens
    assert (lens.index, lens.density) == (1.518522, 2.51)
    assert design.lens.index == lens.index
    assert lens.absorption == pytest.approx(1.653e-4)
    assert (
        len(lens.absorptions) == 10 + 1 + 21
    )  # lines, the wavelength of the design, and 380, 400 ... 780 nm
    assert design.asked.lens.index == "auto"


@pytest.mark.slow
def test_the_folder_holds_the_light_in_colour(done):
    design, folder = done
    with np.load(folder / "irradiance.npz") as arrays:
        assert arrays["xyz"].tobytes() == design.measurement.colour.tobytes()
    assert {p.name for p in (folder / "figures").iterdir()} >= {"colour.png", "fringe.png"}
    metrics = json.loads((folder / "metrics.json").read_text())
    assert metrics["colour"]["shift_pixels"] > 0
    assert metrics["rel_l2_design_wavelength"] < metrics["rel_l2"]
    assert 0 < metrics["fates_w"]["absorbed"] < 2e-3
    report = (folder / "report.html").read_text()
    assert "Colour fringe" in report
    assert "is absorbed in the lens" in report


@pytest.mark.slow
def test_a_loaded_design_has_its_colours(done):
    design, folder = done
    loaded = optics.Design.load(folder)
    assert loaded.measurement.colour.tobytes() == design.measurement.colour.tobytes()
    assert loaded.metrics["colour"] == design.metrics["colour"]


@pytest.mark.slow
def test_the_resolved_problem_is_measured_alike(done):
    design, folder = done
    again = optics.System(load_problem(folder / "problem.toml")).measure(design.lens)
    assert again.irradiance.tobytes() == design.measurement.irradiance.tobytes()
    assert again.metrics == {name: design.measurement.metrics[name] for name in again.metrics}


def test_light_in_the_far_field_is_per_steradian_in_all_pictures(tmp_path):
    problem = load_problem(write_problem(tmp_path, WHITE, drop=("lens.index",))).with_(
        **{"target.distance": np.inf, "target.half_width": (15.0, 15.0)}
    )
    system = optics.System(problem)
    found = system.measure(system.base)
    lit = found.irradiance > 0.01 * found.irradiance.max()
    efficacy = found.colour[1][lit].sum() / found.irradiance[lit].sum()
    assert 0.3 < efficacy < 0.6  # V of the lamp, 317 / 683 lm/W, in one unit with the irradiance
