"""Ray files of all formats: binary ones are known by their first bytes, and written by their suffix."""

from __future__ import annotations

import mmap
from collections.abc import Callable
from pathlib import Path

from optics.base.runtime import UserError, require_regular_file
from optics.scene.ray_files.lighttools_rays import lighttools_bytes, read_lighttools
from optics.scene.ray_files.ray_set import RaySet
from optics.scene.ray_files.text_rays import read_text_rays
from optics.scene.ray_files.tm25_rays import read_tm25, tm25_bytes
from optics.scene.ray_files.zemax_rays import VERSION, read_zemax, zemax_bytes
from thbcad.io import write_bytes

READERS: dict[bytes, Callable[[Path, memoryview], RaySet]] = {  # by the first bytes of a file
    b"TM25": read_tm25,
    b"LTRF": read_lighttools,
    VERSION.to_bytes(4, "little"): read_zemax,
}
WRITERS: dict[str, Callable[[RaySet], bytes]] = {  # by the suffix
    ".tm25ray": tm25_bytes,
    ".dat": zemax_bytes,
    ".ray": lighttools_bytes,
}


def read_rays(path: str | Path) -> RaySet:
    """Return the rays of a TM-25, Zemax or LightTools file (binary) or of a text; its suffix may be any.

    The file is mapped, not read: what its header promises is compared with its length before memory is taken.

    Raises UserError : no such file, another format, or a file that contradicts itself; one sentence names it.
    """
    path = Path(path)
    require_regular_file(path)
    try:
        with path.open("rb") as file:
            data = memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ))
    except OSError as error:
        raise UserError(f"cannot read {path}: {error.strerror}; check the path") from None
    except ValueError:  # mmap takes no empty file
        raise UserError(f"{path} is empty; give a ray file") from None
    reader = READERS.get(bytes(data[:4]), read_text_rays)
    try:
        return reader(path, data)
    except UserError as error:
        raise UserError(str(error) if str(path) in str(error) else f"{path}: {error}") from None


def write_rays(rays: RaySet, path: str | Path) -> None:
    """Write rays as TM-25 (.tm25ray), Zemax (.dat) or LightTools (.ray), atomically.

    Numbers are kept bit for bit, but for wavelengths in Zemax files, which are in um there.

    Raises UserError : an unknown suffix, or rays that the format cannot hold.  OSError : as `write_bytes`.
    """
    path = Path(path)
    require_ray_suffix(path)
    write_bytes(path, ray_bytes(rays, path.suffix))


def ray_bytes(rays: RaySet, suffix: str) -> bytes:
    """Return the bytes of the ray file of a suffix that can be written.

    Raises UserError : rays that the format cannot hold.
    """
    return WRITERS[suffix.lower()](rays)


def require_ray_suffix(path: Path) -> None:
    """Raise UserError unless a path has the suffix of a ray file that can be written."""
    if path.suffix.lower() not in WRITERS:
        raise UserError(f"{path} has no suffix of a ray file; choose one of {', '.join(WRITERS)}")
