"""The studies of the thesis through the command line: what is kept, what is written, what is refused."""

import io
import json
import re
import signal
import sys
import time

import numpy as np
import pytest

from optics.interface.commands import main
from tests.thesis.cases import copied_checkout, studies

STUDY = "9"  # the quickest: four runs, below a second in all
RUNS = {"into_glass", "out_of_glass", "filters", "efficiency"}
LINK = re.compile(r"!\[[^\]]*\]\(([^)]+)\)")


@pytest.fixture(scope="module")
def checkout(tmp_path_factory):
    """Yield a copied checkout in which the command works, with its own `benchmarks` and `examples`."""
    folder = copied_checkout(tmp_path_factory.mktemp("checkout"))
    others = {name: m for name, m in sys.modules.items() if name.split(".")[0] in ("benchmarks", "examples")}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("optics.interface.commands.bench_command.checkout", lambda: folder)
        patch.setattr(sys, "path", [*sys.path])
        for name in others:
            patch.delitem(sys.modules, name)
        yield folder
        for name in [name for name in sys.modules if name.split(".")[0] in ("benchmarks", "examples")]:
            del sys.modules[name]


@pytest.fixture(scope="module")
def pages(checkout):
    """Return the folder of the pages, after a first set of runs."""
    assert main(["bench", "thesis", "--quick", "--only", STUDY]) == 0
    return checkout / "build" / "thesis" / "quick" / "pages"


@pytest.fixture
def runs(pages):
    return pages.parent / STUDY


def times(folder):
    return {path.stem: path.stat().st_mtime_ns for path in folder.iterdir()}


@pytest.mark.slow
def test_a_study_writes_one_whole_file_per_run(runs):
    assert set(times(runs)) == RUNS  # and no temporary file
    for path in runs.iterdir():
        with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as data:
            assert json.loads(str(data["numbers"]))["seconds"] > 0


def test_a_page_has_a_verdict_for_every_claim_and_its_pictures(pages):
    text = (pages / "chapter2.md").read_text()
    claims = text.partition("| verdict |\n")[2].partition("\n\n")[0].splitlines()[1:]
    assert len(claims) >= 5
    assert all(re.search(r"\*\*(holds|fails|cannot be judged)\*\* \|$", line) for line in claims)
    pictures = LINK.findall(text)
    assert len(pictures) == 2
    assert all((pages / name).read_bytes().startswith(b"\x89PNG") for name in pictures)
    assert "| left open in the thesis | taken here |" in text
    (row,) = re.findall(
        rf"^\| {STUDY} \| \[.*\]\(chapter2.md\) \|(.*)\|$", (pages / "README.md").read_text(), re.M
    )
    assert sum(map(int, row.split("|"))) == len(claims)


def test_resume_runs_nothing_that_is_there(pages, runs, capsys):
    before, text = times(runs), (pages / "chapter2.md").read_text()
    assert main(["bench", "thesis", "--quick", "--only", STUDY, "--resume"]) == 0
    assert times(runs) == before
    assert "run " not in capsys.readouterr().err
    assert (pages / "chapter2.md").read_text() == text


@pytest.mark.slow
def test_resume_runs_what_is_missing(runs, capsys):
    before = times(runs)
    (runs / "filters.npz").unlink()
    assert main(["bench", "thesis", "--quick", "--only", STUDY, "--resume"]) == 0
    assert "study 9, run 3 of 4: filters" in capsys.readouterr().err
    after = times(runs)
    assert {name for name in RUNS if after[name] != before[name]} == {"filters"}


@pytest.mark.slow
def test_without_resume_all_runs_are_made_anew(runs):
    before = times(runs)
    assert main(["bench", "thesis", "--quick", "--only", STUDY]) == 0
    assert all(times(runs)[name] > before[name] for name in RUNS)


def test_a_run_that_cannot_be_kept_leaves_no_part_of_a_file(runs, monkeypatch, capsys):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    assert main(["bench", "thesis", "--quick", "--only", STUDY]) == 2
    assert "No space left on device" in capsys.readouterr().err
    assert list(runs.iterdir()) == []
    monkeypatch.undo()
    assert main(["bench", "thesis", "--quick", "--only", STUDY, "--resume"]) == 0


def test_a_study_that_does_not_exist_is_refused_in_a_sentence(checkout, capsys):
    assert main(["bench", "thesis", "--only", "99"]) == 2
    message = capsys.readouterr().err
    assert "--only must be one of " in message
    assert message.endswith(", got 99\n")
    assert message.count("\n") == 1


@pytest.mark.slow
def test_a_killed_set_goes_on_to_the_same_pages(tmp_path):
    """Killed by SIGKILL while a run is under way, and by another while the last ones are."""
    whole, ended = (copied_checkout(tmp_path / name) for name in ("whole", "ended"))
    arguments = ("--quick", "--only", "10")
    assert studies(whole, *arguments).wait() == 0
    folder = ended / "build" / "thesis" / "quick"
    for count in (3, 6):
        process = studies(ended, *arguments, *(["--resume"] if count > 3 else []))
        while process.poll() is None and len(list((folder / "10").glob("*.npz"))) < count:
            time.sleep(0.02)
        process.send_signal(signal.SIGKILL)
        assert process.wait() == -signal.SIGKILL
    _, stderr = studies(ended, *arguments, "--resume").communicate()
    assert "run 1 of 8" not in stderr
    made = {path.name: path.read_bytes() for path in (folder / "pages").iterdir()}
    wanted = whole / "build" / "thesis" / "quick" / "pages"
    assert made == {path.name: path.read_bytes() for path in wanted.iterdir()}
