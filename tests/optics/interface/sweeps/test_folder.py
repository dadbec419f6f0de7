"""The folder of a sweep: one run at a time, and what is in it belongs to somebody."""

import json
from contextlib import ExitStack

import pytest

from optics.base.runtime import UserError
from optics.exchange.results import writable_folder
from optics.interface.sweeps import sweep_folder
from optics.interface.sweeps.sweep_folder import RECORD, STORE, taken_folder, write_sweep
from optics.interface.sweeps.sweep_rows import Sweep, SweepRow
from tests.optics.interface.sweeps.cases import problem

KEYS = ("target.distance",)
ROW = SweepRow((200,), "done", "", {"rel_l2": 0.1}, 1.5, 300.0, b"")


@pytest.fixture
def before_the_lock(monkeypatch):
    """Return a function that sets what happens once, after a sweep saw no folder and before it locks it."""

    def use(happens):
        def made(folder):
            monkeypatch.setattr(sweep_folder, "writable_folder", writable_folder)
            writable_folder(folder)
            happens()

        monkeypatch.setattr(sweep_folder, "writable_folder", made)

    return use


def test_a_sweep_that_comes_second_leaves_the_store_of_the_first(before_the_lock, tmp_path):
    out = tmp_path / "out"
    with ExitStack() as first:

        def begin():
            store = first.enter_context(taken_folder(out, problem(), KEYS, False, False))
            store.add("a", {}, ROW)
            store.commit()

        before_the_lock(begin)
        with (
            pytest.raises(UserError, match="another run writes to"),
            taken_folder(out, problem(), KEYS, False, False),
        ):
            pass
        assert (out / STORE).exists()
    with taken_folder(out, problem(), KEYS, True, False) as store:
        assert store.problems() == {"a"}


def test_a_sweep_that_finds_another_one_done_leaves_its_store(before_the_lock, tmp_path):
    out = tmp_path / "out"

    def run():
        with taken_folder(out, problem(), KEYS, False, False) as store:
            store.add("a", {}, ROW)

    before_the_lock(run)
    with (
        pytest.raises(UserError, match="holds another sweep"),
        taken_folder(out, problem(), ("lens.thickness",), False, False),
    ):
        pass
    with taken_folder(out, problem(), KEYS, True, False) as store:
        assert store.problems() == {"a"}


def test_a_sweep_without_any_variant_leaves_no_store_and_no_folder_of_its_own(tmp_path):
    (tmp_path / "there").mkdir()
    for name in ("there", "new"):
        with taken_folder(tmp_path / name, problem(), KEYS, False, False):
            pass
    assert [path.name for path in tmp_path.rglob("*")] == ["there"]


def written(folder, plots, monkeypatch):
    """Write the files of a sweep with such plots, as a run does."""
    monkeypatch.setattr(sweep_folder, "metric_plots", lambda sweep: dict.fromkeys(plots, b"\x89PNG"))
    with taken_folder(folder, problem(), KEYS, False, False) as store:
        store.add("a", {}, ROW)
        write_sweep(Sweep(folder, KEYS, [ROW]), "title")


def files(folder):
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()} - {STORE}


def test_plots_of_others_are_refused_before_anything_is_computed(tmp_path, monkeypatch):
    (tmp_path / "figures").mkdir()
    mine = tmp_path / "figures" / "seconds.png"
    mine.write_bytes(b"mine")
    with pytest.raises(UserError, match=r"figures/seconds\.png would be replaced"):
        written(tmp_path, ["seconds"], monkeypatch)
    assert files(tmp_path) == {"figures/seconds.png"}
    assert mine.read_bytes() == b"mine"


def test_a_plot_that_was_changed_since_is_refused(tmp_path, monkeypatch):
    written(tmp_path, ["seconds"], monkeypatch)
    (tmp_path / "figures" / "seconds.png").write_bytes(b"mine")
    with pytest.raises(UserError, match=r"figures/seconds\.png would be replaced.*what is computed stays"):
        written(tmp_path, ["seconds"], monkeypatch)


def test_what_an_earlier_sweep_wrote_and_this_one_does_not_is_removed(tmp_path, monkeypatch):
    monkeypatch.setattr(sweep_folder, "parquet_bytes", lambda sweep: b"PAR1")
    written(tmp_path, ["dof", "seconds"], monkeypatch)
    before = files(tmp_path)
    monkeypatch.setattr(sweep_folder, "parquet_bytes", lambda sweep: None)
    for _ in range(2):
        written(tmp_path, ["seconds"], monkeypatch)
        assert before - files(tmp_path) == {"figures/dof.png", "sweep.parquet"}
        assert "figures/seconds.png" in files(tmp_path)


def test_only_files_of_a_sweep_are_removed_whatever_the_record_says(tmp_path, monkeypatch):
    names = ["notes.txt", "figures/notes.txt", "../outside.png", "figures/../../outside.png"]
    out = tmp_path / "out"
    (out / "figures").mkdir(parents=True)
    for name in names:
        (out / name).write_bytes(b"mine")
    (out / RECORD).write_text(json.dumps({"sha256": dict.fromkeys(names, "0" * 64)}))
    written(out, [], monkeypatch)
    assert all((out / name).read_bytes() == b"mine" for name in names)
