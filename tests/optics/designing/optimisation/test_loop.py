"""The design loop on a small problem: descent, levels, bounds."""

from fractions import Fraction

import numpy as np
import pytest

from optics.base.runtime import UserError
from optics.designing.optimisation.level_objective import _vertices, stage_window
from optics.designing.optimisation.loop import Listener, shape_lens
from optics.designing.optimisation.stage_plan import PROBES, stages
from optics.designing.optimisation.stage_search import Interrupted
from optics.designing.optimisation.state import State
from optics.light.engines import ExactEngine
from tests.optics.cases import small_system
from tests.optics.designing.optimisation.cases import FLAT, check_counts, rows_of, run


def test_the_loss_falls_at_every_level(small):
    for level in range(3):
        losses = [row.loss for row in rows_of(small.state.history, level)]
        assert min(losses) < losses[0]
    assert min(r.loss for r in rows_of(small.state.history, 0)) < 0.5 * small.state.history[0].loss


def test_a_finer_level_starts_from_the_surface_of_the_level_before(small):
    """Levels 1 and 2 see the same pixels and rays: the first loss of level 2 is the best of level 1, to
    rounding."""
    one, two = small.plan[1:]
    assert (one.screen, one.rays) == (two.screen, two.rays)
    best = min(row.loss for row in rows_of(small.state.history, 1))
    assert rows_of(small.state.history, 2)[0].loss == pytest.approx(best, rel=1e-11)


@pytest.mark.parametrize(("window", "wide", "last"), [("pixel", 3, 2), ("bspline", 3, 3), ("gaussian", 8, 8)])
def test_windows_of_the_levels(tmp_path, window, wide, last):
    system = small_system(tmp_path, FLAT | {"optimizer.window": window})
    assert [stage_window(system.problem, stage.final).taps for stage in stages(system, False)] == [
        wide,
        wide,
        last,
    ]


@pytest.mark.parametrize("start", ["flat", "transport"])
def test_the_light_of_cells_is_that_of_the_last_level(tmp_path, start):
    """Every level has one stage; those before the last measure rays."""
    plan = stages(
        small_system(tmp_path, {"optimizer.start": start, "target.pixels": [64, 64]}), start != "flat"
    )
    levels = [stage.level for stage in plan]
    assert levels == list(range(levels[0], 3))
    assert [stage.exact for stage in plan] == [level == 2 for level in levels]
    assert [stage.final for stage in plan] == [stage.exact for stage in plan]


@pytest.mark.parametrize("window", ["pixel", "bspline", "gaussian"])
def test_rays_in_a_window_can_be_asked_for(tmp_path, window):
    assert not any(
        stage.exact for stage in stages(small_system(tmp_path, {"optimizer.window": window}), True)
    )


def test_extended_sources_keep_their_rays_and_the_sharp_window(tmp_path):
    """Their light has no cells: what `cells` means for them is `pixel`."""
    glowing = {"source.kind": "lambertian", "source.half_width": [0.5, 0.5], "optimizer.start": "flat"}
    systems = [small_system(tmp_path, glowing | {"optimizer.window": name}) for name in ("cells", "pixel")]
    plans = [[(s.rays, s.exact) for s in stages(system, False)] for system in systems]
    assert plans[0] == plans[1]
    assert not any(exact for _, exact in plans[0])
    assert stage_window(systems[0].problem, True) == stage_window(systems[1].problem, True)


@pytest.mark.parametrize(
    ("changes", "cells"),
    [
        ({}, (144, 144)),  # three per pixel
        ({"target.pixels": [16, 20]}, (64, 64)),  # never fewer
        (
            {"lens.rear.freeform.max_level": 4},
            (220, 220),
        ),  # 3.6 of 64 spans, 95 % of which are lit, made even
        ({"lens.rear.freeform.max_level": 4, "source.half_width": [5.0, 20.0]}, (144, 232)),
        ({"lens.rear.freeform.max_level": 4, "lens.front.radius": 60.0}, (232, 232)),  # rays spread
    ],
)
def test_cells_suffice_for_pixels_and_for_the_spans_that_are_lit(tmp_path, changes, cells):
    final = stages(small_system(tmp_path, changes), False)[-1]
    assert final.rays == tuple(n + 1 for n in cells)  # corners


def test_half_of_many_steps_are_taken_on_fewer_cells(tmp_path):
    fine = {"lens.rear.freeform.max_level": 4, "optimizer.start": "transport"}
    found = {
        steps: [
            (s.name, s.iterations, s.rays)
            for s in stages(small_system(tmp_path, fine | {"optimizer.iterations": [steps]}), True)
            if s.iterations
        ]
        for steps in (71, 23)
    }
    assert found[71] == [("rough level 4", 36, (89, 89)), ("level 4", 35, (221, 221))]
    assert found[23] == [("level 4", 23, (221, 221))]


def test_too_many_cells_are_refused(tmp_path):
    fine = {"lens.rear.freeform.max_level": 6, "lens.rear.freeform.spans": [8, 8]}
    system = small_system(tmp_path, fine | {"target.pixels": [2160, 2160]})
    with pytest.raises(UserError, match=r"level 6 would trace 6481 x 6481 rays at once"):
        stages(system, False)


