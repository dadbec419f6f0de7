"""Whole sweeps with stand-ins for the design: rows, files, going on, and what is refused."""

import csv
import json
import re
from dataclasses import replace
from itertools import islice

import pytest

import optics
from optics.base.runtime import UserError
from optics.base.workers import run_tasks
from optics.exchange.results import fingerprint
from optics.interface.sweeps import running, sweep_folder, sweep_views
from optics.interface.sweeps.sweep_rows import SweepRow
from optics.interface.sweeps.sweep_views import _texts
from optics.scene.problem import Problem
from tests.optics.interface.sweeps.cases import (
    DISTANCES,
    PICTURE,
    kept_lens,
    picky,
    png,
    problem,
    quick,
    reading,
    thread_pool,
    without_memory,
)


@pytest.fixture
def design(monkeypatch):
    """Return a function that sets what stands in for the design, on processes of this machine."""

    def use(function):
        monkeypatch.setattr(running, "designed", function)

    use(quick)
    return use


@pytest.fixture
def by(design, monkeypatch):
    """Return the same on a thread, and without plots: both take a second."""
    monkeypatch.setattr(running, "worker_pool", thread_pool)
    monkeypatch.setattr(sweep_folder, "metric_plots", lambda sweep: {})
    return design


def rows(folder):
    with (folder / "sweep.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def test_a_sweep_has_a_row_for_every_variant_and_files_that_show_them(by, tmp_path, monkeypatch):
    monkeypatch.setattr(sweep_folder, "metric_plots", sweep_views.metric_plots)
    ranges = DISTANCES | {"lens.rear.freeform.max_level": [1, 2]}
    found = optics.sweep(problem(), ranges, tmp_path / "out", workers=1)
    table = rows(tmp_path / "out")
    assert [float(r["rel_l2"]) for r in table] == [1 / d for d in (200, 200, 300, 300, 400, 400)]
    assert [r["lens.rear.freeform.max_level"] for r in table] == ["1", "2"] * 3
    assert {r["status"] for r in table} == {"done"}
    assert found.counts()["done"] == 6
    for name in ("contact_sheet.png", "figures/rel_l2.png", "figures/dof.png"):
        assert (tmp_path / "out" / name).read_bytes().startswith(b"\x89PNG")
    assert not (tmp_path / "out" / "figures" / "estimator.png").exists()
    assert not (tmp_path / "out" / "figures" / "rounded.png").exists()


def test_values_below_a_picture_are_whole():
    row = SweepRow((209.0909090909091, 3, [30.5, 30.5, 1.25, 7.125]), "done")
    assert _texts(["distance", "level_of_refinement", "half_width"], row) == [
        "distance 209.091",
        "level_of_refinem 3",
        "[30.5, 30.5, 1.25,",
    ]


def test_the_page_is_one_file_that_loads_nothing(by, tmp_path):
    optics.sweep(problem(title="a <b> & TITLE"), DISTANCES, tmp_path, workers=1)
    page = (tmp_path / "sweep.html").read_text("utf-8")
    assert "a &lt;b&gt; &amp; TITLE" in page
    assert page.count("<tr") == 4
    assert not re.findall(r"""(?:src|href)=["'](?!data:)|https?://|@import|url\(""", page)
    assert 'data-v="0.0033333333333333335"' in page


def test_what_is_stored_is_not_computed_again_and_more_values_are_added(by, tmp_path):
    optics.sweep(problem(), DISTANCES, tmp_path, workers=1)
    before = rows(tmp_path)
    by(picky)
    with pytest.raises(UserError, match="number of workers"):
        optics.sweep(problem(), DISTANCES, tmp_path, workers=0)
    again = optics.sweep(problem(), DISTANCES, tmp_path, workers=1, resume=True)
    assert rows(tmp_path) == before
    assert again.counts()["done"] == 3
    more = optics.sweep(problem(), {"target.distance": [200, 250, 400]}, tmp_path, workers=1)
    assert [row.status for row in more.rows] == ["done"] * 3


@pytest.mark.slow
def test_failing_and_killed_variants_are_rows(design, tmp_path):
    design(picky)
    found = optics.sweep(problem(), DISTANCES, tmp_path, workers=2)
    assert [row.status for row in found.rows] == ["done", "failed", "killed"]
    assert rows(tmp_path)[1]["sentence"] == "300 mm is too far; come nearer"
    assert "its worker ended" in rows(tmp_path)[2]["sentence"]


def test_equal_variants_are_computed_once(by, tmp_path):
    moments = []
    ranges = {"run.threads": [1, 2], "target.distance": [200, 300]}
    found = optics.sweep(problem(), ranges, tmp_path, workers=1, progress=moments.append)
    assert [row.metrics["rel_l2"] for row in found.rows] == [1 / 200, 1 / 300] * 2
    assert any(m.detail == "2 of 2 over, 0 failed" for m in moments)
    assert moments[-1].fraction == 1


def test_parquet_holds_the_same_table(by, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    found = optics.sweep(problem(), DISTANCES | {"lens.rear.half_width": [[50, 50]]}, tmp_path, workers=1)
    table = parquet.read_table(tmp_path / "sweep.parquet").to_pydict()
    assert table["rel_l2"] == [row.metrics["rel_l2"] for row in found.rows]
    assert table["lens.rear.half_width"] == ["[50, 50]"] * 3


def test_records_are_values_and_tables_hold_them_as_json(by, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    free = problem().lens.rear.freeform
    ranges = {"lens.rear.freeform": [replace(free, max_level=level) for level in (1, 2)]}
    found = optics.sweep(problem(), ranges, tmp_path, workers=1)
    assert [row.metrics["dof"] for row in found.rows] == [1, 2]
    for texts in (
        [row["lens.rear.freeform"] for row in rows(tmp_path)],
        parquet.read_table(tmp_path / "sweep.parquet").to_pydict()["lens.rear.freeform"],
    ):
        assert [json.loads(text)["max_level"] for text in texts] == [1, 2]


@pytest.mark.parametrize("whole", [False, True])
def test_files_travel_wherever_a_variant_names_them(by, tmp_path, whole):
    by(reading)
    paths = [tmp_path / "dark.png", tmp_path / "bright.png"]
    for path, level in zip(paths, (10, 200)):
        path.write_bytes(png(level))
    given = problem(**PICTURE, **{"target.image": str(paths[0])})
    tables = [replace(given.target, image=str(path)) for path in paths]
    ranges = {"target": tables} if whole else {"target.image": paths}
    found = optics.sweep(given, ranges, tmp_path / "out", workers=1)
    assert [row.metrics.get("level") for row in found.rows] == [10, 200]


def test_another_sweep_and_files_of_others_are_refused_unless_forced(by, tmp_path):
    optics.sweep(problem(), DISTANCES, tmp_path, workers=1)
    for other, ranges in (
        (problem(), {"lens.thickness": [10.0]}),
        (problem(**{"lens.index": 1.6}), DISTANCES),
    ):
        with pytest.raises(UserError, match="holds another sweep"):
            optics.sweep(other, ranges, tmp_path, workers=1)
    (tmp_path / "sweep.csv").write_text("mine")
    with pytest.raises(UserError, match=r"sweep\.csv would be replaced.*what is computed stays"):
        optics.sweep(problem(), DISTANCES, tmp_path, workers=1)
    by(None)  # nothing is computed again
    assert len(optics.sweep(problem(), DISTANCES, tmp_path, workers=1, resume=True, force=True).rows) == 3
    by(quick)
    found = optics.sweep(problem(), {"target.distance": [500]}, tmp_path, workers=1, force=True)
    assert len(rows(tmp_path)) == len(found.rows) == 1


def test_no_more_workers_start_than_there_are_variants_to_compute(by, tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr(running, "worker_pool", lambda *found: asked.append(found) or thread_pool(*found))
    optics.sweep(problem(), {"target.distance": [200.0]}, tmp_path, workers=40)
    optics.sweep(problem(), DISTANCES, tmp_path, workers=40)
    assert asked == [(40, None, 1), (40, None, 2)]


def test_workers_that_are_lost_before_the_first_result_leave_nothing_to_resume(by, tmp_path, monkeypatch):
    """The sentence says what the next command does: begin anew, or go on where something is stored."""

    def lost(after):
        def run(function, items, pool, common):
            yield from islice(run_tasks(function, items, pool, common), after)
            raise UserError("the scheduler does not answer any more")

        return run

    for after, words in (
        (0, "no variant was stored, so that the same command begins anew"),
        (1, "--resume goes on"),
    ):
        monkeypatch.setattr(running, "run_tasks", lost(after))
        with pytest.raises(UserError, match=f"the scheduler does not answer any more; .*{words}"):
            optics.sweep(problem(), DISTANCES, tmp_path / f"out{after}", workers=1)
        monkeypatch.setattr(running, "run_tasks", run_tasks)
        found = optics.sweep(problem(), DISTANCES, tmp_path / f"out{after}", workers=1, resume=bool(after))
        assert len(found.rows) == 3


def test_a_device_as_a_picture_is_refused_and_not_read_to_its_end(by, tmp_path):
    image = {"kind": "image", "image": "/dev/zero", "distance": 300.0, "half_width": (100, 100)}
    endless = problem().with_(target=image)
    with pytest.raises(UserError, match=r"cannot read /dev/zero: it is a pipe or a device"):
        optics.sweep(endless, DISTANCES, tmp_path / "out")


def test_there_must_be_something_to_resume(by, tmp_path):
    with pytest.raises(UserError, match="nothing to resume"):
        optics.sweep(problem(), DISTANCES, tmp_path / "none", resume=True)
    assert not (tmp_path / "none").exists()


def test_a_sweep_that_cannot_begin_leaves_nothing_behind(design, tmp_path):
    with pytest.raises(UserError, match="number of workers"):
        running.sweep(problem(), DISTANCES, tmp_path / "none", workers=0)
    assert not (tmp_path / "none").exists()


def test_lenses_of_several_free_elements_are_not_kept(by, tmp_path):
    beam = {"kind": "collimated", "half_width": (8, 8)}
    glass = {"kind": "lens", "index": 1.5, "thickness": 5, "rear": {"half_width": (10, 10)}}
    mirror = {"kind": "mirror", "thickness": 4, "tilt": (45, 0, 0), "position": (0, 0, 40)}
    row = [glass | {"name": "L1", "front": {"half_width": (10, 10)}}, mirror | {"name": "M1"}]
    row[1]["face"] = {"half_width": (12, 17), "freeform": {}}
    target = {"kind": "tophat", "position": (0, 60, 40), "tilt": (-90, 0, 0), "half_width": (10, 10)}
    rowed = Problem(source=beam, element=row, target=target | {"pixels": (8, 8)})
    with pytest.raises(UserError, match=r"got element.L1 and element.M1; leave the lenses out"):
        optics.sweep(rowed, {"element.M1.thickness": [4, 5]}, tmp_path / "out", keep_lenses=True)
    assert not (tmp_path / "out").exists()


def lens_of_300(folder):
    """Return the text of the lens of 300 mm that the store holds."""
    return kept_lens(folder / "sweep.sqlite", fingerprint(problem(**{"target.distance": 300})))


def test_a_kept_lens_is_in_the_store(by, tmp_path):
    optics.sweep(problem(), DISTANCES, tmp_path, workers=1, keep_lenses=True)
    assert lens_of_300(tmp_path) == '{"lens": 1}'
    by(None)  # nothing is computed again
    optics.sweep(problem(), DISTANCES, tmp_path, workers=1)
    optics.sweep(problem(), DISTANCES, tmp_path, workers=1, keep_lenses=True)
    assert lens_of_300(tmp_path) == '{"lens": 1}'


def test_lenses_that_were_not_kept_are_designed_again(by, tmp_path):
    optics.sweep(problem(), DISTANCES, tmp_path, workers=1)
    assert lens_of_300(tmp_path) == ""
    optics.sweep(problem(), DISTANCES, tmp_path, workers=1, keep_lenses=True)
    assert lens_of_300(tmp_path) == '{"lens": 1}'


def test_only_what_failed_is_tried_again(by, tmp_path):
    by(without_memory)
    found = optics.sweep(problem(), DISTANCES, tmp_path, workers=1)
    assert [row.status for row in found.rows] == ["done", "failed", "done"]
    by(quick)
    moments = []
    again = optics.sweep(problem(), DISTANCES, tmp_path, workers=1, progress=moments.append)
    assert [row.status for row in again.rows] == ["done"] * 3
    assert again.rows[1].metrics["rel_l2"] == 1 / 300
    assert any(moment.detail == "1 of 1 over, 0 failed" for moment in moments)


def test_a_picture_that_is_not_there_is_one_sentence(by, tmp_path):
    missing = problem(**PICTURE, **{"target.image": str(tmp_path / "none.png")})
    with pytest.raises(UserError, match=r"cannot read .*none.png: No such file"):
        optics.sweep(missing, DISTANCES, tmp_path / "out")
    assert not (tmp_path / "out").exists()
