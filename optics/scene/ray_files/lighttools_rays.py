"""LightTools binary ray files (.ray): a header of 44 bytes, rows of 7 or 8 numbers, and "LTRFEND".

x y z l m n flux [wavelength in nm]
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from optics.base.runtime import UserError
from optics.scene.ray_files.binary import packed_type, record, require_known, rows
from optics.scene.ray_files.ray_set import RaySet

SIGNATURE, END = b"LTRF", b"LTRFEND"
HEADER = packed_type(
    {
        "signature": "S4",
        "major": "u4",  # 2; 3 has polarisation
        "minor": "u4",
        "flux_unit": "u4",  # 0: W, 1: lm
        "far_field": "u4",  # 1: rows without position
        "colour": "u4",  # 0: none, 1: tristimulus values, 2: wavelength
        "length_unit": "u4",
        "origin": "3f4",
        "flux": "f4",
    }
)
MILLIMETRES = {1: 1.0, 2: 10.0, 3: 1000.0, 4: 25.4, 5: 304.8, 6: 1e-3, 7: 1e-6}


def read_lighttools(path: Path, data: memoryview) -> RaySet:
    """Return the rays of a LightTools file.

    Raises UserError : a file without positions or with polarisation or tristimulus values, or a length
        that is no whole number of rays.
    """
    head = record(data, HEADER, path)
    if head["major"] != 2:
        raise UserError(f"{path} has version {head['major']} of LightTools' format; only 2 is read")
    if head["far_field"]:
        raise UserError(f"{path} holds directions without positions; write it again as near-field data")
    if head["colour"] == 1:
        raise UserError(f"{path} holds tristimulus values; write it again with wavelengths or without colour")
    require_known(head, {"flux_unit": (0, 1), "colour": (0, 2), "length_unit": MILLIMETRES}, path)
    columns = 8 if head["colour"] == 2 else 7
    held = len(data) - HEADER.itemsize - len(END)
    if bytes(data[-len(END) :]) != END or held % (4 * columns):
        raise UserError(f"{path} does not end with a whole ray and LTRFEND; it may be truncated")
    table = rows(data, HEADER.itemsize, held // (4 * columns), columns)
    scale, origin = MILLIMETRES[head["length_unit"]], np.array(head["origin"], np.float32)
    position = table[:, :3]
    if scale != 1 or origin.any():
        position = ((position + origin.astype(np.float64)) * scale).astype(np.float32)
    wavelength = table[:, 7] if columns == 8 else None
    return RaySet(position, table[:, 3:6], table[:, 6], "lm" if head["flux_unit"] else "W", wavelength)


def lighttools_bytes(rays: RaySet) -> bytes:
    """Return the bytes of a LightTools file in mm."""
    head = np.zeros(1, HEADER)
    head["signature"], head["major"], head["length_unit"] = SIGNATURE, 2, 1
    head["flux_unit"], head["flux"] = rays.unit == "lm", rays.total
    columns = [rays.position, rays.direction, rays.flux[:, None]]
    if rays.wavelength is not None:
        head["colour"] = 2
        columns.append(rays.wavelength[:, None])
    return bytes(head.tobytes() + np.hstack(columns).astype("<f4").tobytes() + END)
