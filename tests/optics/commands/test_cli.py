"""The command line from outside: files, exit codes, messages, interruption."""

from __future__ import annotations

import csv
import json
import re
import shutil
import signal
import subprocess
import sys
import time
from html.parser import HTMLParser
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

from optics.commands import main
from optics.problem import load_problem
from tests.cases import ROOT
from tests.optics.cases import picture, write_problem
from tests.optics.commands.cases import FIGURES, QUICK, command, refused, strict_json


@pytest.fixture(scope="module")
def golden(tmp_path_factory):
    """A whole run as a process, on two threads: its folder, exit code, output, and the problem file."""
    folder = tmp_path_factory.mktemp("golden")
    problem = write_problem(folder, QUICK | {"run.threads": 2})
    process = command("design", problem, "--out", folder / "result", "--json", cwd=folder)
    stdout, stderr = process.communicate()
    return SimpleNamespace(
        path=folder / "result", problem=problem, code=process.returncode, stdout=stdout, stderr=stderr
    )


# A whole run


def test_a_design_ends_well(golden):
    assert (golden.code, golden.stderr.count("Traceback")) == (0, 0)


def test_the_result_folder_holds_what_the_design_contract_says(golden):
    names = {p.name for p in golden.path.iterdir()}
    checked = {"metrics.json", "verify.json", "manufacture.json"}
    wanted = {"problem.toml", "lens.json", "lens.step", "history.csv", "report.html", "figures"} | checked
    # the picture lies beside the problem file that names it; no checkpoint and no temporary file is left
    assert names == wanted | {"target.png"}
    assert {p.name for p in (golden.path / "figures").iterdir()} == {f"{name}.png" for name in FIGURES}
    for figure in (golden.path / "figures").iterdir():
        with Image.open(figure) as image:
            image.load()
            assert min(image.size) > 200


def test_results_go_to_stdout_and_progress_to_stderr(golden):
    data = strict_json(golden.stdout)
    assert data["metrics"] == strict_json((golden.path / "metrics.json").read_text())
    assert data["verify"] == strict_json((golden.path / "verify.json").read_text())
    assert re.search(r"level 1: \d+ DOF, \d+ evaluations, misfit 0\.\d+", golden.stderr)


def test_metrics_hold_what_the_design_contract_says(golden):
    metrics = strict_json((golden.path / "metrics.json").read_text())
    names = {
        "rel_l2",
        "psnr_db",
        "ssim",
        "rel_l2_floor",
        "efficiency",
        "stray",
        "dof",
        "levels",
        "evaluations",
        "wall_s",
        "peak_mb",
    }
    assert names <= set(metrics)
    assert {"setup", "optimise", "export", "verify", "total"} <= set(metrics["wall_s"])
    assert 0 < metrics["rel_l2_floor"] < metrics["rel_l2"] < 0.3
    assert 0.8 < metrics["efficiency"] <= 0.9216
    assert 0 <= metrics["stray"] < 0.1
    assert metrics["levels"] == 2
    assert metrics["peak_mb"] > 50
    phases = [seconds for name, seconds in metrics["wall_s"].items() if name != "total"]
    assert sum(phases) == pytest.approx(metrics["wall_s"]["total"], rel=0.2)


