"""Bytes of files that a user names: no more than wanted, and no pipe is waited for without end.

A regular file can be read twice.  A pipe, such as `<(zcat points.gz)` of a shell, gives its bytes once.
"""

import errno
import os
import select
import stat
from pathlib import Path

PATIENCE = 60.0  # seconds without a byte, after which a pipe counts as one that nobody writes to
PIPE = "a pipe or a device"
MOST = 1 << 28  # bytes that are read where nothing less will do
PART = 1 << 20  # bytes that are asked for at once


class NotRegular(OSError):
    """A folder, a pipe or a device in the place of a file."""


def require_regular(path: str | Path) -> None:
    """Raise OSError where there is no file, or a folder, a pipe or a device, which may have no end."""
    if found := _other_kind(path):
        raise _unreadable(path, f"it is {found}, not a file")


def regular_bytes(path: str | Path, most: int = MOST) -> bytes:
    """Return the content of a regular file.

    Raises OSError : it cannot be read; it is a folder, a pipe or a device.
    Raises ValueError : it is longer than `most` bytes.
    """
    require_regular(path)
    with open(path, "rb") as file:
        return _at_most(path, file.read(most + 1), most)


def file_or_pipe_bytes(path: str | Path, most: int = MOST) -> bytes:
    """Return the content of a file, or what a pipe gives until its end.

    Raises OSError : it cannot be read; it is a folder; nothing came from it for 60 seconds.
    Raises ValueError : it is longer than `most` bytes.
    """
    nonblocking = getattr(os, "O_NONBLOCK", None)  # Windows has no such pipes among its files
    if nonblocking is None or _other_kind(path) != PIPE:
        return regular_bytes(path, most)
    handle = os.open(path, os.O_RDONLY | nonblocking)
    try:
        data = bytearray()
        while len(data) <= most:
            if not select.select([handle], [], [], PATIENCE)[0]:
                raise _unreadable(path, f"it is a pipe, and nothing came from it for {PATIENCE:g} seconds")
            part = os.read(handle, PART)
            if not part:
                break
            data += part
    finally:
        os.close(handle)
    return _at_most(path, bytes(data), most)


def _other_kind(path: str | Path) -> str:
    """Return what a path leads to where that is no regular file, else ""."""
    mode = Path(path).stat().st_mode
    if stat.S_ISREG(mode):
        return ""
    return "a folder" if stat.S_ISDIR(mode) else PIPE


def _unreadable(path: str | Path, reason: str) -> NotRegular:
    return NotRegular(errno.EINVAL, reason, str(path))


def _at_most(path: str | Path, data: bytes, most: int) -> bytes:
    if len(data) > most:
        raise ValueError(f"{path} is larger than the {most:,} bytes allowed; is it the right file?")
    return data
