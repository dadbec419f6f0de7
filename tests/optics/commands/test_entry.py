"""The command as a process: how it ends."""

import gc

import pytest

from optics.commands import cli


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
