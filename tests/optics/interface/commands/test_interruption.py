"""Ctrl-C: what is left of a run, and how it goes on."""

import errno
import json
import re
import shlex
import shutil
import signal
import time
from types import SimpleNamespace

import pytest

from optics.base.runtime import ProcessEnded
from optics.designing.optimisation import Interrupted, State
from optics.interface.commands import main
from optics.interface.commands.design_command import resuming
from tests.optics.cases import picture, write_problem
from tests.optics.exchange.results.cases import some_state
from tests.optics.interface.commands.cases import QUICK, command, raising, refused, strict_json

LONG = {
    "optimizer.start": "flat",
    "optimizer.iterations": [2, 2, 2000],
    "target.pixels": [64, 64],
    "refinement.alpha": [0.0],
    "lens.rear.freeform.spans": [2, 2],
}


@pytest.fixture(scope="module")
def stopped(tmp_path_factory):
    """A long design stopped by Ctrl-C once its first checkpoint was written: folder, exit code, stderr."""
    folder = tmp_path_factory.mktemp("stopped")
    problem, out = write_problem(folder, LONG), folder / "out"
    process = command("design", problem, "--out", out)
    while not (out / "checkpoint.json").exists() and process.poll() is None:
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    _, stderr = process.communicate()
    return SimpleNamespace(folder=folder, code=process.returncode, stderr=stderr)


@pytest.fixture
def stopped_copy(stopped, tmp_path):
    """A copy of the stopped run: (problem file, result folder)."""
    folder = shutil.copytree(stopped.folder, tmp_path / "copy")
    return folder / "problem.toml", folder / "out"


def test_ctrl_c_ends_with_130_and_leaves_a_checkpoint(stopped):
    assert stopped.code == 130
    assert "Traceback" not in stopped.stderr
    assert len(strict_json((stopped.folder / "out" / "checkpoint.json").read_text())["history"]) > 0


def test_ctrl_c_says_what_was_reached_and_the_command_line_that_goes_on(stopped):
    """A level's misfit is its rel_l2 on the optimiser's own pixels, and the lens that of the best row."""
    out = stopped.folder / "out"
    history = strict_json((out / "checkpoint.json").read_text())["history"]
    reached, level, command = re.search(
        r"rel_l2 (\S+) so far, on the light that level (\d) is .*; to go on: (.*)", stopped.stderr
    ).groups()
    words = shlex.split(command)
    assert words == ["thbcad", "design", str(stopped.folder / "problem.toml"), "--out", str(out), "--resume"]
    fits = [row[4] for row in history if row[6] == history[-1][6]]
    assert int(level) == history[-1][0]
    assert float(reached) == pytest.approx(min(fits), rel=6e-3)


@pytest.mark.parametrize(
    ("words", "command"),
    [
        (["design", "a b.toml", "--from", "old", "-q"], "thbcad design 'a b.toml' -q --resume"),
        (["design", "--from=old", "a.toml", "--resume"], "thbcad design a.toml --resume"),
        (["design", "a.toml", "--set", 'title="x"'], """thbcad design a.toml --set 'title="x"' --resume"""),
    ],
)
def test_the_command_line_that_goes_on_can_be_copied(words, command):
    assert resuming(words) == command


def test_a_stopped_design_is_no_result_yet(stopped_copy, tmp_path, capsys):
    _, out = stopped_copy
    said = refused(capsys, "export", out, "--out", tmp_path / "part.stl")
    assert f"the design in {out} was stopped; end it by its problem file and --resume" in said


@pytest.mark.slow
def test_resume_finishes_what_ctrl_c_stopped(stopped_copy, capsys):
    """The last level ends by itself when L-BFGS converges."""
    problem, out = stopped_copy
    before = strict_json((out / "checkpoint.json").read_text())["history"]
    assert main(["design", str(problem), "--out", str(out), "--resume", "--json"]) == 0
    metrics = strict_json(capsys.readouterr().out)["metrics"]
    assert metrics["levels"] == 3
    assert metrics["evaluations"] > len(before)
    assert metrics["rel_l2"] < 0.3
    assert not (out / "checkpoint.json").exists()
    assert main(["verify", str(out), "--no-optiland"]) == 0


