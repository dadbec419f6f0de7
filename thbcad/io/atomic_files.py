"""Files that appear whole or not at all, and strict JSON."""

import errno
import json
import math
import os
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any


def write_bytes(path: str | Path, data: bytes) -> None:
    """Write `data` to `path` atomically: a temporary file in the same folder is renamed over it.

    Raises OSError : the folder is missing, not writable or full; the old file is untouched.
    """
    write_files({Path(path): data})


def write_files(files: Mapping[Path, bytes]) -> None:
    """Write several files: none is replaced before the bytes of all are on the disk.

    Raises OSError : as `write_bytes`; the old files are untouched, unless the disk fails between two
        renamings; a name that is a device or a pipe, which renaming would replace by a file.
    """
    staged: dict[Path, str] = {}
    try:
        for path, data in files.items():
            if path.exists() and not path.is_file() and not path.is_dir():
                what = "this is a device or a pipe: give the name of a file"
                raise OSError(errno.EINVAL, what, str(path))
            handle, staged[path] = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
            with os.fdopen(handle, "wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            mask = os.umask(0)
            os.umask(mask)
            os.chmod(staged[path], 0o666 & ~mask)
        for path in files:
            os.replace(staged[path], path)
            del staged[path]
    except BaseException as error:
        for name in staged.values():
            os.unlink(name)
        if isinstance(error, OSError):
            error.filename = str(path)
        raise


def write_text(path: str | Path, text: str) -> None:
    """Write `text` as UTF-8, atomically."""
    write_bytes(path, text.encode("utf-8"))


def json_text(data: object) -> str:
    """Return strict JSON; numbers that JSON does not have (inf, nan) become null."""
    return json.dumps(_finite(data), indent=1, allow_nan=False) + "\n"


def _finite(data: Any) -> Any:
    if isinstance(data, dict):
        return {key: _finite(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [_finite(value) for value in data]
    return None if isinstance(data, float) and not math.isfinite(data) else data
