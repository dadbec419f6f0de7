"""The design loop repeated, interrupted and taken up again."""

from functools import cache

import numpy as np
import pytest

from optics.designing.optimisation.loop import Listener, shape_lens
from optics.designing.optimisation.stage_plan import stages
from optics.designing.optimisation.stage_search import Interrupted
from optics.light.engines import ExactEngine
from tests.cases import python
from tests.optics.cases import small_system, write_problem
from tests.optics.designing.optimisation.cases import FLAT, check_counts, rows_of, run

ON_ONE_THREAD = """
import sys
from hashlib import sha256
from optics.light.engines import ExactEngine
from optics.base.runtime import load_backend
from optics.designing.optimisation import Listener, shape_lens
from optics.scene.problem import load_problem
from optics.scene.system import System
system, backend, checkpoints = System(load_problem(sys.argv[1])), load_backend("double", 1), []
listener = Listener(checkpoint=checkpoints.append)
whole, _ = shape_lens(system, backend, ExactEngine(backend), listener=listener)
resumed, _ = shape_lens(system, backend, ExactEngine(backend), checkpoints[0])
print(*(sha256(made.sags[0].coefficients.tobytes()).hexdigest() for made in (whole, resumed)))
"""


@cache
def hashes(folder, start, number):
    """Design on one thread in a process of its own; return the hashes of a whole and of a resumed run.

    Processes of their own also show that nothing depends on what ran before, or on where memory lies.
    """
    changes = {"optimizer.start": start, "target.pixels": [32, 32]}
    path = write_problem(folder, changes, name=f"{start}.toml")
    return python(ON_ONE_THREAD, path, check=True).stdout.split()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("repeated")


@pytest.mark.slow
@pytest.mark.parametrize("start", ["flat", "transport"])
def test_the_same_problem_on_one_thread_gives_the_same_bytes(folder, start):
    assert hashes(folder, start, 0) == hashes(folder, start, 1)
    assert hashes(folder, "flat", 0) != hashes(folder, "transport", 0)


@pytest.mark.slow
@pytest.mark.parametrize("start", ["flat", "transport"])
def test_a_run_taken_up_after_a_level_equals_the_run_in_one_go(folder, start):
    """Checkpoints hold everything: on one thread, going on from the first one gives the same bytes."""
    whole, resumed = hashes(folder, start, 0)
    assert whole == resumed


def interrupted_at(done, backend, evaluation):
    """Return the State that a run leaves when Ctrl-C comes right after an evaluation."""

    def stop(plan, stage, dof, row):
        if row and row.evaluation == evaluation:
            raise KeyboardInterrupt

    with pytest.raises((Interrupted, KeyboardInterrupt)) as caught:
        shape_lens(done.system, backend, ExactEngine(backend), listener=Listener(stop))
    assert caught.type is Interrupted, "Ctrl-C left no state"
    return caught.value.state


@pytest.mark.every(3)
@pytest.mark.parametrize("level", [0, 1, 2])
def test_an_interrupted_run_goes_on_to_the_end(small, backend, level):
    evaluation = rows_of(small.state.history, level)[3].evaluation
    state = interrupted_at(small, backend, evaluation)
    assert state.stage == level
    assert state.evaluations == evaluation
    assert state.sags[0].space.dim == state.history[-1].dof
    check_going_on(small, backend, state)


def test_an_interrupted_run_goes_on_after_a_transport_start(moved, backend):
    evaluation = rows_of(moved.state.history, 2)[3].evaluation
    check_going_on(moved, backend, interrupted_at(moved, backend, evaluation))