@pytest.mark.parametrize(
    "changes",
    [{"target.distance": 70.0}, {"lens.rear.radius": 45.0}, {"run.seed": 3}, {"title": "other"}],
    ids=str,
)
def test_resume_with_another_problem_is_refused(stopped_copy, capsys, changes):
    problem, out = stopped_copy
    kept = (out / "checkpoint.json").read_bytes()
    write_problem(problem.parent, LONG | changes)
    said = refused(capsys, "design", problem, "--out", out, "--resume")
    assert "belongs to another problem; resume it with the keys it was stopped with and go on" in said
    assert (out / "checkpoint.json").read_bytes() == kept


def test_resume_with_another_picture_is_refused(stopped_copy, capsys):
    """The picture is the problem's heart: the same file name does not make it the same one."""
    problem, out = stopped_copy
    write_problem(problem.parent, LONG, image=picture()[::-1].copy())
    assert "belongs to another problem" in refused(capsys, "design", problem, "--out", out, "--resume")


@pytest.mark.parametrize(
    "text",
    ["", "{", "[]", "null", "3", '{"schema": "thbcad-checkpoint"}', "\x00", "[" * 100_000],
    ids=lambda t: repr(t[:20]),
)
def test_a_checkpoint_that_is_none_is_refused(stopped_copy, capsys, text):
    problem, out = stopped_copy
    (out / "checkpoint.json").write_text(text)
    assert "cannot resume" in refused(capsys, "design", problem, "--out", out, "--resume")


WRONG = [
    *(("stage", v) for v in ("two", None, -1, 1.5, 99, [1])),
    *(("sags", v) for v in (3, {}, [], [3], [{}], None, "x")),
    *(("history", v) for v in (3, [[0]], [["x"] * 7], [[10**400, *[0] * 7]])),
    ("version", 2),
    ("version", 3),
    ("moved", "maybe"),
]


@pytest.mark.slow
def test_a_checkpoint_with_a_wrong_entry_is_refused(stopped_copy, capsys):
    problem, out = stopped_copy
    data = json.loads((out / "checkpoint.json").read_text())
    for key, value in WRONG:
        (out / "checkpoint.json").write_text(json.dumps(data | {key: value}))
        said = refused(capsys, "design", problem, "--out", out, "--resume")
        assert "cannot resume" in said, (key, value)


def test_resume_without_a_checkpoint_is_refused(tmp_path, capsys):
    message = refused(capsys, "design", write_problem(tmp_path), "--out", tmp_path / "out", "--resume")
    assert "nothing to resume" in message


@pytest.mark.slow
def test_a_finished_result_goes_on_with_more_iterations(copy, golden, capsys):
    before = strict_json((copy / "metrics.json").read_text())
    problem = str(golden.problem)
    assert main(["design", problem, "--out", str(copy), "--resume", "--iterations", "9", "--json"]) == 0
    captured = capsys.readouterr()
    metrics = strict_json(captured.out)["metrics"]
    assert metrics["rel_l2"] < before["rel_l2"]
    assert "goes on from the finished result" in captured.err
    assert any("goes on from the finished result" in sentence for sentence in metrics["notes"])
    assert "iterations = [9]" in (copy / "problem.toml").read_text()


@pytest.mark.parametrize("options", [["--iterations", "9"], ["--resume", "--iterations", "0"]], ids=str)
def test_more_iterations_need_a_run_to_resume(tmp_path, capsys, options):
    problem = write_problem(tmp_path)
    assert "--iterations" in refused(capsys, "design", problem, "--out", tmp_path / "out", *options)


@pytest.mark.slow
def test_going_on_from_a_finished_result_keeps_what_was_changed_since(copy, golden, capsys):
    (copy / "problem.toml").write_text("# mine\n" + (copy / "problem.toml").read_text())
    message = refused(capsys, "design", golden.problem, "--out", copy, "--resume", "--iterations", "9")
    assert "problem.toml would be replaced" in message


