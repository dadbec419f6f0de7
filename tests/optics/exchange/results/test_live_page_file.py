"""The live page belongs to the run that goes on; files of others stay."""

import pytest

from optics.base.runtime import UserError
from optics.exchange.results import LIVE, ResultFolder, require_room_for_live_page, write_live_page
from optics.scene.problem import load_problem


@pytest.fixture
def taken(problem_file, tmp_path):
    """A function that takes a result folder and gives it back."""

    def take(folder):
        with ResultFolder(folder).taken(load_problem(problem_file()), False):
            require_room_for_live_page(folder, False)

    return take


def test_the_next_run_removes_the_page_of_the_last_one(taken, tmp_path):
    folder = tmp_path / "result"
    folder.mkdir()
    write_live_page(folder, "<html></html>\n")
    (folder / f".{LIVE}.12345678").touch()  # of a run that was killed while it wrote
    (folder / "mine.txt").touch()
    taken(folder)
    assert [path.name for path in folder.iterdir() if not path.name.endswith(".lock")] == ["mine.txt"]


def test_a_file_of_somebody_else_is_not_replaced(taken, tmp_path):
    folder = tmp_path / "result"
    folder.mkdir()
    (folder / LIVE).write_text("mine")
    with pytest.raises(UserError, match=r"live\.html would be replaced, but is no page of this program"):
        taken(folder)
    assert (folder / LIVE).read_text() == "mine"
    require_room_for_live_page(folder, True)