def test_the_history_is_a_table(golden):
    with (golden.path / "history.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == ["level", "dof", "evaluation", "loss", "fit", "seconds"]
    metrics = strict_json((golden.path / "metrics.json").read_text())
    assert int(rows[-1]["evaluation"]) == metrics["evaluations"]
    assert int(rows[-1]["dof"]) == metrics["dof"]
    assert float(rows[-1]["loss"]) < float(rows[0]["loss"])


def test_the_stored_problem_is_the_problem(golden):
    """Resolved, with every key, and with a copy of the picture beside it."""
    stored, given = load_problem(golden.path / "problem.toml"), load_problem(golden.problem)
    assert stored.target.image == str(golden.path / "target.png")
    assert (golden.path / "target.png").read_bytes() == (golden.problem.parent / "picture.png").read_bytes()
    assert vars(stored) | {"target": None} == vars(given) | {"target": None}


class References(HTMLParser):
    """Collects every attribute that could fetch something, and the tags."""

    def __init__(self):
        super().__init__()
        self.links, self.tags = [], []

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        self.links += [
            value
            for name, value in attributes
            if name in ("src", "href", "srcset", "data", "action", "poster", "background")
        ]


def test_the_report_is_self_contained(golden):
    text = (golden.path / "report.html").read_text("utf-8")
    page = References()
    page.feed(text)
    assert len(page.links) == len(FIGURES)
    assert all(link.startswith("data:image/png;base64,") for link in page.links)
    assert not {"script", "link", "iframe", "object"} & set(page.tags)
    without_pictures = re.sub(r"data:image/png;base64,[A-Za-z0-9+/=]+", "", text)
    assert not re.search(r"https?:|//|url\(|@import", without_pictures)


def test_the_report_shows_figures_checks_and_problem_with_names_escaped(golden):
    text = (golden.path / "report.html").read_text("utf-8")
    assert "quick &lt;b&gt;&quot;&amp;" in text
    assert "quick <b>" not in text
    assert "every check passed" in text
    for check in strict_json((golden.path / "verify.json").read_text())["checks"]:
        assert check["name"] in text
    for name in strict_json((golden.path / "metrics.json").read_text()):
        assert name in text
    assert "z_freedom = 1.0" in text


def test_the_result_can_be_designed_again_from_its_own_problem_file(golden, tmp_path, capsys):
    again = tmp_path / "again"
    assert main(["design", str(golden.path / "problem.toml"), "--out", str(again)]) == 0
    capsys.readouterr()
    old, new = (strict_json((folder / "lens.json").read_text()) for folder in (golden.path, again))
    assert new["rear"]["sag"]["refined"] == old["rear"]["sag"]["refined"]
    # two threads add in any order: rounding, enlarged by a few steps of L-BFGS
    np.testing.assert_allclose(
        new["rear"]["sag"]["coefficients"], old["rear"]["sag"]["coefficients"], rtol=0, atol=1e-6
    )


def test_text_for_people_names_the_files(tmp_path, capsys):
    problem = write_problem(tmp_path, QUICK | {"lens.rear.freeform.max_level": 0})
    assert main(["design", str(problem), "--out", str(tmp_path / "out")]) == 0
    out = capsys.readouterr().out
    assert "rel_l2" in out
    assert "lens.step" in out
    assert "report.html" in out
    assert "FAILED" not in out


# check and verify


def test_check_says_what_would_be_done(tmp_path, capsys):
    problem = write_problem(tmp_path, {"optimizer.start": "flat"})
    assert main(["check", str(problem)]) == 0
    out = capsys.readouterr().out
    assert "the problem is sound" in out
    assert "level 2: 48 x 48 pixels" in out
    assert "least thickness 6 mm at x = 0, y = 0 mm" in out


def test_check_as_json(tmp_path, capsys):
    assert main(["check", str(write_problem(tmp_path)), "--json"]) == 0
    data = strict_json(capsys.readouterr().out)
    # plane to paraboloid: 20 x 20 x 6 plus the integral of (x^2 + y^2) / 80
    assert data["volume_mm3"] == pytest.approx(2400 + 2 * 20 * (2 * 10**3 / 3) / 80, rel=1e-12)
    assert data["least_thickness_mm"] == pytest.approx(6.0, rel=1e-15 * 8)
    assert data["target_pixels"] == [48, 48]


def test_check_writes_nothing(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    problem = write_problem(tmp_path)
    before = sorted(tmp_path.rglob("*"))
    assert main(["check", str(problem)]) == 0
    assert sorted(tmp_path.rglob("*")) == before


@pytest.fixture
def copy(golden, tmp_path):
    """A copy of the golden result that a test may spoil."""
    return shutil.copytree(golden.path, tmp_path / "copy")


def test_verify_passes_an_untouched_result(copy, capsys):
    before = {p: p.read_bytes() for p in copy.rglob("*") if p.is_file()}
    assert main(["verify", str(copy), "--json"]) == 0
    assert strict_json(capsys.readouterr().out)["ok"] is True
    assert {p: p.read_bytes() for p in copy.rglob("*") if p.is_file()} == before


def test_verify_fails_a_changed_step_file(copy, capsys):
    text = (copy / "lens.step").read_text()
    number = re.search(
        r"CARTESIAN_POINT\('',\(-?\d+\.\d+,-?\d+\.\d+,\s*(\d\.\d{6})", text[text.index("B_SPLINE_SURFACE") :]
    )
    at = text.index("B_SPLINE_SURFACE") + number.end(1) - 1
    (copy / "lens.step").write_text(text[:at] + str((int(text[at]) + 1) % 10) + text[at + 1 :])
    assert main(["verify", str(copy)]) == 1
    captured = capsys.readouterr()
    assert "FAILED" in captured.out
    assert captured.err == ""


def test_verify_fails_a_changed_lens_file(copy, capsys):
    data = json.loads((copy / "lens.json").read_text())
    data["rear"]["sag"]["coefficients"][5] += 1e-6
    (copy / "lens.json").write_text(json.dumps(data))
    assert main(["verify", str(copy)]) == 1
    assert "FAILED" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("lens.step", "nonsense"),
        ("lens.json", "{"),
        ("lens.json", "[]"),
        ("lens.json", '{"schema": 1}'),
        ("problem.toml", "="),
    ],
)
def test_verify_refuses_damaged_files(copy, capsys, name, text):
    (copy / name).write_text(text)
    assert name in refused(capsys, "verify", copy)


