"""Nothing is predicted from a transport start that a design does not take."""

import numpy as np
import pytest

from optics.designing.prediction import expectation_lines, expected
from tests.optics.cases import small_system

AXIS = (2 * np.arange(64) + 1) / 64 - 1
RING = np.uint8(255 * (abs(np.hypot(AXIS[:, None], AXIS) - 0.7) < 0.1))
ROOM = {"lens.rear.freeform.z_freedom": 9.0, "lens.thickness": 30.0, "lens.rear.freeform.max_level": 2}


@pytest.mark.usefixtures("coarse_concentration")
def test_nothing_is_predicted_from_a_start_that_is_not_taken(tmp_path, backend, monkeypatch):
    monkeypatch.setattr("optics.designing.transport.back_and_forth.STEPS", 0)
    system = small_system(tmp_path, ROOM, RING)
    found, plan = expected(system, backend)
    assert found.rel_l2 is None
    assert not found.from_transport
    assert plan[0].level == 0
    lines = expectation_lines(system, found)
    assert any(
        line.startswith("rel_l2: not predicted, since the transport start has rel_l2") for line in lines
    )
