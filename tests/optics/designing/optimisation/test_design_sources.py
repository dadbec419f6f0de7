"""The design loop for sources with extent, points, free fronts and far fields."""

import numpy as np
import pytest

from optics.base.runtime import UserError
from optics.designing.optimisation.state import earlier_state
from tests.optics.cases import HOLLOW, small_system
from tests.optics.designing.optimisation.cases import rows_of, run

LAMBERTIAN = {"source.kind": "lambertian", "source.half_width": [0.5, 0.5], "source.half_angle": 45.0}
POINT = {"source.kind": "point", "source.half_angle": 45.0, "source.exponent": 1.0}
FREE = {"spans": [3, 5], "max_level": 1, "z_freedom": 0.4}
FREE_FRONT = {"lens.front.freeform": FREE}
FAR = {"target.distance": np.inf, "target.half_width": [25.0, 25.0]}
KINDS = {
    "lambertian": LAMBERTIAN,
    "point": POINT,
    "free front": FREE_FRONT,
    "far field": FAR,
    "lambertian, far field": LAMBERTIAN | FAR,
    "point, free front": POINT | FREE_FRONT,
    "lambertian, free front, far field": LAMBERTIAN | FREE_FRONT | FAR,
}


@pytest.mark.every(2)
@pytest.mark.parametrize("start", ["flat", "transport"])
@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_problem_gets_better(tmp_path, backend, start, kind):
    """Flat: every level is optimised, each from the surfaces of the one before.  Transport: the last level
    is."""
    smaller = {
        "target.pixels": [32, 32],
        "optimizer.rays_per_pixel": 2.0,
        "lens.thickness": 10.0,
        "optimizer.start": start,
    }
    made = run(tmp_path, backend, smaller | {"lens.rear.freeform.z_freedom": 4.0} | KINDS[kind])
    first, last = made.state.history[0], rows_of(made.state.history, 2)
    if start == "flat":
        assert [(stage.level, stage.iterations) for stage in made.plan] == [(0, 6), (1, 6), (2, 6)]
        assert min(r.loss for r in last) < 0.7 * first.loss
    assert min(r.loss for r in last) < last[0].loss
    assert made.state.history[-1].dof == sum(sag.space.dim for sag in made.lens.sags)


@pytest.fixture(scope="module")
def twofold(tmp_path_factory, backend):
    """The small problem with both surfaces free, designed."""
    return run(
        tmp_path_factory.mktemp("twofold"),
        backend,
        FREE_FRONT | {"optimizer.start": "flat", "optimizer.rays_per_pixel": 2.0},
    )


def test_both_surfaces_are_shaped_each_within_its_own_settings(twofold):
    front, rear = twofold.lens.sags
    assert front.space.levels == 2  # its max_level is 1, that of the rear 2
    assert rear.space.levels == 3
    assert 1e-3 < np.abs(front.coefficients).max() <= 0.4
    assert 1e-3 < np.abs(rear.coefficients).max() <= 1.0
    assert rows_of(twofold.state.history, 0)[0].dof == 6 * 8 + 7 * 7
    assert twofold.state.history[-1].dof == front.space.dim + rear.space.dim


GLOWING = HOLLOW | {
    "source.kind": "lambertian",
    "source.half_width": [0.5, 0.5],
    "target.kind": "tophat",
    "target.half_width": [2000.0, 2000.0],
    "lens.rear.freeform.max_level": 1,
    "optimizer.start": "flat",
    "optimizer.window": "bspline",
    "optimizer.lost_flux_weight": 0.0,
    "optimizer.iterations": [25],
}


@pytest.mark.slow
def test_two_surfaces_do_better_than_one(tmp_path, backend):
    """The lens of Table 6.3: the dome around the source directs light that the rear alone cannot."""
    free = {"lens.front.freeform": {"spans": [2, 2], "max_level": 1, "z_freedom": 0.5}}
    one, both = (run(tmp_path, backend, GLOWING | more).state.history for more in ({}, free))
    assert min(row.loss for row in rows_of(both, 1)) < 0.7 * min(row.loss for row in rows_of(one, 1))


@pytest.fixture(scope="module")
def alone(tmp_path_factory, backend):
    """The same problem with a free rear only."""
    return run(
        tmp_path_factory.mktemp("alone"),
        backend,
        {"optimizer.start": "flat", "optimizer.rays_per_pixel": 2.0},
    )


def test_an_earlier_design_gives_its_sags(twofold, alone, tmp_path):
    """A front that was not free starts from zero; one that is no longer free is refused."""
    state = earlier_state(twofold.system, twofold.lens)
    assert state.sags == twofold.lens.sags
    assert (state.started_from_transport, state.stage) == (False, 2)
    wide = small_system(tmp_path, FREE_FRONT)
    state = earlier_state(wide, alone.lens)
    assert not state.sags[0].coefficients.any()
    assert state.sags[1] is alone.lens.rear.sag
    with pytest.raises(
        UserError, match=r"the front surface of the earlier design differs .* make lens\.front equal"
    ):
        earlier_state(alone.system, twofold.lens)
    other = small_system(tmp_path, {"lens.front.freeform": FREE | {"spans": [3, 4]}})
    with pytest.raises(UserError, match=r"the front surface of the earlier design differs"):
        earlier_state(other, twofold.lens)
