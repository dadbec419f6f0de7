"""Zemax binary source files (.dat): a header of 208 bytes, then rows of 7 or 8 numbers in single precision.

    x y z l m n flux [wavelength in um]

Source: the layout in OpticStudio's help, "Binary Source File format".
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from optics.base.runtime import UserError
from optics.scene.ray_files.binary import packed_type, record, require_known, require_rows, rows
from optics.scene.ray_files.ray_set import IN_WATTS, RaySet

VERSION = 1010
HEADER = packed_type(
    {
        "version": "i4",
        "rays": "u4",
        "description": "S100",
        "source_flux": "f4",
        "set_flux": "f4",
        "wavelength": "f4",  # um
        "angles": "4f4",
        "length_unit": "u4",
        "placement": "9f4",
        "unused": "4f4",
        "spectral": "i4",  # 0: rows without wavelength, 2: rows with it
        "flux_unit": "i4",  # 0: W, 1: lm
        "reserved": "2i4",
    }
)
MILLIMETRES = {0: 1000.0, 1: 25.4, 2: 10.0, 3: 304.8, 4: 1.0}  # m, inch, cm, feet, mm
MOST_RAYS = 4_000_000_000


def read_zemax(path: Path, data: memoryview) -> RaySet:
    """Return the rays of a Zemax file.

    Raises UserError : an unknown unit, or fewer or more rays than the header promises.
    """
    head = record(data, HEADER, path)
    require_known(head, {"length_unit": MILLIMETRES, "spectral": (0, 2), "flux_unit": (0, 1)}, path)
    columns = 8 if head["spectral"] else 7
    require_rows(path, data, HEADER.itemsize, head["rays"], columns)
    table = rows(data, HEADER.itemsize, head["rays"], columns)
    scale = MILLIMETRES[head["length_unit"]]
    wavelength = 1000 * table[:, 7] if head["spectral"] else None
    if wavelength is None and head["wavelength"] > 0:
        wavelength = np.full(len(table), 1000 * head["wavelength"], np.float32)
    position = table[:, :3] if scale == 1 else (table[:, :3] * scale).astype(np.float32)
    return RaySet(position, table[:, 3:6], table[:, 6], "lm" if head["flux_unit"] else "W", wavelength)


def zemax_bytes(rays: RaySet) -> bytes:
    """Return the bytes of a Zemax file in mm.

    Raises UserError : more rays than the format holds, or lumens with a wavelength for every ray, which it
        does not know.
    """
    spectral = rays.wavelength is not None and bool(np.ptp(rays.wavelength))
    if len(rays) > MOST_RAYS:
        raise UserError(f"a Zemax ray file holds {MOST_RAYS} rays at most, got {len(rays)}")
    if spectral and rays.unit == "lm":
        raise UserError(f"a Zemax ray file has no wavelength per ray in lumens; {IN_WATTS}")
    head = np.zeros(1, HEADER)
    head["version"], head["rays"], head["length_unit"] = VERSION, len(rays), 4
    head["description"] = b"thbcad"
    head["source_flux"] = head["set_flux"] = rays.total
    head["spectral"], head["flux_unit"] = 2 * spectral, rays.unit == "lm"
    if rays.wavelength is not None and not spectral:
        head["wavelength"] = rays.wavelength[0] / 1000
    columns = [rays.position, rays.direction, rays.flux[:, None]]
    if spectral:
        assert rays.wavelength is not None
        columns.append(rays.wavelength[:, None] / np.float32(1000))
    return bytes(head.tobytes() + np.hstack(columns).astype("<f4").tobytes())
