"""Arrays of a result: plain numbers are read, and nothing else runs or ends in a traceback."""

import os
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest

from optics.base.runtime import UserError
from optics.exchange.results import read_arrays


class Loud:
    """An object whose unpickling leaves a file."""

    def __init__(self, path):
        self.path = str(path)

    def __reduce__(self):
        return Path.touch, (Path(self.path),)


def test_plain_arrays_come_back(tmp_path):
    np.savez_compressed(tmp_path / "a.npz", irradiance=np.eye(3), name=np.array("level 2"))
    arrays = read_arrays(tmp_path / "a.npz", ["irradiance"])
    np.testing.assert_array_equal(arrays["irradiance"], np.eye(3))
    assert str(arrays["name"]) == "level 2"


def test_arrays_of_objects_are_refused_and_no_code_runs(tmp_path):
    np.savez(tmp_path / "a.npz", irradiance=np.array([Loud(tmp_path / "ran")], dtype=object))
    with pytest.raises(UserError, match=r"a\.npz is no file of plain arrays: .*; run the design again"):
        read_arrays(tmp_path / "a.npz", ["irradiance"])
    assert not (tmp_path / "ran").exists()


@pytest.mark.parametrize(
    ("made", "words"),
    [
        (lambda path: np.savez(path, target=np.eye(2)), "has no array irradiance of numbers"),
        (lambda path: np.savez(path, irradiance=np.array("text")), "has no array irradiance of numbers"),
        (lambda path: path.write_bytes(b""), "is no file of plain arrays"),
        (lambda path: path.write_bytes(b"PK\3\4" + bytes(40)), "is no file of plain arrays"),
        (lambda path: path.write_bytes(b"text"), "is no file of plain arrays"),
        (lambda path: np.save(path.open("wb"), np.eye(2)), "is no file of plain arrays"),
        (os.mkfifo, "it is a pipe or a device, not a file"),
        (lambda path: None, "cannot read .*: No such file"),
    ],
)
def test_damaged_files_are_refused_in_a_sentence(tmp_path, made, words):
    made(tmp_path / "a.npz")
    with pytest.raises(UserError, match=words):
        read_arrays(tmp_path / "a.npz", ["irradiance"])


def member(content, name="irradiance.npy"):
    """Return what writes a zip archive with one member."""

    def write(path):
        with ZipFile(path, "w") as archive:
            archive.writestr(name, content)

    return write


def changed(offset, value):
    """Return what writes an archive whose directory and local header have another number."""

    def write(path):
        np.savez(path, irradiance=np.eye(2))
        data = bytearray(path.read_bytes())
        for mark, shift in ((b"PK\3\4", 0), (b"PK\1\2", 2)):
            data[data.index(mark) + offset + shift] = value
        path.write_bytes(data)

    return write


def header(text):
    return b"\x93NUMPY\1\0" + len(text).to_bytes(2, "little") + text.encode()


@pytest.mark.parametrize(
    "made",
    [
        member(b"text", "irradiance"),
        member(header("{'descr': (\n")),
        member(header("{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000,), }\n")),
        changed(6, 1),  # encrypted
        changed(8, 99),  # an unknown compression
    ],
)
def test_archives_of_something_else_are_refused_in_a_sentence(tmp_path, made):
    made(tmp_path / "a.npz")
    with pytest.raises(UserError, match=r"a\.npz is no file of plain arrays: .*; run the design again"):
        read_arrays(tmp_path / "a.npz", ["irradiance"])
