"""The last pass with the rays of unmerged pixels, and losses by reflection left out."""

import pytest

from optics.designing.optimisation import earlier_state, stages, transmitted_flux
from tests.optics.cases import small_system, target_z, tracer_to
from tests.optics.designing.optimisation.cases import run

GLOWING = {
    "source.kind": "lambertian",
    "source.half_width": [0.3, 0.3],
    "source.half_angle": 40.0,
    "optimizer.start": "flat",
    "optimizer.window": "bspline",
    "optimizer.window_degree": 3,
    "optimizer.merge": 2,
    "optimizer.lost_flux_weight": 0.0,
    "lens.rear.freeform.max_level": 1,
}


def test_a_finish_is_one_more_stage_with_four_times_the_rays(tmp_path):
    *before, last = stages(small_system(tmp_path, GLOWING | {"optimizer.finish": 1}), False)
    assert [stage.finish for stage in (*before, last)] == [False, False, True]
    assert (last.level, last.iterations) == (1, 1)
    assert last.screen.pixels == before[-1].screen.pixels == (24, 24)
    assert (before[-1].rays, last.rays) == ((97, 97), (193, 193))


def test_a_finish_sees_light_by_other_ways_twice(tmp_path):
    """It changes with the edges and the front, which the first look does not follow."""
    last = stages(small_system(tmp_path, GLOWING | {"optimizer.finish": 40}), False)[-2:]
    assert [(stage.name, stage.iterations) for stage in last] == [("finish", 30), ("finish again", 10)]
    assert all(stage.other_ways for stage in last)
    assert last[0].rays == last[1].rays
    parallel = {"optimizer.start": "flat", "optimizer.window": "bspline", "optimizer.finish": 40}
    assert [s.name for s in stages(small_system(tmp_path, parallel), False)[-2:]] == ["level 2", "finish"]


def test_cells_of_a_finish_are_those_of_unmerged_pixels(tmp_path):
    """Their light has no noise that merged pixels would average."""
    exact = GLOWING | {"source.kind": "point", "source.half_width": [0.0, 0.0], "optimizer.window": "cells"}
    *_, before, last = stages(small_system(tmp_path, exact | {"optimizer.finish": 9}), False)
    assert (before.pixels, last.pixels) == ([24, 24], [48, 48])


@pytest.fixture(scope="module")
def made(tmp_path_factory, backend):
    folder = tmp_path_factory.mktemp("finish")
    return run(folder, backend, GLOWING | {"optimizer.finish": 8, "optimizer.iterations": [8]})


@pytest.mark.slow
def test_a_finish_asks_for_the_light_that_arrives(made, backend):
    """Its fit is of a target with less light; the loss falls in it."""
    assert made.state.stage == 4
    last = [row for stage, _, row in made.calls if stage.finish and row]
    assert len(last) > 3
    assert min(row.loss for row in last) < last[0].loss
    arrives = transmitted_flux(made.system.with_lens(made.lens), backend)
    assert arrives != pytest.approx(transmitted_flux(made.system.unshaped, backend), rel=1e-3)


@pytest.mark.slow
def test_the_result_of_every_stage_of_an_extended_source_is_measured_with_other_rays(made):
    """It is the row of least loss.  With so few unknowns hardly any noise is fitted: both fits are near."""
    judged = [row for row in made.state.history if row.fresh_fit is not None]
    parts = [
        [row for stage, _, row in made.calls if stage is one and row] for one in made.plan if one.iterations
    ]
    assert [row.evaluation for row in judged] == [min(p, key=lambda row: row.loss).evaluation for p in parts]
    for row in judged:
        assert 0 < abs(row.fresh_fit - row.fit) < 0.05 * row.fit


def test_without_fresnels_losses_all_refracted_light_passes(tmp_path, backend):
    system = small_system(tmp_path)
    lens = system.base
    c = [sag.coefficients for sag in lens.sags]
    passing = {}
    for fresnel in (True, False):
        tracer = tracer_to(
            backend, lens, system.source.rays((33, 33)), target_z(system.problem), fresnel=fresnel
        )
        _, landing = tracer.trace(c)
        passing[fresnel] = tracer.fates(landing, system.target.settings.half_width)
    assert passing[False].transmitted == pytest.approx(system.problem.source.flux, rel=1e-12)
    assert passing[False].by_name["front_reflected"] == pytest.approx(0, abs=1e-15)
    assert passing[True].transmitted < 0.93 * system.problem.source.flux


def test_a_design_without_fresnels_losses_ends_with_nearly_the_same_light(tmp_path, backend):
    """Transmittance varies by half a percent over this lens."""
    made = [run(tmp_path, backend, {"optimizer.fresnel": on}) for on in (True, False)]
    first, other = (m.state.history[-1].fit for m in made)
    assert first != other
    assert first == pytest.approx(other, rel=0.1)


def test_an_earlier_design_goes_through_the_last_level_and_its_finish(tmp_path):
    """Not through the finish alone."""
    system = small_system(tmp_path, GLOWING | {"optimizer.finish": 9})
    plan = stages(system, False)
    state = earlier_state(system, system.base)
    assert [(stage.level, stage.finish) for stage in plan[state.stage :]] == [
        (1, False),
        (1, True),
        (1, True),
    ]