def test_degrees_of_freedom_grow_from_level_to_level(small):
    dof = [rows_of(small.state.history, level)[0].dof for level in range(3)]
    assert dof[0] == 7 * 7
    assert dof[0] < dof[1] < dof[2] == small.lens.rear.sag.space.dim
    assert small.lens.rear.sag.space.levels == 3


def test_the_surface_is_the_best_one_seen(small, backend):
    """Started again from the result, the last level's first loss is the lowest in its history."""
    seen = []

    def stop(plan, stage, dof, row):
        if row:
            seen.append(row.loss)
            raise KeyboardInterrupt

    with pytest.raises(Interrupted):
        shape_lens(
            small.system,
            backend,
            ExactEngine(backend),
            State(False, 2, small.lens.sags),
            listener=Listener(stop),
        )
    assert seen[0] == pytest.approx(min(row.loss for row in rows_of(small.state.history, 2)), rel=1e-12)


def test_the_history_counts_evaluations_and_time(either):
    history = either.state.history
    starts = check_counts(history)
    assert starts == (1 if history[1].level else 3)  # with a transport start only the last level is optimised
    seconds = [row.seconds for row in history]
    assert seconds == sorted(seconds)
    assert either.state.evaluations == len(history) + starts * PROBES
    assert all(
        np.isfinite([row.loss, row.fit]).all() and row.loss >= row.fit**2 * (1 - 1e-12) for row in history
    )


def test_progress_hears_of_every_stage_and_evaluation_and_checkpoints_of_every_level(either):
    assert tuple(row for *_, row in either.calls if row) == either.state.history
    assert [stage for stage, _, row in either.calls if row is None] == list(either.plan)
    assert all((stage.level, dof) == (row.level, row.dof) for stage, dof, row in either.calls if row)
    assert all(either.plan[row.stage] is stage for stage, _, row in either.calls if row)
    assert [state.stage for state in either.checkpoints] == list(range(1, len(either.plan) + 1))


def test_evaluations_stay_within_what_was_promised(either):
    """L-BFGS stops after 2 n + 10 evaluations at the latest; it finishes the line search it is in (at most
    20)."""
    for level in range(3):
        assert len(rows_of(either.state.history, level)) <= 2 * 6 + 10 + 20


def test_a_transport_start_is_nearer_than_the_base_conic_and_is_improved(small, moved):
    last = rows_of(moved.state.history, 2)
    assert last[0].loss < rows_of(small.state.history, 0)[0].loss / 5
    assert min(row.loss for row in last) < 0.9 * last[0].loss
    assert moved.lens.rear.sag.space.levels == 3


def test_levels_before_the_last_are_only_marked_after_a_transport_start(moved):
    levels = [stage.level for stage in moved.plan]
    assert levels[-1] == 2
    assert all(len(rows_of(moved.state.history, level)) == 0 for level in levels[:-1])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("front", "bound", "flat"), [(60.0, 0.02, True), (60.0, 5.0, False), (np.inf, 0.02, True)]
)
def test_a_map_far_beyond_the_bounds_leaves_every_level_to_be_optimised(
    tmp_path, backend, front, bound, flat
):
    """A note says so.  Where rays spread, the base surface is the start."""
    changes = {
        "optimizer.start": "transport",
        "lens.front.radius": front,
        "lens.rear.freeform.z_freedom": bound,
    }
    made = run(tmp_path, backend, changes)
    if flat:
        assert [(stage.level, stage.iterations) for stage in made.plan] == [(0, 6), (1, 6), (2, 6)]
        assert len(made.notes) == 1
        assert made.notes[0].startswith("the transport map asks for a sag of ")
        assert ("the design starts from the base surface instead" in made.notes[0]) == (front == 60.0)
    else:
        assert {stage.iterations for stage in made.plan if stage.level < 2} == {0}
        assert made.notes == []


@pytest.mark.slow
@pytest.mark.parametrize("bound", [0.02, 0.3])
def test_a_start_that_the_bounds_cut_off_is_no_worse_than_a_flat_one(tmp_path, backend, bound):
    """Of both the one with the smaller loss on the first level is taken."""
    first = {}
    for start in ("flat", "transport"):
        changes = {"optimizer.start": start, "lens.rear.freeform.z_freedom": bound}
        made = run(tmp_path, backend, changes)
        assert made.plan[0].iterations == 6
        first[start] = made.state.history[0].loss
    assert first["transport"] <= first["flat"]
    if bound == 0.3:  # the start is nearer than the base surface, not that itself
        assert first["transport"] < 0.9 * first["flat"]


@pytest.mark.every(2)
@pytest.mark.parametrize("bound", [1.0, 0.02])
def test_coefficients_keep_to_z_freedom(tmp_path, backend, bound):
    for start in ("flat", "transport"):
        changes = {
            "optimizer.start": start,
            "lens.rear.freeform.z_freedom": bound,
            "lens.rear.freeform.max_level": 1,
        }
        shaped, _ = shape_lens(small_system(tmp_path, changes), backend, ExactEngine(backend))
        lens = shaped.designed
        assert np.abs(lens.rear.sag.coefficients).max() <= bound * (1 + 1e-15)
    if bound < 0.1:
        assert np.abs(lens.rear.sag.coefficients).max() > 0.9 * bound


