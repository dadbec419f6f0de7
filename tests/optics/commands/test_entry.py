"""The command as a process: how it ends."""

import gc

import pytest

from optics.commands import cli, main
from tests.optics.cases import write_problem


def test_a_command_searches_for_garbage_rarely_and_not_at_its_end(monkeypatch):
    before, seen = gc.get_threshold(), []

    def ran():
        seen.append(gc.get_threshold())
        return 3

    monkeypatch.setattr(cli, "main", ran)
    try:
        with pytest.raises(SystemExit) as ended:
            cli.entry()
        assert ended.value.code == 3
        assert seen[0][0] > 10 * before[0]
        assert gc.get_freeze_count() > 0
    finally:
        gc.set_threshold(*before)
        gc.unfreeze()


@pytest.mark.parametrize("debug", [False, True])
def test_an_error_of_the_program_itself_is_one_sentence_and_has_a_code_of_its_own(
    tmp_path, capsys, monkeypatch, debug
):
    """1 would say that a check failed.  The traceback is shown to those who ask for it."""

    def failing(options):
        raise ZeroDivisionError("nothing\x1b to divide by")

    monkeypatch.setattr("optics.commands.check_command.system_of", failing)
    monkeypatch.delenv("THBCAD_DEBUG", raising=False)
    if debug:
        monkeypatch.setenv("THBCAD_DEBUG", "1")
    assert main(["check", str(write_problem(tmp_path))]) == 70
    captured = capsys.readouterr()
    assert captured.out == ""
    *above, line = captured.err.splitlines()
    assert line.startswith(
        "thbcad: internal error: ZeroDivisionError: nothing\\x1b to divide by; please report"
    )
    assert any("Traceback" in row for row in above) == debug
    assert bool(above) == debug


def test_control_characters_of_a_title_do_not_reach_the_terminal(tmp_path, capsys):
    """They could recolour or overwrite lines, or type commands."""
    title = "a\x1b[31m\0\x9b2Jb\nc\u202ed"
    assert main(["check", str(write_problem(tmp_path, {"title": title}))]) == 0
    captured = capsys.readouterr()
    assert captured.out.splitlines()[0].startswith("a\\x1b[31m\\x00\\x9b2Jb")
    assert all(c.isprintable() or c == "\n" for c in captured.out + captured.err)
