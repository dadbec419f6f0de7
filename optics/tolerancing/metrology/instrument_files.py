"""Points of files that state their own units: X3P, the .dat and .datx of Zygo, the GXYZF of Gwyddion.

The grid of a camera has its origin in the middle, and its first row at +y:

    x = (column - (columns - 1) / 2) p,   y = ((rows - 1) / 2 - row) p,   p metres per pixel.

Sizes that a file announces are compared with the bytes that it has before memory is taken.

Sources: ISO 25178-72:2017; MetroPro reference guide (Zygo OMP-0347), binary data files; Gwyddion user guide,
simple XYZ files.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Callable
from io import BytesIO
from math import isfinite, prod
from struct import unpack_from
from typing import Any
from zipfile import ZipFile

import numpy as np

from optics.base.runtime import UserError
from thbcad.checks import Floats
from thbcad.doors import loaded

MOST_BYTES = 1 << 28  # 256 MB: 4 million rows of 64 characters, more than MOST_POINTS can use
MOST_POINTS = 2_000_000  # their matrix of 16 functions each takes 0.4 GB
MOST_XML = 1 << 24  # 16 MB: the tree of an X3P file then takes 0.5 GB
METRE = 1e3  # mm
MILLIMETRES = {"m": METRE, "mm": 1.0, "um": 1e-3, "nm": 1e-6}
GWYDDION = b"Gwyddion XYZ Field 1.0\n"
MICRO = str.maketrans("\u00b5\u03bc", "uu")  # the micro sign, and the Greek letter
ZYGO_HEADER = 834  # bytes, of the oldest format
INVALID = 2147483640  # phases from here on
RESOLUTIONS = {0: 4096, 1: 32768, 2: 131072}  # phases per fringe
DATX_UNITS = {"Meters": METRE, "MilliMeters": 1.0, "MicroMeters": 1e-3, "NanoMeters": 1e-6}
FRINGE = ("Wavelength", "Interferometric Scale Factor", "Obliquity Factor")  # m, and what it is multiplied by
PITCH = "Lateral Resolution:Value"  # how the name of m per pixel ends
DEFLATED: tuple[list[int], ...] = ([], [1], [2, 1])  # filters of chunks: none, gzip, bytes shuffled before it


def instrument_points(data: bytes, name: str) -> Floats | None:
    """Return x, y, z, (3, n) mm, NaN where there is no value, or None where no instrument's file begins so.

    Raises UserError : the file is damaged, too large, or holds something else than one surface.
    Raises MissingPackage : x3pio or h5py, which read X3P and .datx.
    """
    for magic, (kind, read) in READERS.items():
        if data.startswith(magic):
            try:
                return read(data)
            except ImportError:
                raise
            except Exception as error:  # whatever damaged bytes make zipfile, x3pio and HDF5 raise
                reason = " ".join(str(error).split()) or "it may be cut off"
                reason += "" if ";" in reason else "; save it again"
                raise UserError(f"{name} cannot be read as {kind}: {reason}") from None
    return None


def grid_points(heights: Floats, pitch: tuple[float, float], middle: tuple[float, float]) -> Floats:
    """Return the points (3, n) of a grid whose first row is at +y.

    heights : (rows, columns).  pitch, middle : of the grid, in x and y.
    """
    rows, columns = heights.shape
    x = middle[0] + (np.arange(columns) - (columns - 1) / 2) * pitch[0]
    y = middle[1] + ((rows - 1) / 2 - np.arange(rows)) * pitch[1]
    return np.stack([np.tile(x, rows), np.repeat(y, columns), heights.ravel()])


def _require_few(count: int) -> None:
    if not 0 < count <= MOST_POINTS:
        raise ValueError(f"it announces {count:,} points, wanted 1 to {MOST_POINTS:,}; save fewer")


def _require_positive(**numbers: float) -> None:
    for word, number in numbers.items():
        if not (isfinite(number) and number > 0):
            raise ValueError(f"its {word.replace('_', ' ')} must be positive, got {number:g}")


def _x3p(data: bytes) -> Floats:
    """Return the points of an X3P file: a grid or a cloud, turned and shifted as the file says."""
    x3pio = loaded("x3pio")
    with ZipFile(BytesIO(data)) as parts:
        sizes = [(part.filename, part.file_size) for part in parts.infolist()]
    for word, size, most in (
        ("all of it", sum(size for _, size in sizes), MOST_BYTES),
        ("main.xml", max((size for name, size in sizes if name.endswith("main.xml")), default=0), MOST_XML),
    ):
        if size > most:
            raise ValueError(f"{word} unpacks to {size:,} bytes, more than {most:,}; save fewer points")
    about = x3pio.info(BytesIO(data))
    _require_few(prod(about.shape))
    if about.layer_count != 1:
        raise ValueError(f"it holds {about.layer_count} layers, wanted one; save each by itself")
    points: Floats = x3pio.read(BytesIO(data)).layers[0].points()
    return METRE * points.reshape(-1, 3).T


def _gxyzf(data: bytes) -> Floats:
    """Return the points of a GXYZF file with the first of its channels."""
    end = data.find(b"\0")
    lines = data[len(GWYDDION) : end].decode().splitlines() if end > 0 else []
    fields = {word.strip(): value.strip() for word, _, value in (line.partition("=") for line in lines)}
    counts = [fields.get(word, "") for word in ("NChannels", "NPoints")]
    if not all(re.fullmatch("[1-9][0-9]{,8}", count) for count in counts):
        raise ValueError("its header must state NChannels and NPoints as whole numbers; it may be cut off")
    columns, rows = 2 + int(counts[0]), int(counts[1])
    _require_few(rows)
    start = end + 8 - end % 8
    _require_size(len(data), start + 8 * columns * rows)
    scales = []
    for words in (["XYUnits"], ["ZUnits1", "ZUnits"]):
        unit = next((fields[word] for word in words if word in fields), "")
        if (scale := MILLIMETRES.get(unit.translate(MICRO))) is None:
            raise ValueError(f"its {words[0]} must be one of {', '.join(MILLIMETRES)}, got {unit!r}")
        scales.append(scale)
    points = np.frombuffer(data, "<f8", columns * rows, start).reshape(rows, columns)[:, :3]
    return points.T * np.array([[scales[0]], [scales[0]], [scales[1]]])


def _require_size(size: int, wanted: int) -> None:
    if size != wanted:
        raise ValueError(f"it has {size:,} bytes, and its header announces {wanted:,}; it may be cut off")


def _zygo(data: bytes) -> Floats:
    """Return the points of a MetroPro .dat file, whose phases p are heights p S O wavelength / R."""
    if len(data) < ZYGO_HEADER:
        raise ValueError(f"its header needs {ZYGO_HEADER} bytes, it has {len(data)}; it may be cut off")
    (header,) = unpack_from(">I", data, 6)
    *intensities, columns, rows = unpack_from(">3H", data, 52) + unpack_from(">2H", data, 68)
    scale, wavelength = unpack_from(">2f", data, 164)
    obliquity, _, pitch = unpack_from(">3f", data, 176)
    (resolution,), (inverted,) = unpack_from(">H", data, 218), unpack_from(">H", data, 232)
    start = header + 2 * prod(intensities)
    _require_few(rows * columns)
    _require_size(len(data), start + 4 * rows * columns)
    if resolution not in RESOLUTIONS:
        raise ValueError(f"its phase resolution must be 0, 1 or 2, got {resolution}")
    if inverted:
        raise ValueError("its data sign is inverted, which programs read in two ways; save it as normal")
    _require_positive(
        scale_factor=scale, wavelength=wavelength, obliquity_factor=obliquity, metres_per_pixel=pitch
    )
    phases = np.frombuffer(data, ">i4", rows * columns, start).reshape(rows, columns)
    height = METRE * scale * obliquity * wavelength / RESOLUTIONS[resolution]
    return _camera_points(np.where(phases < INVALID, height * phases, np.nan), pitch)


def _camera_points(heights: Floats, pitch: float) -> Floats:
    """Return the points of heights in mm.  pitch : m."""
    return grid_points(heights, (METRE * pitch, METRE * pitch), (0.0, 0.0))


def _datx(data: bytes) -> Floats:
    """Return the points of a .datx file: the one dataset of Data/Surface, in fringes or a unit of length."""
    h5py = loaded("h5py")
    with h5py.File(BytesIO(data), "r") as file:
        surfaces = list(file["Data/Surface"].values())
        if len(surfaces) != 1:
            raise ValueError(f"it holds {len(surfaces)} surfaces, wanted one; save each by itself")
        (surface,) = surfaces
        _require_own(surface, file)
        unit = _attribute(surface, "Unit")
        if unit == "Fringes":
            numbers = {word: float(_attribute(surface, word)) for word in FRINGE}
            _require_positive(**numbers)
            height = METRE * prod(numbers.values())
        elif (height := DATX_UNITS.get(unit, 0.0)) == 0:
            raise ValueError(f"its unit must be one of Fringes, {', '.join(DATX_UNITS)}, got {unit!r}")
        pitches = {
            word: float(_attribute(context, word))
            for context in file["Attributes"].values()
            for word in context.attrs
            if word.endswith(PITCH)
        }
        pitch = pitches[max(pitches)] if pitches else 0.0  # "Surface Data Context" before "Data Context"
        _require_positive(metres_per_pixel=pitch)
        values = surface[()].astype(np.float64)
        values[values >= float(_attribute(surface, "No Data"))] = np.nan
    return _camera_points(height * values, pitch)


def _attribute(node: Any, word: str) -> Any:
    """Return an attribute, the first number or text of it."""
    if word not in node.attrs:
        raise ValueError(f"{node.name} has no attribute {word!r}")
    value = np.ravel(node.attrs[word])[0]
    return value.decode() if isinstance(value, bytes) else value


def _require_own(surface: Any, file: Any) -> None:
    """Raise ValueError unless a dataset is a grid of numbers of this file, none of whose chunks is a bomb.

    HDF5 unpacks a chunk to whatever size it has.
    """
    own = getattr(surface, "file", None) == file and hasattr(surface, "chunks")
    if not own or surface.external or surface.is_virtual:
        raise ValueError("its surface must be a dataset of the file itself")
    _require_few(surface.size)
    if len(surface.shape) != 2 or surface.dtype.kind not in "fiu":
        raise ValueError(f"its surface must be a grid of numbers, got {surface.dtype} {surface.shape}")
    if surface.chunks is None:
        return
    filters = surface.id.get_create_plist()
    codes = [filters.get_filter(k)[0] for k in range(filters.get_nfilters())]
    if codes not in DEFLATED:
        raise ValueError("its surface is packed by another filter than gzip; save it as gzip or unpacked")
    most = prod(surface.chunks) * surface.dtype.itemsize
    _require_few(prod(surface.chunks))
    places: list[tuple[int, ...]] = []
    surface.id.chunk_iter(lambda chunk: places.append(chunk.chunk_offset))
    for place in places if codes else ():
        _, chunk = surface.id.read_direct_chunk(place)
        if len(zlib.decompressobj().decompress(chunk, most + 1)) > most:
            raise ValueError(f"a chunk of its surface unpacks to more than its {most:,} bytes")


READERS: dict[bytes, tuple[str, Callable[[bytes], Floats]]] = {  # by the bytes with which a file begins
    b"PK\3\4": ("X3P", _x3p),
    GWYDDION: ("GXYZF of Gwyddion", _gxyzf),
    b"\x88\x1b\x03": ("Zygo's .dat", _zygo),
    b"\x89HDF\r\n\x1a\n": ("Zygo's .datx", _datx),
}
