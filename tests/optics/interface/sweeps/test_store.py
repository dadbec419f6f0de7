"""The store of a sweep: rows are whole or absent, and belong to one sweep."""

import os
import signal
import subprocess
import sys
import time
from dataclasses import replace

import pytest

from optics.base.runtime import UserError
from optics.interface.sweeps.sweep_rows import SweepRow
from optics.interface.sweeps.sweep_store import open_store
from tests.cases import ROOT
from tests.optics.interface.sweeps.cases import kept_lens

ABOUT = {"problem": "p", "keys": "target.distance"}
ROW = SweepRow((), "done", "", {"rel_l2": 0.1, "ssim": None}, 1.5, 300.0, b"\x89PNG")
WRITER = """
import sys
from dataclasses import replace
from pathlib import Path
from optics.interface.sweeps.sweep_store import open_store
from tests.optics.interface.sweeps.test_store import ABOUT, ROW
with open_store(Path(sys.argv[1]), ABOUT) as store:
    for k in range(10**9):
        store.add(str(k), {"target.distance": k}, replace(ROW, picture=bytes([k % 256]) * 5000))
        if k % 100 == 99:
            store.commit()
            print(k + 1, flush=True)
"""


def test_what_is_stored_is_read_back(tmp_path):
    path = tmp_path / "sweep.sqlite"
    with open_store(path, ABOUT) as store:
        store.add("a", {"target.distance": 200}, ROW, "{}")
    with open_store(path, ABOUT) as store:
        assert store.problems() == {"a"}
        assert store.get("a") == ROW
        assert store.get("b") is None
    assert (kept_lens(path, "a"), kept_lens(path, "b")) == ("{}", "")


def test_a_problem_has_one_row(tmp_path):
    with open_store(tmp_path / "s", ABOUT) as store:
        store.add("a", {}, ROW)
        store.add("a", {}, replace(ROW, seconds=2.0))
        assert store.get("a").seconds == 2.0
        assert len(store.problems()) == 1


def test_done_is_what_is_designed_and_has_its_lens_where_one_is_wanted(tmp_path):
    with open_store(tmp_path / "s", ABOUT) as store:
        for status in ("done", "failed", "killed"):
            for lens in ("", "{}"):
                store.add(status + lens, {}, replace(ROW, status=status), lens)
        assert store.done(with_lens=False) == {"done", "done{}"}
        assert store.done(with_lens=True) == {"done{}"}


def test_no_more_than_half_a_second_of_work_waits_for_the_disk(tmp_path):
    path = tmp_path / "s"
    with open_store(path, ABOUT) as store, open_store(path, ABOUT) as other:
        for name, seconds in (("a", 60.0), ("b", 0.2), ("c", 0.2), ("d", 0.2), ("e", 0.1)):
            store.add(name, {}, replace(ROW, seconds=seconds))
            if name == "a":
                assert other.problems() == {"a"}
        assert other.problems() == {"a", "b", "c", "d"}


@pytest.mark.parametrize("other", [False, True], ids=["gone", "replaced"])
def test_nothing_is_stored_into_a_file_that_is_not_there_any_more(tmp_path, other):
    path, reached = tmp_path / "s", []

    def stored():
        with open_store(path, ABOUT) as store:
            path.rename(tmp_path / "moved")
            if other:
                path.touch()
            store.add("a", {}, replace(ROW, seconds=60.0))
            reached.append("the end")

    with pytest.raises(UserError, match=r"s was removed or moved while .*; bring it back and go on"):
        stored()
    assert not reached


def test_that_the_file_is_gone_is_told_before_what_follows_from_it(tmp_path):
    def failing():
        with open_store(tmp_path / "s", ABOUT):
            (tmp_path / "s").unlink()
            raise FileNotFoundError("figures")

    with pytest.raises(UserError, match="was removed or moved"):
        failing()


@pytest.mark.parametrize("status", ["failed", "killed"])
def test_what_is_designed_stays_where_another_try_for_its_lens_fails(tmp_path, status):
    tried = replace(ROW, status=status, sentence="no memory", metrics={})
    with open_store(tmp_path / "s", ABOUT) as store:
        store.add("a", {}, ROW)
        store.add("a", {}, tried)
        assert store.get("a") == ROW
        store.add("a", {}, replace(ROW, seconds=2.0), "{}")
        assert (store.get("a").seconds, store.done(with_lens=True)) == (2.0, {"a"})
        store.add("b", {}, tried)
        store.add("b", {}, ROW)
        assert store.get("b") == ROW
    assert kept_lens(tmp_path / "s", "a") == "{}"


def test_a_killed_writer_leaves_every_committed_row_whole(tmp_path):
    path = tmp_path / "sweep.sqlite"
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    with subprocess.Popen(
        [sys.executable, "-c", WRITER, path], env=environment, stdout=subprocess.PIPE, text=True
    ) as writer:
        said = [int(writer.stdout.readline()) for _ in range(5)]
        time.sleep(0.013)
        writer.send_signal(signal.SIGKILL)
        said += [int(line) for line in writer.stdout]
    with open_store(path, ABOUT) as store:
        held = store.problems()
        assert {str(k) for k in range(said[-1])} <= held
        for k in held:
            assert store.get(k) == replace(ROW, picture=bytes([int(k) % 256]) * 5000)


@pytest.mark.parametrize("key", ["problem", "keys"])
def test_the_store_of_another_sweep_is_refused(tmp_path, key):
    with open_store(tmp_path / "s", ABOUT) as store:
        store.add("a", {}, ROW)
    with (
        pytest.raises(UserError, match=f"holds another sweep .it differs in {key}.; choose another --out"),
        open_store(tmp_path / "s", ABOUT | {key: "other"}),
    ):
        pass


def test_an_empty_store_may_become_that_of_another_sweep(tmp_path):
    for key in ("a", "b"):
        with open_store(tmp_path / "s", ABOUT | {"keys": key}) as store:
            assert not store.problems()


@pytest.mark.parametrize("content", [b"no database, but a text" * 200, b"SQLite format 3\0junk"])
def test_a_damaged_store_is_refused_in_one_sentence(tmp_path, content):
    (tmp_path / "s").write_bytes(content)
    with (
        pytest.raises(UserError, match=r"cannot use .*file is not a database"),
        open_store(tmp_path / "s", ABOUT),
    ):
        pass
