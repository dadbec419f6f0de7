"""Nothing is predicted from a transport start that a design does not take."""

from dataclasses import replace

import numpy as np
import pytest

from optics.designing.optimisation import StartChoice, first_fit
from optics.designing.prediction import expectation_lines, expected, foreseen_misses
from optics.designing.starts import TransportStart, start_quality
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
    assert found.volume == system.base.volume()
    assert f"this design may miss its limit: {found.doubt}" in foreseen_misses(system, found, None, backend)
    assert not found.from_transport
    assert plan[0].level == 0
    lines = expectation_lines(system, found)
    assert any(
        line.startswith("rel_l2: not predicted, since the transport start has rel_l2") for line in lines
    )


@pytest.mark.usefixtures("coarse_concentration")
@pytest.mark.parametrize("sun", [False, True])
def test_a_check_and_a_design_decide_alike_on_a_start(tmp_path, backend, monkeypatch, sun):
    """A design shapes the sharp light of a blurred system."""
    monkeypatch.setattr("optics.designing.transport.back_and_forth.STEPS", 0)
    changes = ROOM | ({"source.divergence_profile": "sun", "source.divergence": 0.02} if sun else {})
    system = small_system(tmp_path, changes, RING)
    found, _ = expected(system, backend)
    choice = StartChoice(system.shaping, backend, TransportStart(system.shaping, backend))
    assert choice.useless
    assert not found.from_transport


def test_a_stop_makes_no_start_useless(tmp_path, backend):
    """It stands before the target, where the map's light is narrow and that of the base surface is wide."""
    ring = {"shape": "ring", "half_width": [40.0, 40.0], "inner": [9.0, 9.0], "position": [0.0, 0.0, 55.0]}
    open_, stopped = (
        StartChoice(system, backend, TransportStart(system, backend))
        for system in (small_system(tmp_path, ROOM | more, RING) for more in ({}, {"stop": [ring]}))
    )
    assert stopped.quality == open_.quality
    assert not stopped.useless


def test_a_finest_fit_that_is_scaled_down_judges_no_start(tmp_path, backend, monkeypatch):
    monkeypatch.setattr("optics.designing.transport.back_and_forth.STEPS", 0)
    system = small_system(tmp_path, ROOM, RING)
    start = TransportStart(system, backend)
    first, finest = first_fit(system, start), start.finest_fit()
    scaled = replace(finest, crosses=True)
    monkeypatch.setattr(start, "finest_fit", lambda: scaled)
    assert StartChoice(system, backend, start).quality == start_quality(system, backend, first)
