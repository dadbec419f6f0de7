"""Files appear whole or not at all; what is no file is never replaced by one."""

import os
import stat

import pytest

from thbcad.io.atomic_files import write_bytes, write_files


@pytest.fixture
def pipe(tmp_path):
    path = tmp_path / "pipe.json"
    os.mkfifo(path)
    return path


def test_a_pipe_stays_a_pipe(pipe):
    with pytest.raises(OSError, match="a device or a pipe: give the name of a file"):
        write_bytes(pipe, b"{}")
    assert stat.S_ISFIFO(pipe.stat().st_mode)
    assert list(pipe.parent.iterdir()) == [pipe]


def test_beside_a_pipe_nothing_is_written(pipe):
    other = pipe.parent / "other.json"
    other.write_bytes(b"old")
    with pytest.raises(OSError, match="a device or a pipe"):
        write_files({other: b"new", pipe: b"{}"})
    assert other.read_bytes() == b"old"
    assert stat.S_ISFIFO(pipe.stat().st_mode)


def test_a_link_to_a_pipe_stays_too(pipe):
    link = pipe.parent / "link.json"
    link.symlink_to(pipe)
    with pytest.raises(OSError, match="a device or a pipe"):
        write_bytes(link, b"{}")
    assert link.is_symlink()
