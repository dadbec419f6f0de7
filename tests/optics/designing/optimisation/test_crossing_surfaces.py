"""Designs whose surfaces would cross: the level is taken back and the design goes on."""

import re
from dataclasses import replace

import numpy as np
import pytest

from optics.designing.optimisation import limit_keeper, loop, stage_search
from optics.designing.optimisation.bounded_variables import BoundedVariables
from optics.designing.optimisation.first_state import with_sags
from optics.designing.optimisation.level_objective import stage_objective
from optics.designing.optimisation.loop import nearest_shapes, shape_lens
from optics.designing.optimisation.stage_plan import stages
from optics.designing.optimisation.stage_search import Interrupted, Log, Search
from optics.designing.optimisation.state import State
from optics.interface.commands import main
from optics.light.engines import ExactEngine
from optics.scene.system import load_system, solvable_system
from tests.optics.cases import small_system, write_problem
from tests.optics.designing.optimisation.cases import FLAT, designed
from thbcad.surfaces import THBSurface

SHORT = FLAT | {
    "optimizer.iterations": [2],
    "lens.rear.freeform.max_level": 0,
    "target.pixels": [24, 24],
}


def constant(lens, height):
    """Return the sags of a lens as constants, mm."""
    return [THBSurface(sag.space, np.full(sag.space.dim, height)) for sag in lens.sags]


def test_a_lens_that_can_exist_is_kept_bit_for_bit(tmp_path):
    system = small_system(tmp_path)
    wanted = constant(system.base, -5.9)
    found, wrong = nearest_shapes(system, wanted)
    assert wrong == ""
    assert found.sags[0] is wanted[0]


@pytest.mark.parametrize(("height", "share"), [(-7.0, 0.5), (-13.0, 0.25), (-6.0, 0.5), (-1000.0, 1 / 256)])
def test_a_lens_that_cannot_exist_keeps_the_greatest_halved_share_of_its_change(tmp_path, height, share):
    """The lens is 6 mm thick at its vertex and nowhere thinner: a constant sag c leaves 6 + t c > 0."""
    system = small_system(tmp_path)
    found, wrong = nearest_shapes(system, constant(system.base, height))
    np.testing.assert_array_equal(found.sags[0].coefficients, share * height)
    assert "cross" in wrong or "touch" in wrong
    assert f"of the level's changes {share:.2g} are kept" in wrong


def test_a_change_far_beyond_reason_is_dropped(tmp_path):
    system = small_system(tmp_path)
    found, wrong = nearest_shapes(system, constant(system.base, -1e9))
    assert found is system
    assert wrong.endswith("none of the level's changes are kept")


def test_a_start_that_nearly_crosses_is_moved_apart_without_limits(tmp_path, backend):
    """The lens is 6 mm thick, and a rear lowered by 5.9999 mm leaves less than its penalty allows."""
    system = small_system(tmp_path, SHORT | {"lens.rear.freeform.z_freedom": 9.0})
    sags, (stage,) = constant(system.base, -5.9999), stages(system, False)
    target = system.target.irradiance(stage.screen, system.problem.flux)
    engine, notes = ExactEngine(backend), list[str]()
    objective = stage_objective(with_sags(system, sags), stage, target, engine)
    search = Search(system.problem, objective, BoundedVariables(sags, [9.0]), tuple(sags), None)
    assert objective.shape.exceeded([sag.coefficients for sag in sags])
    keeper = limit_keeper.LimitKeeper(system, None, notes.append)
    log = Log(State(False, 0, tuple(sags)), stage, 0.0, lambda _: None)
    begun = keeper.begun(search, log)
    assert not objective.shape.exceeded([sag.coefficients for sag in begun.sags])


def crossing(system, monkeypatch):
    """Let the optimiser drive the rear through the front at the first level only."""
    genuine, calls = stage_search.minimised, []

    def crossed(search, iterations, log):
        found = genuine(search, iterations, log)
        calls.append(found)
        through = [sag.coefficients for sag in constant(system.base, -7.0)]
        return replace(found, coefficients=through) if len(calls) == 1 else found

    for module in (loop, limit_keeper):
        monkeypatch.setattr(module, "minimised", crossed)


def test_a_level_that_would_cross_is_taken_back_and_the_design_goes_on(tmp_path, backend, monkeypatch):
    system = solvable_system(small_system(tmp_path, SHORT | {"lens.rear.freeform.max_level": 1}).problem)
    crossing(system, monkeypatch)
    made = designed(system, backend)
    assert made.lens.least_thickness().lower > 0
    assert made.state.stage == 2
    (taken_back, remedy) = made.notes
    assert taken_back.startswith("level 0: the optimised lens cannot exist (the surfaces cross: ")
    assert taken_back.endswith("of the level's changes 0.5 are kept")
    thickness = float(re.search(r": --set lens\.thickness=(\S+)$", remedy)[1])
    assert constant(system.base, -7.0)[0].coefficients.min() + thickness > 0  # above the plane front


@pytest.mark.slow
def test_such_a_design_still_writes_a_verified_solid(tmp_path, capsys, monkeypatch):
    path = write_problem(tmp_path, SHORT | {"lens.rear.freeform.z_freedom": 7.0, "verify.rel_l2": 1.0})
    crossing(load_system(path), monkeypatch)
    assert main(["design", str(path), "--out", str(tmp_path / "out")]) == 0
    assert "FAILED" not in capsys.readouterr().out
    assert main(["verify", str(tmp_path / "out"), "--no-optiland"]) == 0
    capsys.readouterr()


def test_ctrl_c_amid_surfaces_that_cross_leaves_a_state_to_go_on_from(tmp_path, backend, monkeypatch):
    system = solvable_system(small_system(tmp_path, SHORT).problem)

    def stopped(search, iterations, log):
        log.add(search.objective([sag.coefficients for sag in search.sags]), search.sags[0].space.dim)
        raise Interrupted(log.state(constant(system.base, -7.0)))

    monkeypatch.setattr(limit_keeper, "minimised", stopped)
    with pytest.raises(Interrupted) as caught:
        shape_lens(system, backend, ExactEngine(backend))
    monkeypatch.undo()
    state = caught.value.state
    np.testing.assert_array_equal(state.sags[0].coefficients, -3.5)
    shaped, state = shape_lens(system, backend, ExactEngine(backend), state)
    lens = shaped.designed
    assert lens.least_thickness().lower > 0
    assert state.stage == 1