@pytest.mark.slow
def test_an_interrupted_run_keeps_the_best_surface_not_the_last(tmp_path, backend):
    """Ctrl-C right after a step that made things worse, as line searches take them now and then."""
    system = small_system(tmp_path, FLAT | {"optimizer.iterations": [40]})
    best = {}

    def stop(plan, stage, dof, row):
        if row is None:
            return
        if row.loss > best.setdefault(row.level, row.loss):
            raise KeyboardInterrupt
        best[row.level] = row.loss

    with pytest.raises(Interrupted) as caught:
        shape_lens(system, backend, ExactEngine(backend), listener=Listener(stop))
    state = caught.value.state
    before = len(state.history)
    assert state.history[-1].loss > best[state.stage]  # of a flat start, whose stages are the levels
    _, final = shape_lens(system, backend, ExactEngine(backend), state)
    assert final.history[before].loss == pytest.approx(best[state.stage], rel=1e-11)


@pytest.mark.every(2)
@pytest.mark.parametrize("row", [0, 1])
def test_ctrl_c_at_any_evaluation_leaves_a_state(either, backend, row):
    """Also while a level is only marked, not optimised."""
    evaluation = either.state.history[row].evaluation
    state = interrupted_at(either, backend, evaluation)
    assert len(state.history) == row + 1
    shaped, _ = shape_lens(either.system, backend, ExactEngine(backend), state)
    lens = shaped.designed
    assert lens.rear.sag.space.levels == 3


@pytest.mark.parametrize("told", ["progress", "seen", "checkpoint"])
def test_ctrl_c_between_the_steps_of_a_level_keeps_what_was_reached(small, backend, told):
    """Before its first evaluation, behind its last one, and while its state is kept."""

    def stop(*values):
        if told != "progress" or values[1].level == 1:
            raise KeyboardInterrupt

    with pytest.raises(Interrupted) as caught:
        shape_lens(small.system, backend, ExactEngine(backend), listener=Listener(**{told: stop}))
    state = caught.value.state
    first = rows_of(small.state.history, 0)
    assert [row.loss for row in state.history] == [row.loss for row in first]
    assert state.stage == {"progress": 1, "seen": 0, "checkpoint": 1}[told]


def check_going_on(done, backend, state):
    """Go on from an interrupted state and compare with what an interrupted run promises."""
    before = state.history
    best = min(row.loss for row in rows_of(before, done.plan[state.stage].level))
    shaped, final = shape_lens(done.system, backend, ExactEngine(backend), state)
    lens = shaped.designed
    assert check_counts(final.history) > check_counts(before)
    assert final.history[: len(before)] == before
    # it goes on from the best surface so far
    assert final.history[len(before)].loss == pytest.approx(best, rel=1e-11)
    assert final.stage == done.state.stage
    assert lens.rear.sag.space.levels == 3
    assert final.history[-1].seconds >= before[-1].seconds
    assert min(row.loss for row in rows_of(final.history, 2)) < 2 * min(
        row.loss for row in rows_of(done.state.history, 2)
    )


def test_a_run_taken_up_after_its_last_level_keeps_the_designed_surface(either, backend):
    """Ctrl-C while the result is measured or drawn: the checkpoint says that every level is done."""
    check_that_all_is_done(either, backend)


def check_that_all_is_done(made, backend):
    """The last checkpoint holds the designed surface, from which nothing is optimised any more."""
    shaped, state = shape_lens(made.system, backend, ExactEngine(backend), made.checkpoints[-1])
    lens = shaped.designed
    x = np.linspace(-10, 10, 31)
    np.testing.assert_allclose(lens.rear.grid(x, x), made.lens.rear.grid(x, x), rtol=0, atol=1e-12)
    assert len(state.history) == len(made.state.history)


@pytest.mark.parametrize("start", ["flat", "transport"])
def test_levels_without_marked_cells_are_optimised_and_resumed_alike(tmp_path, backend, start):
    """A threshold that nothing passes: the mesh stays, the surface improves all the same, and the last
    checkpoint holds it."""
    made = run(tmp_path, backend, {"optimizer.start": start, "refinement.alpha": [1e9]})
    assert made.lens.rear.sag.space.levels == 1 + stages(made.system, start == "transport")[0].level
    assert min(row.loss for row in made.state.history) < made.state.history[0].loss
    check_that_all_is_done(made, backend)
