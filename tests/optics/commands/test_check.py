"""What `thbcad check` prints."""

from optics.commands.cli import main
from tests.optics.cases import write_problem


def test_check_explains_what_is_skipped_only_when_asked(tmp_path, capsys):
    path = str(write_problem(tmp_path, {"lens.density": 1.2}))
    assert main(["check", path]) == 0
    brief = capsys.readouterr().out
    assert main(["check", path, "--explain"]) == 0
    full = capsys.readouterr().out
    assert "skips the search" in full
    assert "skip" not in brief
    for word in (" g; rear with", "z_freedom allows", "rel_l2: ", "of index", "of ripple", "of decentre"):
        assert word in brief
