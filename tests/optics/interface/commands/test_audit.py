"""`thbcad audit`: the folder it works in, its exit codes, and one whole run."""

import json
from dataclasses import replace

import pytest

from optics.base.runtime import usable_cores
from optics.interface.audit import CLAIMS, Judged, Measured
from optics.interface.commands import main
from tests.optics.interface.commands.cases import data_of, raising, refused, run

MODULE = "optics.interface.commands.audit_command"
HELD, MISSED = Measured(1.0, "1", True), Measured(2.0, "2", False, "twice")
UNTRIED = Measured(None, "not tried", None, "missing")


@pytest.fixture
def finding(monkeypatch):
    """A function that lets an audit find what it is given, and returns the folders that it worked in."""

    def found(*rows):
        folders = []

        def judged(experiments, claims):
            assert usable_cores() <= 2
            folders.append(experiments.folder)
            return [Judged(claims[0], row) for row in rows]

        monkeypatch.setattr(f"{MODULE}.judged", judged)
        return folders

    return found


@pytest.mark.parametrize(
    ("rows", "code", "first"),
    [
        ((HELD, HELD), 0, "2 of 2 claims hold here"),
        ((HELD, MISSED), 1, "1 of 2 claims hold here"),
        ((HELD, UNTRIED), 1, "1 of 2 claims hold here, 1 not tried"),
    ],
)
def test_the_exit_code_says_whether_all_claims_hold(rows, code, first, finding, capsys):
    finding(*rows)
    done = run(capsys, "audit")
    assert done.code == code
    assert done.out.startswith(first)


def test_nothing_stays_without_out(finding, capsys):
    folders = finding(HELD)
    cores = usable_cores()
    assert run(capsys, "audit").code == 0
    assert not folders[0].parent.exists()
    assert usable_cores() == cores


def test_out_keeps_files_and_numbers(finding, tmp_path, capsys):
    finding(HELD)
    data = data_of(capsys, "audit", "--out", tmp_path / "kept")
    assert {p.name for p in (tmp_path / "kept").iterdir()} == {"square.toml", "crescent.toml", "audit.json"}
    assert json.loads((tmp_path / "kept" / "audit.json").read_text("utf-8")) == data
    assert [p.name for p in tmp_path.iterdir()] == ["kept"]


def test_an_audit_that_is_stopped_leaves_nothing(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(f"{MODULE}.judged", raising(KeyboardInterrupt()))
    assert run(capsys, "audit", "--out", tmp_path / "kept").code == 130
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_exists_is_refused(tmp_path, capsys):
    sentence = refused(capsys, "audit", "--out", tmp_path)
    assert (
        sentence == f"thbcad: {tmp_path} exists; name a folder that does not, which thbcad audit then makes"
    )
    missing = refused(capsys, "audit", "--out", tmp_path / "a" / "b")
    assert missing == f"thbcad: there is no folder {tmp_path / 'a'} to make {tmp_path / 'a' / 'b'} in"


@pytest.mark.slow
def test_all_claims_hold_and_a_wrong_one_is_found(monkeypatch, capsys):
    (light,) = (claim for claim in CLAIMS if claim.key == "light")
    wrong = replace(light, key="wrong", limit=light.limit / 10)
    monkeypatch.setattr(f"{MODULE}.CLAIMS", (*CLAIMS, wrong))
    assert main(["audit", "--json", "--quiet"]) == 1
    data = json.loads(capsys.readouterr().out)
    *claims, last = data["claims"]
    assert [claim for claim in claims if not claim["holds"]] == []
    assert len(claims) == 12
    assert (last["key"], last["holds"], data["ok"]) == ("wrong", False, False)
