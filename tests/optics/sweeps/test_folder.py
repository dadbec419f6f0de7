"""The folder of a sweep: one run at a time, and what is in it belongs to somebody."""

from contextlib import ExitStack

import pytest

from optics.results import writable_folder
from optics.runtime import UserError
from optics.sweeps import sweep_folder
from optics.sweeps.sweep_folder import STORE, taken_folder
from optics.sweeps.sweep_store import StoredVariant
from tests.optics.sweeps.cases import problem

KEYS = ("target.distance",)
ROW = StoredVariant("done", "", {"rel_l2": 0.1}, 1.5, 300.0, b"")


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
