"""A result is one thing: read back whole or refused, and nothing of others is replaced."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from optics.base.runtime import UserError
from optics.exchange.results import ResultFolder, ResultWriter, write_checkpoint
from optics.exchange.results.folder_lock import run_lock
from optics.exchange.results.owned_files import sha256_of
from optics.exchange.results.result_files import FILES
from optics.scene.problem import load_problem
from optics.scene.system import System
from tests.cases import ROOT
from tests.optics.cases import picture, store_result
from tests.optics.exchange.results.cases import GLOW, some_state, write_glow
from tests.optics.scene.problem.cases import ROW, load_text
from thbcad.io import lens_to_dict, read_lens, write_lens

VERDICT = {"ok": True, "verdict": "fine", "notes": ["a note"]}


def write_all(folder, problem, lens=None, figures=("figures/sag.png",), parts=()):
    """Write a result with stand-ins for the solids and for what is claimed of them."""
    system = System(problem)
    writer = ResultWriter(folder, system.with_lens(lens or system.base))
    writer.write_design(some_state().history)
    steps = "lens.step", *parts
    for name in steps:
        writer.staged(name).write_text(f"solid of {problem.title}")
    writer.place_steps(steps)
    for name in figures:
        writer.write(name, name.encode())
    for name in ("manufacture.json", "verify.json", "metrics.json"):
        writer.write_claims(name, {"of": problem.title})
    writer.write("report.html", b"report")
    writer.finish(problem, VERDICT)


@pytest.fixture
def problem(problem_file):
    return load_problem(problem_file())


@pytest.fixture
def row(tmp_path):
    """A fixed lens, and a free mirror."""
    return load_text(tmp_path, ROW)


@pytest.fixture
def folder(tmp_path, problem):
    """The result of the small problem."""
    out = ResultFolder(tmp_path / "out")
    with out.taken(problem, force=False):
        write_all(out, problem)
    return out


def names(folder):
    return sorted(p.relative_to(folder.path).as_posix() for p in folder.path.rglob("*") if p.is_file())


def taken(folder, problem, force=False):
    with folder.taken(problem, force):
        pass


def other(problem_file, changes=None, image=None):
    return load_problem(problem_file(changes or {"target.distance": 70.0, "title": "other"}, image))


# ---- reading ----


def test_a_result_reads_back(folder, problem):
    result = folder.read()
    assert result.problem.lens == problem.lens
    assert lens_to_dict(result.lens) == lens_to_dict(System(problem).base)
    assert {k: result.record[k] for k in VERDICT} == VERDICT


def test_the_record_holds_the_hash_of_every_other_file(folder):
    record = json.loads((folder.path / "result.json").read_text())
    assert record["sha256"] == {n: sha256_of(folder.path / n) for n in names(folder) if n != "result.json"}
    assert record["step_sha256"] == record["sha256"]["lens.step"]


@pytest.mark.parametrize("name", ["metrics.json", "verify.json", "manufacture.json"])
def test_claims_name_their_run_and_their_solid(folder, name):
    data, record = (json.loads((folder.path / n).read_text()) for n in (name, "result.json"))
    assert {k: data[k] for k in ("run_id", "step_sha256")} == {
        k: record[k] for k in ("run_id", "step_sha256")
    }


def test_the_run_id_tells_problems_and_lenses_apart_but_not_folders(tmp_path, folder, problem, problem_file):
    def run_of(path, problem, lens=None):
        path.mkdir()
        write_all(ResultFolder(path), problem, lens)
        return json.loads((path / "result.json").read_text())["run_id"]

    lens = System(problem).base
    mine = run_of(tmp_path / "a", problem)
    assert mine == run_of(tmp_path / "b", folder.read().problem) == folder.read().record["run_id"]
    assert mine != run_of(tmp_path / "c", other(problem_file, {"run.seed": 1}), lens)
    thicker = type(lens)(lens.front, lens.rear, np.nextafter(lens.thickness, 10.0), lens.index)
    assert mine != run_of(tmp_path / "d", problem, thicker)


def test_comments_and_line_ends_of_the_problem_change_nothing(folder):
    text = folder.problem.read_bytes().replace(b"\n", b"\r\n")
    folder.problem.write_bytes(b"# mine\r\n" + text)
    assert folder.read().record["ok"]


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("thickness = 6.0", "thickness = 6.5"),
        ("degree = 3", "degree = 4"),
        ("radius = 40.0", "radius = 41.0"),
        ("flux = 1.0", "flux = 2.0"),
        ("seed = 0", "seed = 1"),
    ],
)
def test_a_changed_problem_is_refused(folder, old, new):
    text = folder.problem.read_text()
    assert old in text
    folder.problem.write_text(text.replace(old, new, 1))
    with pytest.raises(UserError, match=r"holds no single result: problem\.toml changed"):
        folder.read()


def test_a_changed_lens_is_refused(folder, problem):
    lens = System(problem).base
    write_lens(type(lens)(lens.front, lens.rear, 7.0, lens.index), folder.lens)
    with pytest.raises(UserError, match=r"holds no single result: lens\.json changed"):
        folder.read()


def test_a_changed_picture_is_refused(folder):
    Image.fromarray(picture()[::-1].copy()).save(folder.path / "target.png")
    with pytest.raises(UserError, match=r"target\.png belongs to another run"):
        folder.read()


@pytest.mark.parametrize("name", ["metrics.json", "verify.json", "manufacture.json"])
@pytest.mark.parametrize("text", ['{"run_id": "x"}', "{}", "[]"])
def test_claims_of_another_run_are_refused(folder, name, text):
    (folder.path / name).write_text(text)
    with pytest.raises(UserError, match=f"{name} belongs to another run"):
        folder.read()


RECORDS = [None, "", "{", "[]", "{}", '{"sha256": []}', '{"sha256": {}, "run_id": 3}']


@pytest.mark.parametrize("text", [*RECORDS, '{"sha256": {}, "run_id": "x", "ok": true}'])
def test_a_folder_without_its_record_is_refused(folder, text):
    path = folder.path / "result.json"
    path.unlink()
    if text is not None:
        path.write_text(text)
    with pytest.raises(UserError, match="run the design again"):
        folder.read()


def test_a_folder_that_a_run_writes_to_is_not_read(folder):
    with run_lock(folder.path, "mine"), pytest.raises(UserError, match="another run writes to"):
        folder.read()
    assert folder.read().record["ok"]


# ---- writing ----


def test_the_stored_problem_brings_its_pictures(tmp_path, problem_file):
    write_glow(tmp_path)
    given = problem_file(GLOW)
    folder = store_result(tmp_path / "out", load_problem(given), System(load_problem(given)).base)
    light = System(load_problem(given)).source.profile.light
    for name in ("picture.png", "glow.png", "problem.toml"):
        (tmp_path / name).unlink()
    stored = folder.read().problem
    assert {Path(p.image).parent for p in (stored.source, stored.target)} == {folder.path}
    np.testing.assert_array_equal(System(stored).source.profile.light, light)
    write_all(folder, stored, read_lens(folder.lens))  # onto itself
    assert folder.read().problem == stored


def test_the_history_is_written_with_every_digit(folder):
    lines = (folder.path / "history.csv").read_text().splitlines()
    assert lines[0] == "level,dof,evaluation,loss,fit,stage,fresh_fit"
    assert lines[1].endswith(",")
    assert [float(v) for v in lines[2].split(",")] == [0, 49, 2, 1 / 3, 1e-17, 0, 0.7]


def test_what_only_an_earlier_run_had_goes_away(folder, problem):
    assert "figures/sag.png" in names(folder)
    (folder.path / "figures" / "own.png").write_bytes(b"mine")
    with folder.taken(problem, force=False):
        write_all(folder, problem, figures=["figures/mesh.png"])
    assert "figures/sag.png" not in names(folder)
    assert {"figures/mesh.png", "figures/own.png"} <= set(names(folder))


def test_the_solids_of_fixed_elements_belong_to_the_result(folder, row):
    """They are read back as the record says, and go away with it; others of this kind stay."""
    with folder.taken(row, force=True):
        write_all(folder, row, parts=["L1.step"])
    (folder.path / "own.step").write_text("mine")
    assert "L1.step" in folder.read().record["sha256"]
    (folder.path / "L1.step").write_text("changed")
    with pytest.raises(UserError, match=r"holds no single result: L1\.step belongs to another run"):
        folder.read()
    with pytest.raises(UserError, match=r"L1\.step would be replaced, but was not written by this program"):
        taken(folder, row)
    with folder.taken(row, force=True):
        write_all(folder, row, parts=["L1.step"])
    with folder.taken(row, force=True):
        write_all(folder, row)
    assert [n for n in names(folder) if n.endswith(".step")] == ["lens.step", "own.step"]


def test_a_record_cannot_make_a_run_remove_other_files(folder, problem, tmp_path):
    (tmp_path / "precious").write_text("x")
    (folder.path / "notes.txt").write_text("x")
    record = json.loads((folder.path / "result.json").read_text())
    (folder.path / "own.step").write_text("x")
    precious = sha256_of(tmp_path / "precious")
    record["sha256"] |= {"../precious": precious, "notes.txt": "0", "own.step": "0"}
    (folder.path / "result.json").write_text(json.dumps(record))
    with folder.taken(problem, force=False):
        write_all(folder, problem)
    assert (tmp_path / "precious").exists()
    assert (folder.path / "notes.txt").exists()
    assert (folder.path / "own.step").exists()


def test_a_name_that_no_result_has_is_not_written(folder, problem):
    system = System(problem)
    writer = ResultWriter(folder, system)
    writer.write_design(())
    for name in ("../x.png", "notes.txt", "figures/other.png"):
        with pytest.raises(ValueError, match="is no file of a result"):
            writer.write(name, b"")


# ---- what may be replaced ----


def test_the_same_problem_replaces_its_own_result(folder, problem, problem_file):
    for same in (problem, folder.read().problem, load_problem(problem_file({"run.threads": 2}))):
        with folder.taken(same, force=False):
            write_all(folder, same, read_lens(folder.lens))
        assert folder.read().record["ok"]


def test_another_problems_result_is_kept(folder, problem_file):
    before = names(folder)
    with pytest.raises(
        UserError, match=r"result of another problem, 'small'.*differs in title, target\.distance"
    ):
        taken(folder, other(problem_file))
    assert names(folder) == before
    taken(folder, other(problem_file), force=True)


def test_another_picture_is_another_problem(folder, problem_file):
    with pytest.raises(UserError, match="differs in a picture"):
        taken(folder, other(problem_file, {"title": "small"}, picture()[::-1].copy()))


@pytest.mark.parametrize("name", [*FILES, "target.png"])
def test_files_of_others_are_kept(tmp_path, problem, name):
    folder = ResultFolder(tmp_path / "out")
    path = folder.path / name
    path.parent.mkdir(parents=True)
    path.write_bytes(b"mine")
    with pytest.raises(UserError, match="was not written by this program"):
        taken(folder, problem)
    assert path.read_bytes() == b"mine"
    taken(folder, problem, force=True)


@pytest.mark.parametrize(
    "name", ["problem.toml", "target.png", "lens.step", "figures/sag.png", "verify.json"]
)
def test_files_that_were_changed_since_are_kept(folder, problem, name):
    path = folder.path / name
    path.write_bytes(path.read_bytes() + b"\n")
    with pytest.raises(UserError, match="was changed since"):
        taken(folder, problem)


def test_files_of_other_names_do_not_matter(tmp_path, problem):
    folder = ResultFolder(tmp_path / "out")
    folder.path.mkdir()
    (folder.path / "notes.txt").write_text("x")
    taken(folder, problem)
    assert names(folder) == ["notes.txt"]


def test_another_problems_checkpoint_is_kept(tmp_path, problem, problem_file):
    folder = ResultFolder(tmp_path / "out")
    folder.path.mkdir()
    write_checkpoint(folder.checkpoint, problem, problem, some_state())
    before = folder.checkpoint.read_bytes()
    taken(folder, problem)
    with pytest.raises(UserError, match="unfinished run of another problem, 'small'"):
        taken(folder, other(problem_file))
    assert folder.checkpoint.read_bytes() == before
    assert folder.has_run_of(problem)
    assert not folder.has_run_of(other(problem_file))
    taken(folder, other(problem_file), force=True)


# ---- the folder and its lock ----


def test_one_run_at_a_time(folder, problem):
    with (
        folder.taken(problem, force=False),
        pytest.raises(UserError, match=f"another run writes to .*process {os.getpid()}, 'small'"),
    ):
        taken(folder, problem)
    taken(folder, problem)
    assert not (folder.path / ".lock").exists()


def test_a_killed_process_leaves_no_lock(tmp_path):
    code = (
        "import os, signal, sys; from pathlib import Path\n"
        "from optics.exchange.results.folder_lock import run_lock\n"
        "with run_lock(Path(sys.argv[1]), 'x'): os.kill(os.getpid(), signal.SIGKILL)"
    )
    subprocess.run([sys.executable, "-c", code, tmp_path], cwd=ROOT, check=False)
    assert (tmp_path / ".lock").exists()
    with run_lock(tmp_path, "mine"):
        pass


def test_half_written_files_of_a_killed_run_go_away(folder, problem):
    for name in (
        ".lens.json.a1b2c3d4",
        ".target.png.abcdefgh",
        "figures/.sag.png.abcdefgh",
        ".lens.step.00000012",
        ".L1.step.00000012",
    ):
        (folder.path / name).write_bytes(b"half")
    before = {n for n in names(folder) if "/." not in n and not n.startswith(".")}
    (folder.path / ".bashrc").write_text("mine")
    taken(folder, problem)
    assert set(names(folder)) == before | {".bashrc"}


def test_a_run_that_is_stopped_leaves_no_half_written_file(tmp_path, problem):
    """Nor the folder, where nothing else lies in it."""
    folder = ResultFolder(tmp_path / "out")

    def stopped():
        with folder.taken(problem, force=False):
            (folder.path / ".lens.step.00000012").write_bytes(b"half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        stopped()
    assert not folder.path.exists()


def test_a_refused_run_leaves_no_folder(tmp_path, problem):
    folder = ResultFolder(tmp_path / "out")
    with pytest.raises(RuntimeError), folder.taken(problem, force=False):
        raise RuntimeError
    assert not folder.path.exists()


def test_nothing_is_left_where_a_folder_cannot_be_made(tmp_path, problem):
    (tmp_path / "file").write_text("x")
    before = sorted(p.name for p in tmp_path.iterdir())
    with pytest.raises(
        UserError,
        match=r"cannot write to the result folder .*file/out: .*file is no folder; choose another with --out",
    ):
        taken(ResultFolder(tmp_path / "file" / "out"), problem)
    assert sorted(p.name for p in tmp_path.iterdir()) == before


@pytest.mark.parametrize("out", ["link", "link/below"])
def test_a_link_that_leads_nowhere_is_named_with_where_it_leads(tmp_path, problem, out):
    (tmp_path / "link").symlink_to("gone")
    with pytest.raises(
        UserError, match=r"folder .*: .*link is a link to gone, which does not exist; choose another with"
    ):
        taken(ResultFolder(tmp_path / out), problem)
    assert not (tmp_path / "gone").exists()


def test_a_name_that_no_cad_kernel_takes_is_refused_before_it_is_made(tmp_path, problem):
    with pytest.raises(UserError, match=r"out\\xdcff: its name is no UTF-8 text"):
        taken(ResultFolder(tmp_path / "out\udcff"), problem)
    assert not (tmp_path / "out\udcff").exists()


@pytest.mark.parametrize("name", ["lens.json", "target.png", "checkpoint.json", "figures/sag.png"])
def test_a_folder_in_the_way_is_named(tmp_path, problem, name):
    folder = ResultFolder(tmp_path / "out")
    (folder.path / name).mkdir(parents=True)
    with pytest.raises(UserError, match=f"cannot write .*{name}: it is a folder"):
        taken(folder, problem, force=True)


def test_what_lies_in_the_place_of_the_figures_folder_is_named(folder, problem):
    """Before anything is done: the result that lies there stays whole."""
    for path in (folder.path / "figures").iterdir():
        path.unlink()
    (folder.path / "figures").rmdir()
    (folder.path / "figures").write_text("mine")
    with pytest.raises(UserError, match="figures is no folder; move it"), folder.taken(problem, force=True):
        pass
    assert folder.has_result()


def test_files_of_others_beside_an_unfinished_run_over_a_result_are_kept(folder, problem):
    write_checkpoint(folder.checkpoint, problem, problem, some_state())
    with folder.taken(problem, force=False):
        pass
    (folder.path / "report.html").write_text("my notes")
    with pytest.raises(UserError, match=r"report.html would be replaced"), folder.taken(problem, force=False):
        pass


def test_the_problem_file_of_a_stopped_run_is_its_own_and_one_with_comments_is_not(folder):
    """The record is gone, as behind a run that was stopped while it wrote."""
    (folder.path / "result.json").unlink()
    folder.require_kept(folder.problem)
    folder.problem.write_text("# mine\n" + folder.problem.read_text("utf-8"), "utf-8")
    with pytest.raises(UserError, match="without its comments"):
        folder.require_kept(folder.problem)
