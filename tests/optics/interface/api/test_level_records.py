"""Levels that are kept: surface, light and gradients of each, in Python, in the folder and in the report."""

import json
import re
from shutil import copytree

import numpy as np
import pytest

import optics
from optics.interface.api.design_result import Design
from optics.scene.problem import load_problem
from tests.optics.cases import write_problem

KEEPING = {
    "target.kind": "tophat",
    "optimizer.iterations": [3],
    "optimizer.start": "flat",
    "lens.rear.freeform.max_level": 1,
    "run.keep": "levels",
}


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    folder = tmp_path_factory.mktemp("levels")
    design = optics.design(load_problem(write_problem(folder, KEEPING)))
    return design, design.save(folder / "result")


@pytest.mark.slow
def test_every_level_is_kept_with_its_light_and_gradients(kept):
    design, _ = kept
    assert [level.name for level in design.levels] == ["level 0", "level 1"]
    system = optics.System(design.problem)
    for level in design.levels:
        space = level.lens.rear.sag.space
        assert [g.shape for g in level.gradients] == [(len(space.cells),)]
        assert level.gradients[0].max() > 0
        assert level.metrics["rel_l2"] == system.measure(level.lens).metrics["rel_l2"]
    assert design.levels[-1].lens.rear.sag.space.dim == design.lens.rear.sag.space.dim
    assert level.irradiance.tobytes() == design.irradiance.tobytes()


def test_a_run_that_is_stopped_keeps_the_levels_that_are_done(tmp_path):
    seen = []

    def stop(moment):
        seen.append(moment.phase == "level 1" and "evaluations" in moment.detail)
        if sum(seen) == 1 and seen[-1]:
            raise KeyboardInterrupt

    design = optics.design(load_problem(write_problem(tmp_path, KEEPING)), progress=stop)
    assert design.interrupted
    assert [level.name for level in design.levels] == ["level 0"]


def test_levels_are_read_back(kept):
    design, folder = kept
    for level, read in zip(design.levels, optics.Design.load(folder).levels, strict=True):
        assert read.name == level.name
        assert np.array_equal(read.lens.rear.sag.coefficients, level.lens.rear.sag.coefficients)
        assert read.irradiance.tobytes() == level.irradiance.tobytes()
        assert [g.tobytes() for g in read.gradients] == [g.tobytes() for g in level.gradients]


def test_the_record_holds_the_levels_and_the_report_a_row_of_each(kept):
    _, folder = kept
    held = json.loads((folder / "result.json").read_text())["sha256"]
    assert {"level_0.json", "level_1.npz", "figures/level_1.png"} <= set(held)
    page = (folder / "report.html").read_text()
    assert "<h2>Levels</h2>" in page
    assert all(f"level {k}: " in page for k in range(2))


@pytest.mark.slow
def test_a_run_that_keeps_nothing_takes_the_levels_of_the_run_before_away(kept, tmp_path):
    design, _ = kept
    folder = design.save(tmp_path / "result")
    Design(design.system, requested=design.asked).save(folder)
    assert not list(folder.glob("**/level_*"))


def test_somebody_elses_level_file_is_not_replaced(kept, tmp_path):
    design, _ = kept
    (tmp_path / "level_1.npz").write_text("mine")
    with pytest.raises(optics.UserError, match=r"level_1\.npz would be replaced"):
        design.save(tmp_path)
    assert (tmp_path / "level_1.npz").read_text() == "mine"


@pytest.mark.parametrize(
    "name", ["irradiance.npz", "metrics.json", "history.csv", "level_1.json", "level_0.npz"]
)
@pytest.mark.parametrize("harm", ["missing", "damaged"])
def test_a_folder_without_one_of_its_files_is_refused(kept, tmp_path, name, harm):
    folder = copytree(kept[1], tmp_path / "result")
    if harm == "missing":
        (folder / name).unlink()
    else:
        (folder / name).write_bytes(b"{")
    with pytest.raises(
        optics.UserError, match=f"{re.escape(name)} (is missing or changed|belongs to another)"
    ):
        optics.Design.load(folder)
