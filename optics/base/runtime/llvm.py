"""Find an LLVM library that Dr.Jit can use, before Dr.Jit is loaded.

Dr.Jit compiles its kernels with the system's libLLVM.  Versions 15 and 16 load and then abort the whole
process, older ones are refused.  So the library is chosen here, by its version, and handed over in
DRJIT_LIBLLVM_PATH.
"""

from __future__ import annotations

import ctypes
import os
import re
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from optics.base.runtime.errors import UserError

OLDEST = 17
FOLDERS = (
    "/usr/lib/*-linux-gnu",
    "/usr/lib/llvm-*/lib",
    "/usr/lib64",
    "/usr/lib64/llvm*/lib64",
    "/usr/lib",
    "/usr/local/lib",
    "/opt/homebrew/opt/llvm*/lib",
    "/usr/local/opt/llvm*/lib",
)
NAMES = ("libLLVM.so*", "libLLVM-[0-9]*.so*", "libLLVM*.dylib")
REMEDY = f"install LLVM {OLDEST} or newer (Debian/Ubuntu: apt-get install libllvm19)"


def candidates(folders: Sequence[str] = FOLDERS) -> dict[str, int]:
    """Return {path: major version} of the LLVM libraries in the given folders."""
    versions = {}
    for folder in folders:
        root, pattern = folder, ""
        if "*" in folder:
            root = folder[: folder.index("*")].rsplit("/", 1)[0]
            pattern = folder[len(root) + 1 :] + "/"
        for name in NAMES:
            for path in sorted(Path(root).glob(pattern + name)):
                version = version_of(path)
                if version is not None:
                    versions[str(path)] = version
    return versions


def version_of(path: str | Path) -> int | None:
    """Return the major version of an LLVM library, or None where it is unknown.

    The version is read from the name.  Only where the name has none is the library asked.
    """
    real = Path(path).resolve().name
    if not Path(path).exists():
        return None
    match = re.match(r"libLLVM(?:-|\.so\.|\.)(\d+)", real)
    if match:
        return int(match.group(1))
    try:
        library = ctypes.CDLL(str(path))
        major = ctypes.c_uint()
        library.LLVMGetVersion(ctypes.byref(major), None, None)
    except (OSError, AttributeError):
        return None
    return major.value


def llvm_library(environment: Mapping[str, str] = os.environ, folders: Sequence[str] = FOLDERS) -> str:
    """Return the path of the LLVM library to use.

    It is DRJIT_LIBLLVM_PATH where that is set, otherwise the newest library in the folders.

    Raises UserError : there is none, or it is too old.
    """
    named = environment.get("DRJIT_LIBLLVM_PATH")
    if named:
        version = version_of(named) if Path(named).exists() else None
        if version is None:
            raise UserError(f"DRJIT_LIBLLVM_PATH = {named} is not an LLVM library; unset it or {REMEDY}")
        if version < OLDEST:
            fault = f"DRJIT_LIBLLVM_PATH = {named} is LLVM {version}, which Dr.Jit cannot use"
            raise UserError(f"{fault}; unset it or {REMEDY}")
        return named
    versions = candidates(folders)
    if not versions:
        raise UserError(f"no LLVM library was found; {REMEDY}")
    path, newest = max(versions.items(), key=lambda item: item[1])
    if newest < OLDEST:
        raise UserError(
            f"the newest LLVM library found is version {newest} ({path}), too old for Dr.Jit; {REMEDY}"
        )
    return path


def require_loadable(path: str) -> None:
    """Raise what keeps an LLVM library from being loaded.

    Raises MemoryError : there is too little of it.
    Raises UserError : any other reason.
    """
    try:
        ctypes.CDLL(path)
    except OSError as error:
        if "failed to map" in str(error) or "allocate" in str(error):  # of the loader of glibc and musl
            raise MemoryError(f"there is too little memory to load {path}") from None
        raise UserError(f"cannot load the LLVM library {path}: {error}; {REMEDY}") from None


def main() -> None:
    """Print the path of the LLVM library to use, or the reason why there is none (exit code 2)."""
    try:
        print(llvm_library())
    except UserError as error:
        print(error, file=sys.stderr)
        sys.exit(error.exit_code)


if __name__ == "__main__":
    main()