@pytest.mark.parametrize("damage", ["refined", "knots", "coefficients", "degree", "radius", "deep"])
def test_verify_refuses_lens_files_with_wrong_contents(copy, capsys, damage):
    data = json.loads((copy / "lens.json").read_text())
    sag = data["rear"]["sag"]
    if damage == "refined":
        sag["refined"] = [[[99, 99]]]
    elif damage == "knots":
        sag["knots"][0][3] = "x"
    elif damage == "coefficients":
        sag["coefficients"] = sag["coefficients"][:-1]
    elif damage == "degree":
        sag["degree"] = 3
    elif damage == "radius":
        data["rear"]["radius"] = [1]
    text = json.dumps(data) if damage != "deep" else "[" * 100_000
    (copy / "lens.json").write_text(text)
    assert "lens.json" in refused(capsys, "verify", copy)


@pytest.mark.parametrize("name", ["lens.step", "lens.json", "problem.toml"])
def test_verify_refuses_a_result_with_a_missing_file(copy, capsys, name):
    (copy / name).unlink()
    assert name in refused(capsys, "verify", copy)


def test_verify_refuses_a_folder_without_result_and_a_file(tmp_path, capsys):
    assert "is not a result folder" in refused(capsys, "verify", tmp_path)
    assert "is not a result folder" in refused(capsys, "verify", tmp_path / "none")
    (tmp_path / "file").write_text("x")
    assert "is not a result folder" in refused(capsys, "verify", tmp_path / "file")


def test_verify_works_without_the_picture(copy):
    """The picture is not needed to check a solid."""
    (copy / "target.png").unlink()
    assert main(["verify", str(copy)]) == 0


# Bad input


@pytest.mark.parametrize("name", ["design", "check"])
def test_a_missing_problem_is_refused(tmp_path, capsys, name):
    assert "none.toml" in refused(capsys, name, tmp_path / "none.toml")


