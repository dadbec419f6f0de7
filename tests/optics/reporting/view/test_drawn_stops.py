"""Stops in pictures."""

import numpy as np
import pytest

from optics.reporting.view import stop_rims
from optics.scene.system import solvable_system
from tests.optics.cases import flat_problem


def test_rims_lie_in_the_plane_of_their_stop_and_run_round_it_in_turn():
    ring = {
        "shape": "ring",
        "half_width": (4, 3),
        "inner": (2, 1),
        "position": (1, 2, 30),
        "tilt": (40, 0, 10),
    }
    stops = [{**ring, "hole": hole} for hole in (False, True)]
    system = solvable_system(flat_problem({"kind": "collimated", "half_width": (8, 8)}, stop=stops))
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
