"""IES TM-25 ray files (.tm25ray): a header of 36 288 bytes, tables and texts, then rows of single precision.

    x y z kx ky kz [W] [nm] [lm] [three of Stokes, three of polarisation] [X Z] [spectrum] [own columns]

A row holds the columns whose flags are set.  Versions 2013 (TM-25-13) and 2020 (TM-25-20) are read.  Programs
differ in what they pad between the texts and the rays: the start that agrees with the length of the file and
makes directions unit vectors is taken.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from optics.base.runtime import UserError
from optics.scene.ray_files.binary import are_rays, packed_type, record, require_rows, rows
from optics.scene.ray_files.ray_set import IN_WATTS, RaySet, Unit

SIGNATURE, VERSIONS = b"TM25", (2013, 2020)
TEXTS = 9  # name, maker, ... of the source
NAME_OF_SOURCE = "thbcad"  # where the program writes rays
HEADER = packed_type(
    {
        "signature": "S4",
        "version": "i4",
        "method": "i4",
        "lumens": "f4",
        "watts": "f4",
        "rays": "u8",
        "date": "S28",
        "start": "i4",
        "spectrum": "i4",  # 0: none, 1: one wavelength, 2: one per ray, 3: one table, 4: a table per ray
        "wavelength": "f4",  # nm
        "range": "2f4",
        "tables": "i4",
        "own_columns": "i4",
        "text": "i4",  # bytes
        "reserved": "S168",
        "has": "8i4",  # position, direction, W, nm, lm, Stokes, tristimulus, number of a spectrum
        "texts": f"({TEXTS},1000)u4",
    }
)
WIDTHS = 3, 3, 1, 1, 1, 6, 2, 1  # columns of each flag
WATTS, WAVELENGTH, LUMENS = 2, 3, 4  # flags
NAME = 512  # bytes of the name of an own column
PADDED = 32  # bytes, to a multiple of which tables are padded
LOOKED_AT = 1000  # rays, by which a start is judged


def read_tm25(path: Path, data: memoryview) -> RaySet:
    """Return the rays of a TM-25 file; of two fluxes `flux` is the one in watts.

    Raises UserError : another version, a header that contradicts itself, or fewer or more rays than
        it promises.
    """
    head = record(data, HEADER, path)
    if head["version"] not in VERSIONS:
        known = " and ".join(map(str, VERSIONS))
        raise UserError(f"{path} has version {head['version']} of TM-25; {known} are read")
    has: list[int] = head["has"]
    if not set(has) <= {0, 1} or has[:2] != [1, 1]:
        raise UserError(
            f"{path} has the flags {has} in its header; position and direction must be 1, the others 0 or 1"
        )
    if not (has[WATTS] or has[LUMENS]):
        raise UserError(f"{path} holds no flux: the flags of watts and lumens are both 0")
    for key in ("tables", "own_columns", "text"):
        if head[key] < 0:
            raise UserError(
                f"{path} has a negative size of {key.replace('_', ' ')}, {head[key]}, in its header"
            )
    columns = sum(width for width, there in zip(WIDTHS, has) if there) + head["own_columns"]
    table = _table(path, data, head, columns)
    first = np.cumsum([0, *(width * there for width, there in zip(WIDTHS, has))])
    flux = WATTS if has[WATTS] else LUMENS
    wavelength = table[:, first[WAVELENGTH]] if has[WAVELENGTH] else None
    if wavelength is None and head["spectrum"] == 1 and head["wavelength"] > 0:
        wavelength = np.full(len(table), head["wavelength"], np.float32)
    lumens = table[:, first[LUMENS]] if has[WATTS] and has[LUMENS] else None
    if lumens is not None and not np.isfinite(lumens).all():
        lumens = None
    unit: Unit = "W" if has[WATTS] else "lm"
    return RaySet(table[:, :3], table[:, 3:6], table[:, first[flux]], unit, wavelength, lumens)


def _table(path: Path, data: memoryview, head: dict[str, Any], columns: int) -> NDArray[np.float32]:
    """Return the rows of a file."""
    count, starts = head["rays"], [*_starts(path, data, head, columns)]
    for start in starts:
        size = 4 * columns * min(count, LOOKED_AT)
        if start + size <= len(data) and are_rays(rows(data, start, min(count, LOOKED_AT), columns)):
            require_rows(path, data, start, count, columns)
            return rows(data, start, count, columns)
    require_rows(path, data, min(starts), count, columns)
    raise UserError(f"{path} holds no rays where its header says: directions there do not have length 1")


def _starts(path: Path, data: memoryview, head: dict[str, Any], columns: int) -> Iterator[int]:
    """Yield where the rays of a file may begin, the likeliest first."""
    at = HEADER.itemsize
    for k in range(head["tables"]):
        if at + 4 > len(data):
            raise UserError(f"{path} ends in its spectral tables; it may be truncated")
        pairs = int(np.frombuffer(data[at : at + 4], "<i4")[0])
        if pairs <= 0:
            raise UserError(f"{path} has {pairs} pairs in its spectral table {k + 1}")
        at += 4 + 8 * pairs
    names = NAME * head["own_columns"] + head["text"]
    bare, padded = at + names, -(-at // PADDED) * PADDED + names
    behind = len(data) - 4 * columns * head["rays"]
    yield from dict.fromkeys(start for start in (padded, bare, behind) if start >= bare)


def tm25_bytes(rays: RaySet) -> bytes:
    """Return the bytes of a TM-25 file of version 2020, without a date: the same rays make the same bytes.

    Raises UserError : lumens with a wavelength for every ray, which the format does not know.
    """
    if rays.unit == "lm" and rays.wavelength is not None and np.ptp(rays.wavelength):
        raise UserError(f"a TM-25 file has no wavelength per ray in lumens; {IN_WATTS}")
    head = np.zeros(1, HEADER)
    head["signature"], head["version"], head["rays"] = SIGNATURE, VERSIONS[-1], len(rays)
    head["lumens"], head["watts"] = np.nan, np.nan
    head["lumens" if rays.unit == "lm" else "watts"] = rays.total
    head["wavelength"], head["range"] = np.nan, np.nan
    head["texts"][0, 0, : len(NAME_OF_SOURCE)] = [ord(letter) for letter in NAME_OF_SOURCE]  # in UTF-32
    has = [1, 1, rays.unit == "W", 0, rays.unit == "lm", 0, 0, 0]
    columns = [rays.position, rays.direction, rays.flux[:, None]]
    if rays.wavelength is not None:
        head["range"] = rays.wavelength.min(), rays.wavelength.max()
        if np.ptp(rays.wavelength):
            head["spectrum"], has[WAVELENGTH] = 2, 1
            columns.append(rays.wavelength[:, None])
        else:
            head["spectrum"], head["wavelength"] = 1, rays.wavelength[0]
    head["has"] = has
    return bytes(head.tobytes() + np.hstack(columns).astype("<f4").tobytes())
