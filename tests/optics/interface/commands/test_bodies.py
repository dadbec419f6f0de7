"""Bodies for moulds: what `check` accepts `design` writes, and what it refuses is refused before the work."""

import pytest

import optics
from optics.interface.api import Design
from optics.light.analysis import delivery_checks
from optics.scene.problem import load_problem
from optics.scene.system import System
from tests.optics.cases import small_space, small_system, write_problem
from tests.optics.interface.commands.cases import refused
from thbcad.surfaces import THBSurface

BODY = {
    "lens.outline": "round",
    "lens.body.draft": 3.0,
    "lens.rear.freeform.max_level": 1,
    "source.profile": "round",
    "source.half_width": [7.0, 7.0],
    "target.half_width": [10.0, 10.0],
    "target.pixels": [24, 24],
}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"lens.body.parting": 9.0}, "the parting line at z = 9 mm must lie below the rear's rim"),
        ({"lens.body.edge_radius": 4.5}, "edge_radius = 4.5 mm is too large: on the wall"),
    ],
    ids=["parting", "radius"],
)
def test_a_body_that_the_start_cannot_have_is_refused_by_check_and_design(capsys, tmp_path, keys, words):
    path = write_problem(tmp_path, BODY | keys)
    assert words in refused(capsys, "check", path)
    assert words in refused(capsys, "design", path, "-q", "--out", tmp_path / "out")


def failing_of_file(design):
    """Return the names of the checks that fail, but for those of the light."""
    of_light = {check.name for check in delivery_checks(design.metrics, design.problem.verify)}
    rows = design.verify()["checks"]
    return [row["name"] for row in rows if not row["ok"] and row["name"] not in of_light]


@pytest.mark.slow
@pytest.mark.parametrize(
    "keys",
    [
        {"lens.body.draft": 0.5, "lens.body.edge_radius": 0.05},
        {"lens.body.draft": 5.0, "lens.body.edge_radius": 1.0, "optimizer.start": "flat"},
        {"lens.outline": "rounded", "lens.corner_radius": 2.5, "lens.body.edge_radius": 0.5},
    ],
    ids=["small radius", "large radius", "rounded rectangle"],
)
def test_a_design_with_rounded_edges_ends_in_a_verified_solid(tmp_path, keys):
    problem = load_problem(write_problem(tmp_path, BODY | {"optimizer.iterations": [3]} | keys))
    design = optics.design(problem)
    assert design.system.problem.optic.body.edge_radius == keys["lens.body.edge_radius"]
    assert failing_of_file(design) == []


def test_a_radius_that_the_design_leaves_no_wall_for_fails_by_name_and_the_solid_is_sharp(tmp_path):
    """The rear comes 4 mm down, and its rim from z = 7.25 to 3.25 mm: half of that is the wall's."""
    asked = small_system(tmp_path, BODY | {"lens.body.edge_radius": 2.0})
    space = small_space()
    lens = asked.base.with_sags([THBSurface(space, [-4.0] * space.dim)])
    system, unfit = asked.with_lens(lens).as_possible()
    assert "edge_radius = 2 mm is too large: on the wall the rounding of the" in unfit
    assert unfit.endswith("mm, which fits; the solid has sharp edges")
    assert system.problem.optic.body.edge_radius == 0
    assert failing_of_file(Design(system.with_lens(lens), requested=asked.problem)) == [
        "edge_radius of the body"
    ]


def test_a_body_that_fits_is_kept(tmp_path):
    system = System(load_problem(write_problem(tmp_path, BODY | {"lens.body.edge_radius": 0.3})))
    assert system.as_possible() == (system, "")
