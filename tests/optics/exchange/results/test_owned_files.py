"""Records of files: whose files lie in a folder, wherever the writing of them is stopped."""

from contextlib import suppress

import pytest

from optics.exchange.results import recorded, write_recorded
from optics.exchange.results.owned_files import BEFORE, foreign
from tests.optics.interface.commands.faulty_disk import FaultyDisk, Killed


@pytest.mark.parametrize("fault", ["SIGKILL", "ENOSPC"])
def test_files_belong_to_this_program_wherever_their_writing_is_stopped(tmp_path, fault):
    """Then the same command writes them; what somebody else changes is seen."""
    names = "a.csv", "b.html"

    def written(text):
        write_recorded(tmp_path, "record.json", {"of": text}, {name: text.encode() for name in names})

    with FaultyDisk().installed() as disk:
        written("before")
    assert disk.count >= 8
    for at in range(1, disk.count + 1):
        with FaultyDisk(fault, at).installed(), suppress(Killed, OSError):
            written(f"after {at}")
        assert foreign(tmp_path, (*names, "record.json"), "record.json") == []
    written("last")
    assert recorded(tmp_path / "record.json", BEFORE) == {}
    (tmp_path / "b.html").write_text("mine")
    assert foreign(tmp_path, names, "record.json") == ["b.html"]
