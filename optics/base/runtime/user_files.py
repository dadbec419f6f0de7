"""Files that a user names: only regular ones are opened, and only so much is read as is wanted."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from optics.base.runtime.errors import UserError
from thbcad.files import NotRegular, file_or_pipe_bytes, regular_bytes, require_regular

REFUSED = re.compile(r'[<>:"/\\|?*\x00-\x1f]|[ .]$')
DEVICES = re.compile(r"(con|prn|aux|nul|conin\$|conout\$|(com|lpt)[0-9¹²³]) *(\.|$)", re.IGNORECASE)


def require_file_name(subject: str, name: str, remedy: str) -> None:
    """Refuse a text that is no part of a file's name on every system.  subject : what has it for its name.

    Raises UserError : a character or an end that Windows refuses, or the name of a device there.
    """
    if found := REFUSED.search(name):
        fault = f"{found[0]!r} at its end" if found[0] in " ." else f"{found[0]!r} in it"
    elif DEVICES.match(name):
        fault = "it means a device"
    else:
        return
    raise UserError(f"{subject} {name!r} would name files that Windows does not take: {fault}; {remedy}")


def require_regular_file(path: str | Path, noun: str = "") -> None:
    """Refuse folders, and pipes and devices, which may have no end.

    noun : what the file should be, for the message.

    Raises UserError : no such file, or none that holds data.
    """
    with _read(path, noun):
        require_regular(path)


@contextmanager
def reading(path: str | Path) -> Iterator[None]:
    """Take what goes wrong in the block, which does nothing but read a file, for bad input.

    Raises UserError : an OSError or a ValueError of the block.
    """
    try:
        yield
    except OSError as error:
        raise UserError(f"cannot read {error.filename or path}: {error.strerror or error}") from None
    except ValueError as error:
        raise UserError(str(error)) from None


def read_at_most(path: str | Path, most: int, pipes: bool = False) -> bytes:
    """Return the content of a file.  pipes : a pipe may give it, too.

    Raises UserError : it cannot be read, or it is longer than `most` bytes.
    """
    with _read(path):
        return file_or_pipe_bytes(path, most) if pipes else regular_bytes(path, most)


@contextmanager
def _read(path: str | Path, noun: str = "") -> Iterator[None]:
    """Say in one sentence why the block cannot read a file.

    Raises UserError : an OSError or a ValueError of the block.
    """
    name = f"{noun} {path}".lstrip()
    try:
        yield
    except UnicodeEncodeError as error:
        raise UserError(
            f"cannot read {name}: this locale ({error.encoding}) has no such name; set LC_ALL=C.UTF-8"
        ) from None
    except OSError as error:
        remedy = "check who may read it" if isinstance(error, PermissionError) else "check the path"
        if isinstance(error, NotRegular):
            remedy = "give the path of a file"
        raise UserError(f"cannot read {name}: {error.strerror or error}; {remedy}") from None
    except ValueError as error:
        reason = str(error) if str(path) in str(error) else f"cannot read {name}: {error}; check the path"
        raise UserError(reason) from None