def test_a_missing_picture_is_refused(tmp_path, capsys):
    problem = write_problem(tmp_path)
    (tmp_path / "picture.png").unlink()
    assert "picture.png" in refused(capsys, "design", problem, "--out", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_black_picture_is_refused(tmp_path, capsys):
    problem = write_problem(tmp_path, image=np.zeros((8, 8), dtype=np.uint8))
    assert "black everywhere" in refused(capsys, "design", problem, "--out", tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", ["design", "check"])
def test_crossing_surfaces_are_refused_with_place_and_amount(tmp_path, capsys, name):
    """Front 1 mm before a rear of R = -20 mm, K = -1: at the corners the rear lies 200 / 40 - 1 = 4 mm before
    the front."""
    problem = write_problem(tmp_path, {"lens.thickness": 1.0, "lens.rear.radius": -20.0})
    options = ["--out", tmp_path / "out"] if name == "design" else []
    message = refused(capsys, name, problem, *options)
    assert re.search(r"surfaces cross: at x = -?10, y = -?10 mm the rear lies 4 mm before the front", message)
    assert "raise lens.thickness by more than 4 mm" in message
    assert not (tmp_path / "out").exists()


def test_a_conic_that_ends_inside_the_aperture_is_refused(tmp_path, capsys):
    problem = write_problem(tmp_path, {"lens.front.radius": 12.0})
    assert re.search(
        r"lens\.front: the conic .* ends at r = 12 mm, but the corner of the aperture lies at r = 14\.14",
        refused(capsys, "check", problem),
    )


def test_a_lens_without_light_is_refused(tmp_path, capsys):
    problem = write_problem(tmp_path, {"lens.rear.radius": 0.3, "target.distance": 400.0})
    assert "change the lens prescription" in refused(capsys, "design", problem, "--out", tmp_path / "out")


@pytest.mark.parametrize("out", ["file", "file/below"])
def test_a_result_path_that_is_a_file_is_refused(tmp_path, capsys, out):
    (tmp_path / "file").write_text("keep me")
    message = refused(capsys, "design", write_problem(tmp_path), "--out", tmp_path / out)
    assert "choose another with --out" in message
    assert (tmp_path / "file").read_text() == "keep me"


def test_an_old_result_stays_whole_until_the_new_one_is_there(tmp_path, monkeypatch):
    """Interrupted, a folder still holds the problem and the lens of the run before, which belong together."""
    out = tmp_path / "out"
    assert main(["design", str(write_problem(tmp_path, QUICK)), "--out", str(out)]) == 0
    before = (out / "problem.toml").read_text(), (out / "lens.json").read_text()

    def interrupted(*arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr("optics.optimisation.design", interrupted)
    assert (
        main(["design", str(write_problem(tmp_path, QUICK | {"lens.index": 1.6})), "--out", str(out)]) == 130
    )
    assert ((out / "problem.toml").read_text(), (out / "lens.json").read_text()) == before


def test_a_result_file_that_is_a_folder_is_refused(tmp_path, capsys):
    (tmp_path / "out" / "problem.toml").mkdir(parents=True)
    message = refused(capsys, "design", write_problem(tmp_path, QUICK), "--out", tmp_path / "out")
    assert "problem.toml: it is a folder" in message


@pytest.mark.parametrize(
    "changes",
    [
        {"lens.rear.freeform.spans": [1000, 1000], "lens.rear.freeform.max_level": 12},
        {"target.pixels": [4096, 4096], "optimizer.rays_per_pixel": 16.0, "lens.rear.freeform.max_level": 8},
    ],
    ids=str,
)
def test_sizes_are_checked_before_memory_is_taken(tmp_path, capsys, changes):
    """Values that the keys allow one by one ask together for 7e13 and 4e9 rays at once: a terabyte, and
    more."""
    message = refused(capsys, "check", write_problem(tmp_path, changes))
    assert re.search(r"memory|rays|too (large|many|big)", message)


def test_arguments_are_checked(capsys):
    for arguments in ([], ["paint"], ["design"], ["verify"], ["design", "a.toml", "--fast"]):
        with pytest.raises(SystemExit) as caught:
            main(arguments)
        assert caught.value.code == 2
        assert "usage: thbcad" in capsys.readouterr().err


@pytest.mark.parametrize(
    "arguments", [["--help"], ["design", "--help"], ["check", "--help"], ["verify", "--help"]], ids=" ".join
)
def test_help_ends_well(arguments, capsys):
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    assert caught.value.code == 0
    assert "usage: thbcad" in capsys.readouterr().out


def test_help_of_the_command_loads_nothing_heavy():
    code = (
        "import sys\nfrom optics.commands import main\n"
        "try:\n main(['--help'])\nexcept SystemExit: pass\n"
        "print([m for m in ('drjit', 'OCP', 'matplotlib', 'mitsuba', 'skimage') if m in sys.modules], "
        "file=sys.stderr)"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert result.stderr.strip() == "[]"


# Odd but good input


@pytest.mark.parametrize("changes", [{}, {"target.pixels": [3, 3]}, {"target.pixels": [2, 2]}], ids=str)
def test_a_picture_of_3_by_3_pixels_works(tmp_path, capsys, changes):
    image = np.array([[0, 90, 255], [10, 200, 30], [255, 0, 60]], dtype=np.uint8)
    problem = write_problem(tmp_path, QUICK | {"lens.rear.freeform.max_level": 0} | changes, image)
    assert main(["design", str(problem), "--out", str(tmp_path / "out"), "--json"]) == 0
    strict_json(capsys.readouterr().out)


def test_a_new_run_replaces_an_old_result(tmp_path, capsys):
    problem = write_problem(tmp_path, QUICK | {"lens.rear.freeform.max_level": 0})
    arguments = ["design", str(problem), "--out", str(tmp_path / "out"), "--json"]
    assert main(arguments) == 0
    first = strict_json(capsys.readouterr().out)
    write_problem(tmp_path, QUICK | {"lens.rear.freeform.max_level": 0}, picture()[::-1].copy())
    assert main(arguments) == 0
    second = strict_json(capsys.readouterr().out)
    assert first["metrics"]["rel_l2"] != second["metrics"]["rel_l2"]
    assert main(["verify", str(tmp_path / "out")]) == 0


# Interruption


LONG = {
    "optimizer.start": "flat",
    "optimizer.iterations": [2, 2, 2000],
    "target.pixels": [96, 96],
    "refinement.alpha": [0.0],
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
    assert "--resume goes on" in stopped.stderr
    assert len(strict_json((stopped.folder / "out" / "checkpoint.json").read_text())["history"]) > 0


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
    assert main(["verify", str(out)]) == 0


@pytest.mark.parametrize(
    "changes",
    [{"target.distance": 70.0}, {"lens.rear.radius": 45.0}, {"run.seed": 3}, {"title": "other"}],
    ids=str,
)
def test_resume_with_another_problem_is_refused(stopped_copy, capsys, changes):
    problem, out = stopped_copy
    kept = (out / "checkpoint.json").read_bytes()
    write_problem(problem.parent, LONG | changes)
    assert "belongs to another problem" in refused(capsys, "design", problem, "--out", out, "--resume")
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
    *(("level", v) for v in ("two", None, -1, 1.5, 99, [1])),
    *(("sags", v) for v in (3, {}, [], [3], [{}], None, "x")),
    *(("history", v) for v in (3, [[0]], [["x"] * 6])),
    ("version", 1),
    ("version", 3),
    ("begun", "maybe"),
]


@pytest.mark.parametrize(("key", "value"), WRONG, ids=str)
def test_a_checkpoint_with_a_wrong_entry_is_refused(stopped_copy, capsys, key, value):
    problem, out = stopped_copy
    data = json.loads((out / "checkpoint.json").read_text())
    (out / "checkpoint.json").write_text(json.dumps(data | {key: value}))
    assert "cannot resume" in refused(capsys, "design", problem, "--out", out, "--resume")


def test_resume_without_a_checkpoint_is_refused(tmp_path, capsys):
    message = refused(capsys, "design", write_problem(tmp_path), "--out", tmp_path / "out", "--resume")
    assert "nothing to resume" in message


# ---- from an earlier design ----


def test_a_run_starts_from_an_earlier_design(golden, tmp_path, capsys):
    """The first loss is that of the earlier surface, on its mesh; the result is no worse."""
    before = strict_json((golden.path / "metrics.json").read_text())
    last = (golden.path / "history.csv").read_text().splitlines()[-1].split(",")
    out = tmp_path / "out"
    assert (
        main(
            [
                "design",
                str(golden.path / "problem.toml"),
                "--out",
                str(out),
                "--from",
                str(golden.path),
                "--json",
            ]
        )
        == 0
    )
    metrics = strict_json(capsys.readouterr().out)["metrics"]
    first = (out / "history.csv").read_text().splitlines()[1].split(",")
    assert metrics["dof"] == before["dof"]
    assert first[:2] == last[:2]
    assert float(first[3]) < 1.2 * float(last[3])
    assert metrics["rel_l2"] < 1.05 * before["rel_l2"]


def test_earlier_designs_of_another_lens_are_refused(golden, tmp_path, capsys):
    other = write_problem(tmp_path, {"lens.rear.freeform.spans": [5, 4]})
    message = refused(capsys, "design", other, "--out", tmp_path / "out", "--from", golden.path)
    assert "differs in half_width, radius, conic, degree or spans" in message
    assert "exclude each other" in refused(
        capsys, "design", other, "--out", tmp_path / "out", "--from", golden.path, "--resume"
    )
    assert "lens.json" in refused(capsys, "design", other, "--out", tmp_path / "out", "--from", tmp_path)


@pytest.mark.parametrize("command", ["design", "check"])
def test_targets_beyond_the_reach_of_refraction_are_refused(command, tmp_path, capsys):
    """Index 1.5 bends by less than arccos(1 / 1.5) = 48.2 degrees; the last pixel lies (47 / 48 200 - 9.5) /
    60 aside."""
    problem = write_problem(tmp_path, {"target.half_width": [200.0, 20.0]})
    message = refused(capsys, command, problem)
    assert "72.2 degrees aside from the beam" in message
    assert "index 1.5 bends rays by less than 48.2 degrees" in message
