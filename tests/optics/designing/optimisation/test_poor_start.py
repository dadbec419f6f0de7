"""A run whose transport map did not converge starts from the base surface, and says so."""

import numpy as np

from optics.designing.optimisation.first_state import transport_start
from tests.optics.cases import small_system

AXIS = (2 * np.arange(64) + 1) / 64 - 1
RADIUS = np.hypot(AXIS[:, None], AXIS)
RING = np.uint8(255 * (abs(RADIUS - 0.7) < 0.1))
ROOM = {"lens.rear.freeform.z_freedom": 9.0, "lens.thickness": 30.0, "lens.rear.freeform.max_level": 2}


def told(folder, backend):
    """Return the start of a run for a ring on black, and its notes."""
    notes = []
    system = small_system(folder, ROOM, RING)
    return transport_start(system, backend, None, notes.append, None), notes


def test_a_start_that_is_no_better_than_the_base_surface_is_not_taken(tmp_path, backend, monkeypatch):
    """A map without steps sends all light to the nearest lit places."""
    monkeypatch.setattr("optics.designing.transport.back_and_forth.STEPS", 0)
    start, (note,) = told(tmp_path, backend)
    assert start is None
    assert "no better than" in note
    assert note.endswith("; the design starts from the base surface instead")


def test_a_good_start_is_taken_without_a_word(tmp_path, backend):
    start, notes = told(tmp_path, backend)
    assert start is not None
    assert not notes
