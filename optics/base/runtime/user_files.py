"""Files that a user names: only regular ones are opened, and only so much is read as is wanted."""

from __future__ import annotations

import re
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from optics.base.runtime.errors import UserError

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
    name = f"{noun} {path}".lstrip()
    try:
        mode = Path(path).stat().st_mode
    except UnicodeEncodeError as error:
        raise UserError(
            f"cannot read {name}: this locale ({error.encoding}) has no such name; set LC_ALL=C.UTF-8"
        ) from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise UserError(f"cannot read {name}: {reason}; check the path") from None
    if not stat.S_ISREG(mode):
        found = "a folder" if stat.S_ISDIR(mode) else "a pipe or a device"
        raise UserError(f"cannot read {name}: it is {found}; give the path of a file")


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


def read_at_most(path: str | Path, most: int) -> bytes:
    """Return what a file holds.

    Raises UserError : it cannot be read, or it is longer than `most` bytes.
    """
    require_regular_file(path)
    try:
        with open(path, "rb") as file:
            data = file.read(most + 1)
    except OSError as error:
        raise UserError(f"cannot read {path}: {error.strerror}; check who may read it") from None
    if len(data) > most:
        raise UserError(f"{path} is larger than the {most} bytes allowed; is it the right file?")
    return data