def test_only_the_rear_sag_changes(small):
    base = small.system.base
    assert (small.lens.front.half_width, small.lens.front.conic) == (base.front.half_width, base.front.conic)
    assert (small.lens.rear.half_width, small.lens.rear.conic) == (base.rear.half_width, base.rear.conic)
    assert (small.lens.thickness, small.lens.index) == (base.thickness, base.index)


@pytest.mark.parametrize(
    ("window", "front"),
    [
        ("pixel", np.inf),
        ("bspline", 60.0),
        ("gaussian", 60.0),
        *(
            pytest.param(window, front, marks=pytest.mark.slow)
            for window, front in (("pixel", 60.0), ("bspline", np.inf), ("gaussian", np.inf))
        ),
    ],
)
def test_windows_and_curved_fronts_design_too(tmp_path, backend, window, front):
    changes = FLAT | {
        "optimizer.window": window,
        "lens.front.radius": front,
        "lens.rear.freeform.max_level": 0,
    }
    _, state = shape_lens(small_system(tmp_path, changes), backend, ExactEngine(backend))
    assert min(r.loss for r in state.history) < 0.7 * state.history[0].loss


@pytest.mark.parametrize("start", ["flat", "transport"])
def test_oblong_lenses_pictures_and_targets_design_too(tmp_path, backend, start):
    """Every size differs in x and y: source, lens, spans, target, pixels."""
    changes = {
        "optimizer.start": start,
        "source.half_width": [9.5, 6.0],
        "lens.front.half_width": [10.0, 7.0],
        "lens.rear.half_width": [10.0, 7.0],
        "lens.rear.freeform.spans": [5, 3],
        "target.half_width": [20.0, 12.0],
        "target.pixels": [50, 30],
    }
    _, state = shape_lens(small_system(tmp_path, changes), backend, ExactEngine(backend))
    plan = stages(small_system(tmp_path, changes), start == "transport")
    assert state.history[0].level == next(stage.level for stage in plan if stage.iterations)
    losses = [r.loss for r in rows_of(state.history, 2)]
    assert min(losses) < losses[0]
    assert min(losses) < 0.1


def test_stages_refine_pixels_until_the_targets_own(tmp_path):
    changes = {"target.pixels": [192, 96], "lens.rear.freeform.max_level": 3}
    system = small_system(tmp_path, FLAT | changes)
    plan = stages(system, False)
    assert [s.level for s in plan] == [0, 1, 2, 3]
    assert plan[0].screen.pixels == (48, 24)
    assert plan[-1].screen.pixels == (192, 96)
    columns = [s.screen.pixels[0] for s in plan]
    assert columns == sorted(columns)
    for stage in plan:
        per_pixel = 3 if stage.exact else system.problem.optimizer.rays_per_pixel
        assert all(r >= per_pixel * n for r, n in zip(stage.rays, stage.screen.pixels))
        assert all(r > 2 * (4 << stage.level) for r in stage.rays)
        assert stage.screen.half_width == system.problem.target.half_width


def test_merged_pixels_cover_the_whole_target(tmp_path):
    """51 x 49 pixels merged by two give 26 x 25 over the same rectangle."""
    system = small_system(tmp_path, {"target.pixels": [51, 49]})
    screen = system.target.screen(2, 8)
    assert (screen.pixels, screen.half_width, screen.margin) == ((26, 25), (20.0, 20.0), 8)


@pytest.mark.parametrize("spans", [1, 3, 4, 5, 6, 7, 30, 35])
def test_vertices_for_marking_lie_on_no_knot_line(spans):
    """A vertex on a line between two cells would count for one of them and spoil the mirror symmetry."""
    for rays in range(65, 140):
        steps = _vertices(rays, spans) - 1
        assert rays <= steps < rays + 20
        inner = {Fraction(k, steps) for k in range(1, steps)}
        assert not inner & {Fraction(k, spans << 5) for k in range(1, spans << 5)}


def test_a_mirror_symmetric_problem_is_refined_symmetrically(tmp_path, backend):
    """A picture without features of its own: marking from the unoptimised, symmetric lens is symmetric."""
    image = np.full((48, 48), 40, dtype=np.uint8)
    image[12:36, 12:36] = 255
    changes = FLAT | {
        "refinement.alpha": [0.5],
        "optimizer.iterations": [1],
        "lens.rear.freeform.max_level": 1,
    }
    shaped, _ = shape_lens(small_system(tmp_path, changes, image=image), backend, ExactEngine(backend))
    lens = shaped.designed
    cells = {tuple(c) for c in lens.rear.sag.space.cells.tolist()}
    assert 0 < sum(n == 0 for n, _, _ in cells) < 16
    assert {(n, (4 << n) - 1 - i, j) for n, i, j in cells} == cells
    assert {(n, i, (4 << n) - 1 - j) for n, i, j in cells} == cells
    assert {(n, j, i) for n, i, j in cells} == cells
