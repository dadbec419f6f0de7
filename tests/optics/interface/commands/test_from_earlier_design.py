"""Runs that start from an earlier design."""

import pytest

from tests.optics.cases import write_problem
from tests.optics.interface.commands.cases import refused, run, strict_json


@pytest.mark.slow
def test_a_run_starts_from_an_earlier_design(golden, tmp_path, capsys):
    """The first loss is that of the earlier surface, on its mesh; the result is no worse."""
    before = strict_json((golden.path / "metrics.json").read_text())
    last = (golden.path / "history.csv").read_text().splitlines()[-1].split(",")
    out = tmp_path / "out"
    problem = golden.path / "problem.toml"
    done = run(capsys, "design", problem, "--out", out, "--from", golden.path, "--json")
    assert done.code == 0
    metrics = strict_json(done.out)["metrics"]
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
