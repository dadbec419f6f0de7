"""Which LLVM library is loaded for Dr.Jit."""

import ctypes
import os
import subprocess
import sys
from importlib.metadata import distributions
from pathlib import Path

import numpy as np
import pytest

from optics.base.runtime import llvm, load_backend
from optics.base.runtime.errors import UserError
from optics.base.runtime.llvm import OLDEST, VARIABLE, WHEEL, candidates, load_llvm

NONE = "no-such-wheel"
NAMES = ("libLLVM-14.so.1", "libLLVM-15.so.1", "libLLVM-16.so", "libLLVM.so.19.1", "libLLVM-22.so")


class Library:
    """Stands for a library: the text of its file is the version that it says, and no other text loads."""

    loaded: list[str]

    def __init__(self, path):
        self.text = Path(path).read_text()
        if self.text == "no memory":
            raise OSError(f"{path}: failed to map segment from shared object")
        if not self.text.isdigit():
            raise OSError(f"{path}: invalid ELF header")
        self.loaded.append(Path(path).name)

    def LLVMGetVersion(self, major, minor, patch):
        major._obj.value = int(self.text)


@pytest.fixture
def loaded(monkeypatch):
    """The names of the libraries that are loaded; DRJIT_LIBLLVM_PATH is unset, Dr.Jit has none yet."""
    Library.loaded = []
    monkeypatch.setattr("ctypes.CDLL", Library)
    monkeypatch.setattr(llvm, "_of_dr_jit", lambda: None)
    monkeypatch.setattr("thbcad.doors.LIBRARIES", {})
    monkeypatch.setitem(os.environ, VARIABLE, "")
    return Library.loaded


def place(folder, names=NAMES, text=None):
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        (folder / name).write_text(text or "".join(filter(str.isdigit, name))[:2])
    return str(folder)


def install(folder, monkeypatch, version="22"):
    """Install a wheel as the one of LLVM: its metadata, its library and three that this needs, no links."""
    monkeypatch.syspath_prepend(str(folder))
    beside = [f"lib/x86_64-unknown-linux-gnu/lib{name}.so.1.0" for name in ("c++", "c++abi", "unwind")]
    library = f"lib/libLLVM.so.{version}.1"
    for name in (library, *beside):
        place((folder / name).parent, [Path(name).name], version)
    place(folder / "wheel-1.dist-info", ["METADATA"], "Metadata-Version: 2.4\nName: wheel\nVersion: 1\n")
    place(folder / "wheel-1.dist-info", ["RECORD"], "".join(f"{name},,\n" for name in (*beside, library)))
    return str(folder / library)


def test_libraries_are_sorted_by_the_versions_of_their_names(tmp_path):
    (tmp_path / "libLLVM.so").symlink_to("libLLVM.so.100")
    folder = place(
        tmp_path, [*NAMES, "libLLVM-9.so", "libLLVM.so.100", "libLLVM-C.so", "libLLVMfoo.so", "notes"]
    )
    found = [Path(path).name for path in candidates([folder])]
    assert set(found[:2]) == {"libLLVM.so", "libLLVM.so.100"}
    assert found[2:] == [*reversed(NAMES), "libLLVM-9.so"]


def test_folders_may_hold_a_star(tmp_path):
    place(tmp_path / "llvm-18" / "lib", ["libLLVM.so.18.1"])
    newest = place(tmp_path / "llvm-20" / "lib", ["libLLVM.so.20.1"])
    assert candidates([str(tmp_path / "llvm-*" / "lib")])[0] == str(Path(newest) / "libLLVM.so.20.1")


def test_the_newest_in_the_folders_is_loaded_and_handed_over(tmp_path, loaded):
    assert load_llvm([place(tmp_path)], NONE) == os.environ[VARIABLE] == str(tmp_path / "libLLVM-22.so")
    assert loaded == ["libLLVM-22.so"]


def test_broken_libraries_are_skipped(tmp_path, loaded):
    place(tmp_path, ["libLLVM.so", "libLLVM-30.so"], "no library")
    (tmp_path / "libLLVM-40.so").symlink_to(tmp_path / "gone.so")
    assert load_llvm([place(tmp_path)], NONE) == str(tmp_path / "libLLVM-22.so")


def test_the_wheel_comes_before_the_folders_with_what_it_needs(tmp_path, loaded, monkeypatch):
    wheel = install(tmp_path / "site", monkeypatch)
    assert load_llvm([place(tmp_path, ["libLLVM-30.so"])], "wheel") == wheel
    assert loaded == ["libunwind.so.1.0", "libc++abi.so.1.0", "libc++.so.1.0", "libLLVM.so.22.1"]
    loaded.clear()
    assert load_llvm([], NONE) == wheel  # a helper process inherits its name
    assert loaded[0] == "libunwind.so.1.0"


@pytest.mark.parametrize("version", ["broken", "16"])
def test_a_wheel_that_does_not_work_is_skipped(tmp_path, loaded, monkeypatch, version):
    install(tmp_path / "site", monkeypatch, version)
    assert load_llvm([place(tmp_path)], "wheel") == str(tmp_path / "libLLVM-22.so")


def test_the_environment_decides(tmp_path, loaded, monkeypatch):
    install(tmp_path / "site", monkeypatch)
    monkeypatch.setitem(os.environ, VARIABLE, str(tmp_path / "libLLVM.so.19.1"))
    assert load_llvm([place(tmp_path)], "wheel") == str(tmp_path / "libLLVM.so.19.1")


