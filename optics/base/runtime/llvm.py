"""Find an LLVM library that Dr.Jit can use, and load it before Dr.Jit.

Dr.Jit compiles its kernels by libLLVM.  Versions 15 and 16 load and then abort the whole process, older ones
are refused.  So the library is chosen here, and handed over in DRJIT_LIBLLVM_PATH.
"""

from __future__ import annotations

import ctypes
import os
import re
import sys
from collections.abc import Iterator, Sequence
from importlib.metadata import PackageNotFoundError, files
from pathlib import Path

from optics.base.runtime.errors import UserError
from thbcad.doors import pip_command, require_libraries

OLDEST = 17
VARIABLE = "DRJIT_LIBLLVM_PATH"
WHEEL = "karellen-llvm-core"  # of the extra `optics`
FOLDERS = (
    "/usr/lib/*-linux-gnu",
    "/usr/lib/llvm-*/lib",
    "/usr/lib64",
    "/usr/lib64/llvm*/lib64",
    "/usr/lib",
    "/usr/local/lib",
)
NAMES = ("libLLVM.so*", "libLLVM-[0-9]*.so*")
VERSION = re.compile(r"libLLVM(?:-|\.so\.|\.)(\d+)")
BESIDE = ("unwind", "c++abi", "c++")  # what the wheel's library needs, in the order of loading
SEARCHED = {  # remedies of systems where Dr.Jit's own search is left alone
    "darwin": f"install LLVM {OLDEST} or newer: brew install llvm",
    "win32": f"install LLVM {OLDEST} or newer, with its folder of LLVM-C.dll on PATH",
}


def load_llvm(folders: Sequence[str] = FOLDERS, wheel: str = WHEEL) -> str:
    """Load an LLVM library, name it in DRJIT_LIBLLVM_PATH, and return its path.

    It is the one that DRJIT_LIBLLVM_PATH names, or else the first that works: that of the wheel, then those
    in the folders, the newest first.  On Windows and macOS it is "", and Dr.Jit searches by itself.

    Raises UserError : the one that is named, or each that was found, does not load or is too old; a Dr.Jit
        that was imported before has taken one of the system's that is too old.
    Raises MissingPackage : none loads, and the system lacks shared libraries.
    Raises MemoryError : there is too little of it.
    """
    if named := os.environ.get(VARIABLE):
        if fault := _fault(named):
            raise UserError(f"{VARIABLE} = {fault}; unset it or {remedy()}")
        _require_usable(_of_dr_jit(), named)
        return named
    if sys.platform in SEARCHED:
        return ""
    faults = []
    for path in dict.fromkeys((*_in_wheel(wheel), *candidates(folders))):
        if not (fault := _fault(path)):
            _require_usable(_of_dr_jit(), path)
            os.environ[VARIABLE] = path
            return path
        faults.append(fault)
    require_libraries("LLVM")
    raise UserError(
        f"no LLVM library that works was found ({', '.join(faults) or 'none at all'}); {remedy()}"
    )


def remedy() -> str:
    """Return how to come by an LLVM library on this system."""
    brought = f"{pip_command('optics')} brings one, or install LLVM {OLDEST} or newer"
    return SEARCHED.get(sys.platform, brought)


def _of_dr_jit() -> int | None:
    """Return the major version of the LLVM that Dr.Jit took when it was imported; None where it has none yet,
    or its library does not tell."""
    found = sys.modules.get("drjit")
    if found is None or found.__file__ is None:
        return None
    core = Path(found.__file__).with_name("libdrjit-core.so")
    name = "_Z16jit_llvm_versionPiS_S_"  # void jit_llvm_version(int *, int *, int *), of drjit-core/jit.h
    if not core.exists() or not hasattr(library := ctypes.CDLL(str(core)), name):
        return None
    version = [ctypes.c_int(-1) for _ in range(3)]
    library[name](*map(ctypes.byref, version))
    return version[0].value


def _require_usable(taken: int | None, path: str) -> None:
    """Raise UserError where Dr.Jit has an LLVM already with which it would abort, or has looked for one in
    vain."""
    if taken is not None and taken < OLDEST:
        what = f"took LLVM {taken}, too old for it" if taken > 0 else "found no LLVM that it can use"
        raise UserError(
            f"Dr.Jit was imported before optics and {what}; import mitsuba and drjit after "
            f"optics.exchange.mitsuba.load_mitsuba(), or set {VARIABLE}={path} before Python starts"
        )


def candidates(folders: Sequence[str] = FOLDERS) -> list[str]:
    """Return the LLVM libraries in the given folders, the newest by its name first."""
    found = []
    for folder in folders:
        root, star, pattern = folder.partition("*")
        if star:
            root, _, stem = root.rpartition("/")
            pattern = f"{stem}*{pattern}/"
        for name in NAMES:
            found += sorted(Path(root).glob(pattern + name))
    return list(map(str, sorted(found, key=lambda path: -(_named_version(path) or 0))))


def _in_wheel(wheel: str) -> Iterator[str]:
    """Yield the library of an installed wheel, without the links that the first start of Python makes."""
    try:
        for file in files(wheel) or ():
            if VERSION.match(file.name):
                yield str(Path(str(file.locate())).resolve())
    except PackageNotFoundError:
        return


def _named_version(path: Path) -> int | None:
    """Return the major version in the name of a library, its links followed; None where the name has none."""
    match = VERSION.match(path.resolve().name)
    return int(match[1]) if match else None


def _fault(path: str) -> str:
    """Load an LLVM library and return "", or why Dr.Jit cannot use it; one too old by its name is not loaded.

    Raises MemoryError : there is too little of it.
    """
    version = _named_version(Path(path))
    if version is None or version >= OLDEST:
        try:
            for part in BESIDE:  # LLVM has them in a folder of the target
                for file in sorted(Path(path).parent.glob(f"*-unknown-linux-gnu/lib{part}.so.1*"))[:1]:
                    ctypes.CDLL(str(file))
            major = ctypes.c_uint()
            ctypes.CDLL(path).LLVMGetVersion(ctypes.byref(major), None, None)
        except (OSError, AttributeError) as error:
            if "failed to map" in str(error) or "allocate" in str(error):  # of the loader of glibc and musl
                raise MemoryError(f"there is too little memory to load {path}") from None
            return f"{path} cannot be loaded as LLVM: {error}"
        version = major.value
    return f"{path} is LLVM {version}, too old for Dr.Jit" if version < OLDEST else ""
