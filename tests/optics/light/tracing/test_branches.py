"""What light meets first in the closed lens, where its front is rough."""

import numpy as np
import pytest

from optics.light.tracing.branches import FRONT, UNDECIDED, Branches, ClosedLens
from oracles.first_meetings import MEETS, first_meetings
from oracles.rough_fronts import SAME, SOURCES, rough_front
from thbcad import FreeformSurface, Lens


@pytest.mark.parametrize("name", ["point source", "oblique rays"])
def test_with_all_reflections_a_rough_front_is_met_first_where_it_is(backend, name):
    """The walls of the lens stand on the rims: what meets the front meets no other face before."""
    front = rough_front(2.0)
    rays = SOURCES[name](front, 3000, 4)
    solid = ClosedLens(backend, Lens(front, FreeformSurface((5.0, 5.0)), 50.0, 1.5))
    meetings, found = (
        solid.meet(Branches.start(rays)),
        first_meetings(front, rays.origin, rays.direction),
    )
    meets = found.fate == MEETS
    np.testing.assert_array_equal(meetings.face == FRONT, meets)
    assert not (meetings.face == UNDECIDED).any()
    path = ((meetings.point - rays.origin) * rays.direction).sum(axis=0)[meets]
    assert (path >= found.low[meets] - SAME).all()
    assert (path <= found.high[meets] + SAME).all()
