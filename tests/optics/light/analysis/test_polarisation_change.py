"""How much light polarisation adds to the target, and what is said of it."""

import numpy as np
import pytest

from optics.light.analysis import measure, polarisation_change, polarisation_note
from optics.light.tracing import transmittances
from optics.scene.problem import load_problem
from optics.scene.system import System
from tests.optics.cases import small_system

PLATE = """
title = "a plate in an oblique beam"
source = { kind = "collimated", half_width = [0.5, 0.5], position = [-20, 0, -10], tilt = [0, 65, 0] }

[lens]
index = 1.5
thickness = 1.0
front = { half_width = [20.0, 20.0] }
rear = { half_width = [20.0, 20.0], freeform = { spans = [2, 2], max_level = 0, z_freedom = 1.0 } }

[target]
kind = "tophat"
distance = 12.0
half_width = [40.0, 40.0]
pixels = [16, 16]
"""


def test_a_plate_at_65_degrees_passes_more_than_the_means_of_s_and_p_say(tmp_path, backend):
    file = tmp_path / "plate.toml"
    file.write_text(PLATE)
    system = System(load_problem(file))
    metrics = measure(system, backend).metrics
    t_s, t_p = (t[0] for t in transmittances(1.0, 1.5, np.radians(65.0)))
    right, mean = (t_s**2 + t_p**2) / 2, ((t_s + t_p) / 2) ** 2
    assert metrics["fates_w"]["on_target"] == pytest.approx(right, rel=1e-9)
    assert metrics["polarisation_change"] == pytest.approx(right / mean - 1, rel=1e-9)
    assert sum(metrics["fates_w"].values()) == pytest.approx(1.0, rel=1e-12)
    (sentence,) = polarisation_note(metrics)
    assert "1.50% more of it reaches the target" in sentence


def test_parallel_light_through_a_plane_front_says_nothing(tmp_path, backend):
    system = small_system(tmp_path, {"source.kind": "collimated"})
    assert polarisation_change(system, system.path, backend) == {}
    assert polarisation_note({}) == []


def test_changes_of_a_thousandth_are_not_worth_a_note():
    assert polarisation_note({"polarisation_change": 0.001}) == []
    (sentence,) = polarisation_note({"polarisation_change": -0.0023})
    assert "0.23% less" in sentence
