"""The flux that a design asks for: that of the unoptimised lens, or less where less can arrive."""

import pytest

from optics.designing.optimisation.loop import Listener, shape_lens, transmitted_flux
from optics.designing.optimisation.state import State, first_sags
from optics.designing.starts import TransportStart
from optics.light.engines import ExactEngine
from tests.optics.cases import WIDE, small_system

FLAT_REAR = {"lens.rear.radius": float("inf"), "lens.rear.conic": 0.0, "lens.rear.freeform.z_freedom": 20.0}
FAR = WIDE | FLAT_REAR | {"target.half_width": [35.0, 35.0]}


@pytest.mark.every(3)
@pytest.mark.parametrize(
    ("changes", "mapped"), [(FAR, True), (FAR, False), ({}, True)], ids=["map", "no map", "near"]
)
def test_a_map_asks_for_what_can_arrive_where_its_surface_reflects_much(tmp_path, backend, changes, mapped):
    """Designs from the same surface, with a map to follow or without: up to 48 degrees aside much is
    reflected, before a near target hardly more than by the unoptimised lens."""
    system, seen = small_system(tmp_path, changes | {"optimizer.iterations": [1]}), []
    start = TransportStart(system, backend)
    state = State(mapped, 0, (start.fit(first_sags(system, mapped)[-1].space).sag,))
    sent = transmitted_flux(system.with_sags(state.sags), backend)
    whole = transmitted_flux(system, backend)
    listener = Listener(seen=lambda *told: seen.append(told))
    shape_lens(system, backend, ExactEngine(backend), state, start, listener)
    stage, _, target = seen[0]
    asked = float(target.sum()) * stage.screen.pixel_area
    less = mapped and changes == FAR
    assert asked == pytest.approx(sent if less else whole, rel=1e-9)
    assert (sent < 0.95 * whole) == (changes == FAR)