@pytest.mark.usefixtures("no_helpers")
def test_interrupted_over_another_problems_checkpoint_it_does_not_promise_to_resume(
    stopped_copy, capsys, monkeypatch
):
    problem, out = stopped_copy
    write_problem(problem.parent, LONG | {"title": "other"})
    monkeypatch.setattr("optics.interface.api.design_run.shape_lens", raising(KeyboardInterrupt))
    assert main(["design", str(problem), "--out", str(out), "--force"]) == 130
    assert "nothing was kept" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.usefixtures("no_helpers")
def test_a_run_that_went_on_with_other_iterations_goes_on_once_more(tmp_path, capsys, monkeypatch):
    """Also where the problem leaves a number to the program: resolved, it is not what was asked for."""
    interrupted = raising(Interrupted(some_state()))
    monkeypatch.setattr("optics.interface.api.design_run.shape_lens", interrupted)
    problem = write_problem(tmp_path, {"lens.rear.freeform.max_level": "auto"})
    arguments = ["design", str(problem), "--out", str(tmp_path / "out")]
    for more in ([], ["--resume", "--iterations", "9"], ["--resume"], ["--resume", "--iterations", "7"]):
        assert main([*arguments, *more]) == 130
        assert f"--out {tmp_path / 'out'}" in (said := capsys.readouterr().err)
        assert "to go on: thbcad design" in said


@pytest.mark.usefixtures("no_helpers")
@pytest.mark.parametrize(
    ("fault", "code"), [(ProcessEnded("a helper ended"), 3), (OSError(errno.ENOSPC, "No space left"), 2)]
)
def test_a_run_that_a_helper_or_the_disk_ends_says_how_it_goes_on(tmp_path, capsys, monkeypatch, fault, code):
    monkeypatch.setattr("optics.interface.api.write_result", raising(fault))
    problem = write_problem(tmp_path, {"optimizer.start": "flat", "optimizer.iterations": [1]})
    assert main(["design", str(problem), "--out", str(tmp_path / "out")]) == code
    assert re.search(r"so far.*; to go on: thbcad design .* --resume\n", capsys.readouterr().err)


@pytest.mark.slow
def test_a_lens_that_is_taken_as_it_is_is_taken_again_after_ctrl_c(golden, tmp_path, capsys, monkeypatch):
    """Claims go first, so that nothing but a checkpoint says whose files lie there."""
    problem, out = golden.path / "problem.toml", tmp_path / "out"
    words = ["design", str(problem), "--lens", str(golden.path / "lens.json"), "--out", str(out)]
    with monkeypatch.context() as patch:
        patch.setattr("optics.interface.api.design_files.light_files", raising(KeyboardInterrupt))
        assert main(words) == 130
    assert "the same command starts again" in capsys.readouterr().err
    assert (out / "problem.toml").exists()
    assert not (out / "result.json").exists()
    assert main(words) == 0
    assert not (out / "checkpoint.json").exists()


def test_a_problem_file_with_comments_beside_an_unfinished_run_is_kept(stopped_copy, capsys):
    problem, out = stopped_copy
    shutil.copy(problem.parent / "picture.png", out)
    asked = out / "problem.toml"
    text = "# mine\n" + problem.read_text()
    asked.write_text(text)
    message = refused(capsys, "design", asked, "--out", out, "--resume")
    assert "without its comments" in message
    assert asked.read_text() == text


def test_a_picture_that_changes_while_a_design_runs_ends_it(tmp_path, capsys, monkeypatch):
    problem = write_problem(tmp_path, QUICK)

    def shaped(system, *arguments):
        write_problem(tmp_path, QUICK, image=picture()[::-1].copy())
        return system.base, State(False, 0, system.base.sags)

    monkeypatch.setattr("optics.interface.api.design_run.shape_lens", shaped)
    message = refused(capsys, "design", problem, "--out", tmp_path / "out", "-q")
    assert "the picture or the rays that the problem names changed while the design ran" in message
    assert not (tmp_path / "out" / "result.json").exists()
