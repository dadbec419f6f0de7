"""Stops in pictures."""

import numpy as np
import pytest

from optics.reporting.view import stop_rims
from optics.scene.problem import Problem
from optics.scene.system import solvable_system


def test_rims_lie_in_the_plane_of_their_stop_and_run_round_it_in_turn():
    size = {"half_width": (10, 10)}
    ring = {
        "shape": "ring",
        "half_width": (4, 3),
        "inner": (2, 1),
        "position": (1, 2, 30),
        "tilt": (40, 0, 10),
    }
    problem = Problem(
        source={"kind": "collimated", "half_width": (8, 8)},
        lens={"index": 1.5, "thickness": 6, "front": size, "rear": size},
        target={"kind": "tophat", "distance": 60, "half_width": (12, 12), "pixels": (16, 16)},
        stop=[{**ring, "tilt": (40, 0, 10), "hole": hole} for hole in (False, True)],
    )
    system = solvable_system(problem)
    obstacle, slit = stop_rims(system, system.lens)
    assert [len(obstacle), len(slit)] == [2, 3]
    back = system.stops[0].pose.inverse()
    areas = []
    for rim in (*obstacle, *slit):
        x, y, z = back.points(rim)
        np.testing.assert_allclose(z, 0, atol=1e-13)
        areas.append((x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2)
    wanted = np.pi * np.array([12, -2, 0, -12, 2])
    wanted[2] = 4 * 12.5**2
    assert areas == pytest.approx(wanted, rel=(2 * np.pi / 64) ** 2 / 6 * 1.01)  # of 64 chords
