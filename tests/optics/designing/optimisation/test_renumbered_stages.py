"""A state in the plan of a run with other iterations: its stages keep their names."""

import pytest

from optics.designing.optimisation import Row, State, stages
from optics.scene.system import System
from tests.optics.cases import small_system


def of_iterations(folder, count: int) -> System:
    return small_system(folder, {"optimizer.iterations": [count], "optimizer.start": "transport"})


def names(system: System, state: State) -> list[str]:
    plan = stages(system, state.started_from_transport)
    return [plan[row.stage].name if row.stage < len(plan) else "end" for row in state.history]


@pytest.mark.parametrize("few", [1, 9])
def test_steps_on_fewer_cells_that_a_short_run_lacks_count_as_those_of_the_stage_behind_them(tmp_path, few):
    long, short = (of_iterations(tmp_path, n) for n in (300, few))
    plan = stages(long, True)
    history = tuple(Row(s.level, 9, k + 1, 1.0, 0.1, 1.0, k) for k, s in enumerate(plan))
    assert any(s.rough for s in plan)
    assert not any(s.rough for s in stages(short, True))
    for at in range(len(plan) + 1):
        state = State(True, at, (), history).renumbered(long, short)
        assert names(short, state) == [s.name.replace("rough ", "") for s in plan]
        there = stages(short, True)[state.stage].name if at < len(plan) else "end"
        assert there == (plan[at].name.replace("rough ", "") if at < len(plan) else "end")


def test_the_same_plan_changes_nothing(tmp_path):
    system = of_iterations(tmp_path, 300)
    state = State(True, 2, (), (Row(0, 9, 1, 1.0, 0.1, 1.0, 1),))
    assert state.renumbered(system, of_iterations(tmp_path, 200)) == state


def test_a_run_without_steps_on_fewer_cells_goes_on_with_them(tmp_path):
    """All of the many steps are taken, not the half of them that is left for the stage behind."""
    short, long = (of_iterations(tmp_path, n) for n in (9, 300))
    last = len(stages(short, True)) - 1
    row = Row(0, 9, 1, 1.0, 0.1, 1.0, last)
    state = State(True, last, (), (row,)).renumbered(short, long)
    plan = stages(long, True)
    assert plan[state.stage].rough
    assert not plan[state.history[0].stage].rough


def test_a_run_that_is_over_goes_on_with_its_last_level(tmp_path):
    for count in (9, 300):
        system = of_iterations(tmp_path, count)
        plan = stages(system, True)
        first = next(k for k, stage in enumerate(plan) if stage.final)
        assert State(True, len(plan), ()).with_steps_left(system).stage == first
        assert State(True, first, ()).with_steps_left(system).stage == first
