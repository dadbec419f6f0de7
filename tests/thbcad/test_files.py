"""Files and pipes that a user names: bounded, and never waited for without end."""

import os
import subprocess

import pytest

from thbcad import files
from thbcad.files import file_or_pipe_bytes, regular_bytes

MOST = 1000


def test_a_pipe_is_read_to_its_end_and_a_regular_file_too(tmp_path):
    path = tmp_path / "data"
    path.write_bytes(b"x" * MOST)
    assert regular_bytes(path, MOST) == file_or_pipe_bytes(path, MOST) == b"x" * MOST
    with subprocess.Popen(["cat", path], stdout=subprocess.PIPE) as writer:  # as <(cat data) of a shell
        assert file_or_pipe_bytes(f"/dev/fd/{writer.stdout.fileno()}", MOST) == b"x" * MOST


@pytest.mark.parametrize("read", [regular_bytes, file_or_pipe_bytes])
def test_a_folder_and_a_long_file_are_refused(tmp_path, read):
    with pytest.raises(OSError, match="it is a folder, not a file"):
        read(tmp_path, MOST)
    (tmp_path / "long").write_bytes(b"x" * (MOST + 1))
    with pytest.raises(ValueError, match="larger than the 1,000 bytes allowed"):
        read(tmp_path / "long", MOST)


def test_devices_and_pipes_end_in_a_sentence(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "PATIENCE", 0.05)
    os.mkfifo(tmp_path / "pipe")
    for path in ("/dev/zero", tmp_path / "pipe"):
        with pytest.raises(OSError, match="it is a pipe or a device, not a file"):
            regular_bytes(path, MOST)
    with pytest.raises(ValueError, match="larger than the 1,000 bytes allowed"):
        file_or_pipe_bytes("/dev/zero", MOST)
    with pytest.raises(OSError, match=r"nothing came from it for 0\.05 seconds"):
        file_or_pipe_bytes(tmp_path / "pipe", MOST)
