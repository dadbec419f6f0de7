"""Which LLVM library is handed to Dr.Jit."""

from __future__ import annotations

import ctypes
from pathlib import Path

import numpy as np
import pytest

from optics.base.runtime.errors import UserError
from optics.base.runtime.llvm import OLDEST, candidates, llvm_library, require_loadable

NAMES = {
    "libLLVM-14.so.1": 14,
    "libLLVM-15.so.1": 15,
    "libLLVM-16.so": 16,
    "libLLVM.so.19.1": 19,
    "libLLVM-22.so": 22,
}


def place(folder, *names):
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        (folder / name).write_bytes(b"")
    return str(folder)


def test_versions_are_read_from_the_names(tmp_path):
    found = candidates([place(tmp_path, *NAMES, "libLLVM-C.so", "libLLVMfoo.so", "notes.txt")])
    assert {Path(path).name: version for path, version in found.items()} == NAMES


def test_the_newest_is_chosen(tmp_path):
    assert llvm_library({}, [place(tmp_path, *NAMES)]) == str(tmp_path / "libLLVM-22.so")


def test_versions_are_compared_as_numbers(tmp_path):
    assert llvm_library({}, [place(tmp_path, "libLLVM-9.so", "libLLVM-19.so", "libLLVM-100.so")]) == str(
        tmp_path / "libLLVM-100.so"
    )


def test_every_folder_is_searched_and_patterns_are_expanded(tmp_path):
    folders = [
        place(tmp_path / "usr", "libLLVM-17.so"),
        str(tmp_path / "llvm-*" / "lib"),
        str(tmp_path / "missing"),
    ]
    place(tmp_path / "llvm-18" / "lib", "libLLVM.so.18.1")
    newest = place(tmp_path / "llvm-20" / "lib", "libLLVM.so.20.1")
    assert llvm_library({}, folders) == str(Path(newest) / "libLLVM.so.20.1")


def test_a_link_counts_as_what_it_points_to(tmp_path):
    place(tmp_path, "libLLVM-14.so.1")
    (tmp_path / "libLLVM.so").symlink_to("libLLVM-14.so.1")
    assert candidates([str(tmp_path)]) == {
        str(tmp_path / "libLLVM-14.so.1"): 14,
        str(tmp_path / "libLLVM.so"): 14,
    }


def test_a_dangling_link_is_not_chosen(tmp_path):
    place(tmp_path, "libLLVM-18.so")
    (tmp_path / "libLLVM-22.so").symlink_to(tmp_path / "gone" / "libLLVM-22.so")
    assert llvm_library({}, [str(tmp_path)]) == str(tmp_path / "libLLVM-18.so")


def test_a_file_that_is_no_library_and_names_no_version_is_ignored(tmp_path):
    place(tmp_path, "libLLVM-18.so")
    (tmp_path / "libLLVM.so").write_text("not a library")
    assert llvm_library({}, [str(tmp_path)]) == str(tmp_path / "libLLVM-18.so")


def test_only_old_libraries_are_refused_with_version_and_remedy(tmp_path):
    with pytest.raises(
        UserError, match=r"version 16 .*libLLVM-16\.so.*install LLVM 17 or newer.*apt-get install libllvm"
    ):
        llvm_library({}, [place(tmp_path, "libLLVM-14.so.1", "libLLVM-15.so.1", "libLLVM-16.so")])


def test_no_library_is_refused_with_the_remedy(tmp_path):
    with pytest.raises(UserError, match=r"no LLVM library was found.*install LLVM 17 or newer"):
        llvm_library({}, [str(tmp_path)])


def test_the_environment_decides(tmp_path):
    folder = place(tmp_path, *NAMES)
    named = str(tmp_path / "libLLVM.so.19.1")
    assert llvm_library({"DRJIT_LIBLLVM_PATH": named}, [folder]) == named


def test_an_empty_environment_variable_is_as_none(tmp_path):
    assert llvm_library({"DRJIT_LIBLLVM_PATH": ""}, [place(tmp_path, "libLLVM-22.so")]) == str(
        tmp_path / "libLLVM-22.so"
    )


@pytest.mark.parametrize("name", ["libLLVM-14.so.1", "libLLVM-15.so.1", "libLLVM-16.so"])
def test_an_old_library_in_the_environment_is_refused(tmp_path, name):
    folder = place(tmp_path, *NAMES)
    with pytest.raises(
        UserError, match=rf"DRJIT_LIBLLVM_PATH = .*{name} is LLVM {NAMES[name]}.*unset it or install"
    ):
        llvm_library({"DRJIT_LIBLLVM_PATH": str(tmp_path / name)}, [folder])


@pytest.mark.parametrize("name", ["missing/libLLVM-22.so", "text.txt"])
def test_an_environment_path_without_a_library_is_refused(tmp_path, name):
    (tmp_path / "text.txt").write_text("not a library")
    with pytest.raises(
        UserError, match=r"DRJIT_LIBLLVM_PATH = .* is not an LLVM library; unset it or install"
    ):
        llvm_library({"DRJIT_LIBLLVM_PATH": str(tmp_path / name)}, [place(tmp_path, *NAMES)])


def test_this_machine_has_a_usable_llvm():
    library = ctypes.CDLL(llvm_library({}))
    major = ctypes.c_uint()
    library.LLVMGetVersion(ctypes.byref(major), None, None)
    assert major.value >= OLDEST


def test_drjit_computes_with_it_in_double_precision(backend):
    third = backend.Float([1.0, 2.0]) / 3
    np.testing.assert_array_equal(third.numpy(), np.array([1.0, 2.0]) / 3)
    assert third.numpy().dtype == np.float64


def test_a_library_that_cannot_be_loaded_is_named(tmp_path):
    (tmp_path / "libLLVM.so.19").write_bytes(b"no library")
    with pytest.raises(UserError, match=r"cannot load the LLVM library .*libLLVM\.so\.19.*; install LLVM 17"):
        require_loadable(str(tmp_path / "libLLVM.so.19"))


def test_a_library_that_finds_no_memory_is_a_lack_of_memory(monkeypatch):
    def failing(path):
        raise OSError(f"{path}: failed to map segment from shared object")

    monkeypatch.setattr("ctypes.CDLL", failing)
    with pytest.raises(MemoryError):
        require_loadable("libLLVM.so.19")
