"""`thbcad verify --light`: checks, files and the exit code; refusals in one sentence."""

import errno

import numpy as np
import pytest

from optics.exchange.results import sha256_of
from optics.interface.commands.cli import main
from optics.scene.problem import load_problem
from optics.scene.system import System
from tests.optics.cases import store_result, write_problem
from tests.optics.interface.commands.cases import data_of, printed, raising, refused, strict_json
from thbcad import write_step


@pytest.fixture
def result(tmp_path):
    """A result folder with a solid."""
    problem = load_problem(write_problem(tmp_path))
    system = System(problem)
    folder = store_result(tmp_path / "result", problem, system.base)
    write_step(system.base, folder.step, system.product)
    return folder.path


@pytest.mark.slow
def test_the_light_of_the_file_is_checked_and_kept(capsys, result):
    arguments = ["--no-optiland", "--light", "occt", "--rays", "1e3"]
    told = data_of(capsys, "verify", result, *arguments, code=1)  # nothing measured lies in this folder
    assert [c["name"] for c in told["checks"] if not c["ok"]] == ["light of the result"]
    light = result / "verify_light"
    kept = strict_json((light / "light_occt.json").read_text("utf-8"))
    shown = {"light_occt.png", "light_occt.html"}
    assert kept["sha256"] == {name: sha256_of(light / name) for name in shown}
    assert {p.name for p in light.iterdir()} == {"light_occt.json", *shown}
    page = (light / "light_occt.html").read_text("utf-8")
    assert "data:image/png;base64," in page
    assert "z-score" in page
    assert kept["rays"] == told["light"]["rays"] == 1000
    assert kept["checks"] == [c for c in told["checks"] if c in kept["checks"]]
    assert len(kept["checks"]) == 4


@pytest.mark.slow
def test_a_file_with_other_light_fails(capsys, result):
    text = (result / "lens.step").read_text("ascii")
    (result / "lens.step").write_text(text.replace("refractive index 1.5", "refractive index 1.6"), "ascii")
    arguments = ["--no-optiland", "--light", "occt", "--rays", "1000", "--out", str(result / "there")]
    lines = printed(capsys, "verify", result, *arguments, code=4).splitlines()
    failures = [line for line in lines if line.startswith("FAILED")]
    assert any("random rays by occt" in line and "landing points" in line for line in failures)
    assert (result / "there" / "light_occt.png").exists()


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["--light", "occt", "--rays", "0"], "--rays must lie between 1000 and 1000000 for occt"),
        (["--light", "occt", "--rays", "many"], "--rays must be a whole number"),
        (["--light", "occt", "--rays", "1000.5"], "--rays must be a whole number"),
        (["--light", "optiland", "--rays", "1e7"], "about 500 rays a second, got 10000000"),
        (["--rays", "1000"], "--rays goes with --light"),
        (["--out", "there"], "--out goes with --light"),
    ],
)
def test_options_that_do_not_fit_are_refused(capsys, result, arguments, word):
    assert word in refused(capsys, "verify", result, *arguments)
    assert not (result / "verify_light").exists()


def test_a_step_file_by_itself_has_no_light_to_compare_with(capsys, result):
    assert "give its result folder" in refused(capsys, "verify", result / "lens.step", "--light", "occt")


def test_the_step_of_something_else_is_refused(capsys, result):
    (result / "lens.step").write_text("no STEP file", "utf-8")
    message = refused(capsys, "verify", result, "--light", "occt", "--no-optiland")
    assert "lens.step is not a whole STEP file" in message


def test_what_another_program_wrote_is_not_replaced(capsys, result):
    (result / "verify_light").mkdir()
    (result / "verify_light" / "light_occt.png").write_text("mine", "utf-8")
    message = refused(capsys, "verify", result, "--light", "occt", "--no-optiland")
    assert "light_occt.png would be replaced" in message


@pytest.mark.parametrize(
    ("arguments", "fails"), [([], "prescription_checks"), (["lens.step"], "bare_checks")]
)
@pytest.mark.parametrize("error", [ValueError("shapes differ"), np.linalg.LinAlgError("singular")])
def test_a_check_that_breaks_is_no_bad_input(capsys, result, monkeypatch, arguments, fails, error):
    monkeypatch.setattr(f"optics.exchange.verification.{fails}", raising(error))
    assert main(["verify", str(result.joinpath(*arguments)), "--no-optiland", "-v"]) == 70
    shown = capsys.readouterr().err
    assert "internal error" in shown
    assert "Traceback" in shown


@pytest.mark.slow
def test_a_full_disk_is_not_a_file_that_cannot_be_read(capsys, result, monkeypatch):
    def full(contents):
        raise OSError(errno.ENOSPC, "No space left on device", str(next(iter(contents))))

    monkeypatch.setattr("optics.exchange.results.owned_files.write_files", full)
    words = ["--light", "occt", "--rays", "1000", "--no-optiland", "--quiet"]
    message = refused(capsys, "verify", result, *words)
    assert "cannot write or read" in message
    assert "light_occt.png: No space left on device" in message
