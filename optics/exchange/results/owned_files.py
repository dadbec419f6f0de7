"""Files that this program wrote: a record beside them holds the SHA-256 of each.

What no record holds, or was changed since, belongs to somebody else and is not replaced unasked.  The page
that shows a run belongs to the last run, and no record speaks of it.
"""

import hashlib
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from optics.base.runtime import UserError, is_text
from thbcad.files import require_regular
from thbcad.io import json_text, read_json, write_files, write_text

HASHES = "sha256"  # key of a record: hashes by file name, relative to the record's folder
BEFORE = "sha256_before"  # another, while files are replaced: lists of those that they may still have
NAMED = 3  # files in a sentence
LIVE = "live.html"
MARK = "<!-- a live page of thbcad: the next run in this folder replaces it -->\n"


def sha256_of(path: Path) -> str:
    """Return the SHA-256 of a file's bytes, hexadecimal."""
    require_regular(path)
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def hashes(folder: Path, names: Iterable[str]) -> dict[str, str]:
    """Return the SHA-256 of files by name; a record keeps it under `HASHES`."""
    return {name: sha256_of(folder / name) for name in sorted(names)}


def write_recorded(
    folder: Path,
    record: str,
    data: Mapping[str, Any],
    contents: Mapping[str, bytes],
    gone: Iterable[str] = (),
) -> None:
    """Write files, and the record of them: data, and their hashes.

    The record comes first, and holds the hashes of what lay there too until all files are in their places:
    wherever this is stopped, they are files that this program wrote.

    gone : names that only an earlier run had, whose files are removed.
    """
    new = {name: hashlib.sha256(content).hexdigest() for name, content in sorted(contents.items())}
    before = {name: sorted(held) for name, held in _owned(folder / record).items()}
    write_text(folder / record, json_text({**data, HASHES: new, BEFORE: before}))
    write_files({folder / name: content for name, content in contents.items()})
    for name in gone:  # no record would speak of it any more
        (folder / name).unlink(missing_ok=True)
    write_text(folder / record, json_text({**data, HASHES: new}))


def recorded(record: Path, key: str = HASHES) -> dict[str, Any]:
    """Return the hashes that a record holds, none where there is no record."""
    try:
        data = read_json(record, "record")
    except (OSError, ValueError, RecursionError):
        return {}
    held = data.get(key) if isinstance(data, Mapping) else None
    return dict(held) if isinstance(held, Mapping) else {}


def _owned(record: Path) -> dict[str, set[str]]:
    """Return the hashes, by name, under which files belong to this program."""
    owned = {name: {str(found)} for name, found in recorded(record).items()}
    for name, found in recorded(record, BEFORE).items():
        owned.setdefault(name, set()).update(map(str, found if isinstance(found, list) else ()))
    return owned


def foreign(folder: Path, names: Iterable[str], record: str) -> list[str]:
    """Return which of the names are files that this program did not write, or that were changed since.

    The record itself belongs to this program where it holds hashes.
    """
    held = _owned(folder / record)
    present = [name for name in names if (folder / name).exists()]
    return [
        name
        for name in present
        if (not held if name == record else sha256_of(folder / name) not in held.get(name, ()))
    ]


def require_own(folder: Path, names: Iterable[str], record: str, force: bool) -> None:
    """Raise UserError where a file would be replaced that this program did not write; not with `force`."""
    lost = [] if force else foreign(folder, names, record)
    if lost:
        shown = ", ".join(str(folder / name) for name in lost[:NAMED])
        more = f" and {len(lost) - NAMED} more" if len(lost) > NAMED else ""
        raise UserError(
            f"{shown}{more} would be replaced, but was not written by this program or was changed since; "
            "choose another --out, or replace it with --force"
        )


def require_places(folder: Path, names: Iterable[str]) -> None:
    """Raise UserError where a folder lies in the place of a file, or something else in that of a folder."""
    for path in (folder / name for name in names):
        parent, wrong = path.parent, ""
        if path.is_dir():
            wrong = "it is a folder"
        elif (parent.exists() or parent.is_symlink()) and not parent.is_dir():
            wrong = f"{parent} is no folder"
        if wrong:
            raise UserError(f"cannot write {path}: {wrong}; move it or choose another with --out")


def writable_folder(path: Path) -> None:
    """Make a folder and see that it can be written, before any work is done.

    Raises UserError : it cannot.
    """
    try:
        reason = _never(path)
        if not reason:
            path.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=path) as probe:
                probe.write(b"0")
    except OSError as error:
        reason = str(error.strerror)
    if reason:
        raise UserError(f"cannot write to the result folder {path}: {reason}; choose another with --out")


def require_writable(path: Path) -> None:
    """Raise UserError unless a file can be written there, before any work is done."""
    reason = "it is a folder" if path.is_dir() else ""
    if not is_text(str(path)):
        reason = "its name is no UTF-8 text, which CAD kernels want"
    if path.exists() and not path.is_dir() and not path.is_file():
        reason = "it is a device or a pipe, not a file"
    if not path.parent.is_dir():
        reason = f"there is no folder {path.parent}"
    try:
        if not reason:
            with tempfile.TemporaryFile(dir=path.parent) as probe:
                probe.write(b"0")
    except OSError as error:
        reason = str(error.strerror)
    if reason:
        raise UserError(f"cannot write {path}: {reason}; choose another --out")


def _never(folder: Path) -> str:
    """Return why a folder cannot be made whoever asks, "" where nothing is in its way."""
    if not is_text(str(folder)):
        return "its name is no UTF-8 text, which CAD kernels want"
    for way in (folder, *folder.parents):
        if way.is_symlink() and not way.exists():
            return f"{way} is a link to {way.readlink()}, which does not exist"
        if way.exists() and not way.is_dir():
            return f"{way} is no folder"
    return ""


def write_live_page(folder: Path, page: str) -> None:
    """Write the page, with the mark that tells it from files of others."""
    write_text(folder / LIVE, page + MARK)


def remove_live_page(folder: Path) -> None:
    """Remove the page of an earlier run; a file of somebody else stays."""
    path = folder / LIVE
    if path.is_file() and path.read_bytes().endswith(MARK.encode()):
        path.unlink()


def require_room_for_live_page(folder: Path, force: bool) -> None:
    """Raise UserError where a folder, or without `force` a file of somebody else, would be replaced."""
    path = folder / LIVE
    if path.is_dir() or (path.exists() and not force):
        raise UserError(
            f"{path} would be replaced, but is no page of this program; move it, or leave out --live"
        )
