"""Light that other ways than front and rear bring, beside the light of the last levels and the finish."""

from dataclasses import replace

import numpy as np
import pytest

from optics.base.runtime import load_backend
from optics.designing.optimisation import Listener, loop, shape_lens, stages, transmitted_flux
from optics.designing.optimisation.level_objective import (
    Background,
    background,
    stage_film,
    stage_objective,
)
from optics.light.analysis import measure
from optics.light.engines import ExactEngine
from tests.optics.cases import DOME, small_system

FINISHED = DOME | {  # 4 % of the light comes by other ways
    "target.lit": [0.7, 0.7],
    "target.half_width": [2000.0, 2000.0],
    "target.pixels": [24, 24],
    "optimizer.window": "bspline",
    "optimizer.iterations": [30],
    "optimizer.finish": 40,
    "lens.rear.freeform.max_level": 1,
}


def system_of(folder, changes=None):
    return small_system(folder, FINISHED | (changes or {}))


def test_the_objective_counts_the_background_as_light(tmp_path, backend):
    """Its fit is that of the sum of both lights, and its gradient that of a target with less light."""
    system = system_of(tmp_path, {"optimizer.lost_flux_weight": 0.0, "optimizer.roughness_weight": 0.0})
    stage = replace(stages(system, False)[0], rays=(64, 64))
    light, engine = np.random.default_rng(1).uniform(size=(2, *stage.screen.shape)), ExactEngine(backend)
    at = [sag.coefficients for sag in system.base.sags]

    def found(target, around):
        objective = stage_objective(system, stage, target, engine, background=around)
        return objective(at), np.linalg.norm(objective.target)

    target, around = light
    (with_it, norm), (without, other) = (
        found(target, Background(0.3 * around)),
        found(target - 0.3 * around, None),
    )
    assert with_it.fit * norm == pytest.approx(without.fit * other, rel=1e-12)
    np.testing.assert_allclose(
        with_it.gradients[0] * norm**2, without.gradients[0] * other**2, rtol=1e-9, atol=1e-20
    )


@pytest.mark.slow
def test_the_last_two_levels_and_the_finish_have_one(tmp_path):
    plan = stages(system_of(tmp_path, {"lens.rear.freeform.max_level": 3}), False)
    assert [stage.other_ways for stage in plan] == [False, False, True, True, True, True]
    by_cells = stages(system_of(tmp_path, {"source.kind": "point", "optimizer.window": "cells"}), False)
    assert [stage.other_ways for stage in by_cells] == [True, False, True]  # what they bring is of rays


def test_sharp_light_has_none(tmp_path):
    """It is compared with an aim, not with what arrives."""
    sun = {"source.divergence_profile": "sun", "source.divergence": 2.0, "optimizer.window": "bspline"}
    plan = stages(small_system(tmp_path, sun | {"optimizer.finish": 4}), True)
    assert [stage.aimed for stage in plan[-3:]] == [True, False, False]
    assert [stage.other_ways for stage in plan[-3:]] == [False, True, True]


@pytest.mark.slow
def test_it_is_its_own_mirror_image_and_as_bright_as_measured(tmp_path, backend, monkeypatch):
    monkeypatch.setattr("optics.light.analysis.closed_lens_light.RAYS", (64, 64))
    monkeypatch.setattr(
        "optics.designing.optimisation.level_objective.REPLICATES", 8
    )  # as many as are measured
    system = system_of(tmp_path)
    finish = stages(system, False)[-1]
    image = background(system, backend, stage_film(system, finish, (0, 1))).image
    assert image.shape == finish.screen.shape
    assert np.array_equal(image, image[::-1])
    assert np.array_equal(image, image[:, ::-1])
    flux = image.sum() * finish.screen.pixel_area
    metrics = measure(system, backend).metrics["nonsequential"]
    assert flux == pytest.approx(metrics["by_other_ways"] * metrics["target_w"], rel=0.01)


@pytest.mark.parametrize("changes", [{"source.half_angle": 20.0}, {"source.kind": "collimated"}])
def test_where_it_is_negligible_there_is_none(tmp_path, backend, changes):
    system = system_of(tmp_path, changes)
    assert background(system, backend, stage_film(system, stages(system, False)[-1])) is None


@pytest.mark.parametrize("changes", [{}, {"source.kind": "point", "optimizer.window": "cells"}])
def test_what_cannot_follow_the_rear_counts_where_fixed_light_does(tmp_path, backend, monkeypatch, changes):
    """Rays of an extended source follow it, cells of a point do not."""
    monkeypatch.setattr("optics.light.analysis.closed_lens_light.RAYS", (32, 32))
    system = system_of(tmp_path, changes)
    film = stage_film(system, stages(system, False)[-1])
    film = replace(film, window=None) if changes else film
    fixed, moving = (background(system, backend, film, fixed) for fixed in (True, False))
    assert (fixed.within is None, moving is None) == (bool(changes), bool(changes))


@pytest.mark.slow
def test_a_design_asks_for_what_the_background_leaves(tmp_path, backend, monkeypatch):
    """The flux asked for grows by the background's, and the objective sees the background."""
    fewer = {"lens.rear.freeform.max_level": 2, "optimizer.iterations": [2], "optimizer.finish": 2}
    system = system_of(tmp_path, fewer)
    seen, real, objectives = [], loop.stage_objective, []

    def known(system, backend, film, fixed):
        return Background(np.full(film.screen.shape, 1e-8))

    def watched(*arguments, **named):
        objectives.append(named.get("background"))
        return real(*arguments, **named)

    monkeypatch.setattr(loop, "background", known)
    monkeypatch.setattr(loop, "stage_objective", watched)
    shape_lens(system, backend, ExactEngine(backend), listener=Listener(seen=lambda *each: seen.append(each)))
    first, second, last, finish = (target.sum() * stage.screen.pixel_area for stage, _, target in seen)
    assert second == last == pytest.approx(first + 1e-8 * 4000.0**2, rel=1e-12)
    passed = transmitted_flux(seen[2][1], backend)
    assert finish == pytest.approx(passed + 1e-8 * 4000.0**2, rel=1e-12)
    assert [around is None for around in objectives] == [True] * 2 + [False] * 6


def test_light_by_other_ways_is_seen_at_every_precision(tmp_path):
    """Its tracer, which proves what rays meet, knows double precision alone."""
    single = load_backend("single", 1)
    system = system_of(tmp_path, {"run.precision": "single"})
    film = stage_film(system, stages(system, False)[-1])
    assert background(system, single, film) is not None