def test_old_libraries_are_named_and_not_loaded(tmp_path, loaded):
    words = r"no LLVM library that works .*libLLVM-16\.so is LLVM 16, too old .*install LLVM 17 or newer"
    with pytest.raises(UserError, match=words):
        load_llvm([place(tmp_path, NAMES[:3])], NONE)
    assert loaded == []


@pytest.mark.parametrize(
    ("system", "words"),
    [("darwin", "17 or newer: brew install llvm$"), ("win32", r"with its folder of LLVM-C\.dll on PATH$")],
)
def test_the_search_of_drjit_is_left_alone_where_it_has_its_own(tmp_path, loaded, monkeypatch, system, words):
    """On Windows and macOS; what is named is still looked at."""
    monkeypatch.setattr("optics.base.runtime.llvm.sys.platform", system)
    assert load_llvm([place(tmp_path)], NONE) == os.environ[VARIABLE] == ""
    assert loaded == []
    monkeypatch.setitem(os.environ, VARIABLE, str(tmp_path / NAMES[0]))
    with pytest.raises(UserError, match=words):
        load_llvm()


def test_an_llvm_that_drjit_does_not_find_is_told(backend, monkeypatch):
    monkeypatch.setattr(backend.dr, "has_backend", lambda kind: False)
    with pytest.raises(UserError, match=r"^Dr\.Jit found no LLVM library; .*install LLVM 17 or newer"):
        load_backend()


def test_where_there_is_none_the_remedy_is_told(tmp_path, loaded):
    with pytest.raises(UserError, match=r"found \(none at all\); .*install LLVM 17 or newer"):
        load_llvm([str(tmp_path)], NONE)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        *((name, "is LLVM 1[456], too old") for name in NAMES[:3]),
        ("missing/libLLVM-22.so", "cannot be loaded as LLVM"),
        ("text.txt", "cannot be loaded as LLVM"),
    ],
)
def test_a_library_of_the_environment_that_does_not_work_is_refused(
    tmp_path, loaded, monkeypatch, name, words
):
    (tmp_path / "text.txt").write_text("not a library")
    monkeypatch.setitem(os.environ, VARIABLE, str(tmp_path / name))
    with pytest.raises(UserError, match=rf"{VARIABLE} = .*{name} {words}.*; unset it or "):
        load_llvm([place(tmp_path)], NONE)


def test_a_library_that_finds_no_memory_is_a_lack_of_memory(tmp_path, loaded):
    with pytest.raises(MemoryError):
        load_llvm([place(tmp_path, ["libLLVM-22.so"], "no memory")], NONE)


def test_this_machine_has_one_that_works_beside_a_broken_one(tmp_path, backend):
    """Dr.Jit has it in a process of its own, whose folders begin with files that are no libraries."""
    place(tmp_path, ["libLLVM.so", "libLLVM.so.99"], "no library")
    program = (
        "from optics.base.runtime import llvm, load_backend\n"
        f"llvm.load_llvm([{str(tmp_path)!r}, *llvm.FOLDERS])\n"
        "print((load_backend().Float([1.0, 2.0]) / 4).numpy())"
    )
    environment = os.environ | {VARIABLE: "", "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("[0.25 0.5 ]\n", "")


@pytest.mark.parametrize(("taken", "words"), [(15, "took LLVM 15, too old for it"), (-1, "found no LLVM")])
def test_a_dr_jit_that_took_an_old_library_before_is_refused(tmp_path, loaded, monkeypatch, taken, words):
    """It would abort the whole process at its first kernel."""
    monkeypatch.setattr(llvm, "_of_dr_jit", lambda: taken)
    path = str(tmp_path / "libLLVM-22.so")
    with pytest.raises(UserError, match=f"{words}.*{VARIABLE}={path} before Python starts"):
        load_llvm([place(tmp_path)], NONE)
    monkeypatch.setitem(os.environ, VARIABLE, path)
    with pytest.raises(UserError, match=words):
        load_llvm([], NONE)


@pytest.mark.parametrize("named", [True, False])
def test_dr_jit_tells_which_library_it_took(backend, named):
    """In a process that imports it first: the one that is named, or whatever it finds, which may be none."""
    program = "import drjit; from optics.base.runtime import llvm; print(llvm._of_dr_jit())"
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    if not named:
        del environment[VARIABLE]
    done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True)
    assert done.returncode == 0
    assert int(done.stdout.splitlines()[-1]) >= (OLDEST if named else -1)


@pytest.mark.skipif(WHEEL not in {d.name for d in distributions()}, reason="no wheel of LLVM for this system")
def test_the_wheel_suffices(monkeypatch):
    monkeypatch.setitem(os.environ, VARIABLE, "")
    path, major = load_llvm([]), ctypes.c_uint()
    ctypes.CDLL(path).LLVMGetVersion(ctypes.byref(major), None, None)
    assert major.value >= OLDEST


def test_drjit_computes_with_it_in_double_precision(backend):
    third = backend.Float([1.0, 2.0]) / 3
    np.testing.assert_array_equal(third.numpy(), np.array([1.0, 2.0]) / 3)
    assert third.numpy().dtype == np.float64
