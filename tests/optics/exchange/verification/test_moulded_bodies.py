"""The STEP file of a lens with the table [lens.body] holds the body, and its checks know it from others."""

from dataclasses import replace

import pytest

from optics.exchange.verification import (
    StepFile,
    export_step,
    text_and_occt_checks,
    text_solid_checks,
    verify,
)
from optics.exchange.verification.independent_checks import text_checks
from optics.scene.system import System, designed_part
from tests.optics.cases import failing, rough, small_system
from thbcad.surfaces import THBSurface

DRAFT = {"lens.body.draft": 2.0}
ROUNDED = {"lens.outline": "rounded", "lens.corner_radius": 3.0}
POINT = {"source.kind": "point", "source.half_angle": 60.0, "source.distance": 6.0}
DOME = DRAFT | {
    "lens.outline": "round",
    "lens.thickness": 14.0,
    "lens.front.half_width": [10.0, 10.0],
    "lens.front.radius": -15.0,
    "lens.rear.half_width": [24.0, 24.0],
    "lens.rear.radius": -36.0,
    "lens.rear.conic": -1.0,
    "lens.body.annulus": True,
}
BODIES = {
    "dome": DOME,  # without a clear aperture light may pass where the draft leaves no glass
    "dome with a recess": DOME | POINT | {"lens.body.land": -9.0, "lens.clear_aperture": [20.0, 20.0]},
    "rectangle": DRAFT,
    "rounded": DRAFT | ROUNDED | POINT,
    "dome with a rounded rim": DOME | {"lens.body.edge_radius": 0.3},
    "rounded with rounded edges": DRAFT | ROUNDED | POINT | {"lens.body.edge_radius": 0.3},
    "ellipse": {"lens.body.annulus": True, "lens.outline": "ellipse", "lens.front.half_width": [6.0, 5.0]},
}


@pytest.fixture
def made(tmp_path):
    """Return system, lens and STEP file of a problem, its rear rough."""

    def exported(keys):
        system = small_system(tmp_path, keys)
        space = system.base.rear.sag.space
        lens = system.base.with_sags([THBSurface(space, rough(space, 0.02))])
        assert (
            failing(export_step(designed_part(system.with_lens(lens)), "AP242", tmp_path / "lens.step")) == []
        )
        return system, lens, tmp_path / "lens.step"

    return exported


@pytest.mark.parametrize(
    "name", [name if name == "dome" else pytest.param(name, marks=pytest.mark.slow) for name in BODIES]
)
def test_the_file_holds_the_body_by_all_checks(made, backend, name):
    system, lens, path = made(BODIES[name])
    file = StepFile(path)
    checks = [
        *text_and_occt_checks(system.with_lens(lens), file, backend),
        *verify(system.with_lens(lens), file, backend),
    ]
    assert failing(checks) == []
    assert file.has_rims
    assert file.solid.volume == pytest.approx(
        system.with_lens(lens).solid.volume(), rel=1e-6
    )  # asked of OCCT
    assert abs(file.solid.volume / lens.volume() - 1) > 0.01


def test_a_rounded_edge_of_another_radius_is_told_by_radii_and_volume(made):
    system, lens, path = made(DOME | {"lens.body.edge_radius": 0.3})
    text = StepFile(path).text
    assert failing(text_checks(text, system.with_lens(lens).solid)) == []
    other = System(system.problem.with_(**{"lens.body.edge_radius": 0.2997}))
    failed = failing(text_checks(text, other.with_lens(lens).solid))
    assert [name.split(":")[-1].split(",")[0].split(" that")[0] for name in failed] == [
        " walls",
        "volume by quadrature over the text of the file against the closed form",
    ]


def test_a_body_of_another_draft_is_told_by_walls_and_volume(made):
    system, lens, path = made(DOME)
    other = System(system.problem.with_(**{"lens.body.draft": 2.001}))
    failed = failing(text_checks(StepFile(path).text, other.with_lens(lens).solid))
    assert [name.split(":")[-1].split(",")[0].split(" that")[0] for name in failed] == [
        " walls",
        "volume by quadrature over the text of the file against the closed form",
    ]


def test_the_file_of_a_plate_has_every_lens_at_its_place_and_a_shift_of_one_is_found(made, backend):
    plate = {"lens.array.columns": 2, "lens.array.rows": 1, "lens.array.pitch": 24.3, "lens.thickness": 8.0}
    system, lens, path = made(plate)
    file = StepFile(path)
    checks = [
        *text_and_occt_checks(system.with_lens(lens), file, backend),
        *verify(system.with_lens(lens), file, backend),
    ]
    assert failing(checks) == []
    solid = system.with_lens(lens).made
    moved = replace(solid, pitch=(24.3 + 1e-14, 24.3))
    wrong = [check for check in text_solid_checks(file.text, moved) if not check.ok]
    assert [check.name.partition(" that")[0] for check in wrong] == ["numbers of like lenses"]
    assert wrong[0].value > 0
