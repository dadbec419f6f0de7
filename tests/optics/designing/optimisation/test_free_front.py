"""Lenses whose front alone is free, before a rear that is a conic."""

import numpy as np
import pytest

import optics
from optics.base.runtime import UserError
from optics.designing.optimisation.state import earlier_state
from optics.designing.starts import TransportStart
from optics.light.analysis import measure
from optics.scene.system import System
from tests.cases import slow_unless
from tests.optics.cases import front_problem, rough, small_system
from thbcad.surfaces import THBSurface

REARS = {
    "plane": {"lens.rear.radius": float("inf"), "lens.rear.conic": 0.0},
    "sphere": {"lens.rear.radius": -60.0, "lens.rear.conic": 0.0, "lens.rear.half_width": [14.0, 14.0]},
}
SOURCES = {
    "parallel": {},
    "point": {"source.kind": "point", "source.distance": 30.0, "source.half_angle": 17.0},
}


@pytest.mark.every(2)
@pytest.mark.parametrize("window", ["cells", "pixel"])
@pytest.mark.parametrize("rear", REARS.values(), ids=REARS)
def test_gradient_is_that_of_the_loss(tmp_path, rear, window):
    """Central differences with h = 1e-6 mm err by h^2 and by the loss's rounding over h: 1e-9 here."""
    system = optics.System(front_problem(tmp_path, rear))
    space = system.space(level=1)
    model = system.model(space, rays=(65, 65), window=window)
    at = system.transport_start(space).coefficients + rough(space, 0.003)
    _, gradient = model.loss(at)
    along = gradient / np.linalg.norm(gradient)
    ahead, behind = (model.loss(at + step * along)[0] for step in (1e-6, -1e-6))
    assert (ahead - behind) / 2e-6 == pytest.approx(gradient @ along, rel=1e-8)


@pytest.mark.parametrize("source", slow_unless(lambda name: name == "parallel", SOURCES))
@pytest.mark.parametrize("rear", slow_unless(lambda name: name == "sphere", REARS))
def test_the_transport_map_shapes_the_front(tmp_path, backend, rear, source):
    """The light of the start alone is the picture but for its edges, as that of a free rear (0.07 to 0.1).

    By front and rear: what a bent front sends into the lens's edges is no matter of the start.
    """
    system = System(front_problem(tmp_path, REARS[rear] | SOURCES[source]))
    start = TransportStart(system, backend)
    fit = start.fit(system.base.sags[0].space.uniform(2))
    lens = system.base.with_sags([fit.sag])
    assert start.within(fit)
    assert start.bent > 0.99
    assert measure(system.with_lens(lens), backend).metrics["rel_l2_sequential"] < 0.12


def test_a_design_goes_on_from_another_front(tmp_path):
    """From a lens of the same front; a free rear has no place in it."""
    system = System(front_problem(tmp_path))
    space = system.base.sags[0].space
    earlier = system.base.with_sags([THBSurface(space, rough(space, 0.1))])
    (sag,) = earlier_state(system, earlier).sags
    np.testing.assert_array_equal(sag.coefficients, earlier.front.sag.coefficients)
    free_rear = small_system(tmp_path).base
    with pytest.raises(UserError, match="the rear surface of the earlier design differs"):
        earlier_state(system, free_rear)
