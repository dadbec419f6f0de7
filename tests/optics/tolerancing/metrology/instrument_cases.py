"""Files of instruments, written by hand as their formats are described: heights (rows, columns) in mm."""

import struct
from hashlib import md5
from io import BytesIO
from zipfile import ZIP_DEFLATED, ZipFile

import h5py
import numpy as np
from numpy.typing import NDArray

from tests.optics.tolerancing.metrology.cases import freeform, ripple

Floats = NDArray[np.float64]
PITCH = 2.0**-12  # m, which single precision holds
COLUMNS, ROWS = 81, 65
SCALE, WAVELENGTH, OBLIQUITY = 0.5, float(np.float32(632.8e-9)), 1.25
QUANTUM = 1e3 * SCALE * WAVELENGTH * OBLIQUITY / 32768  # mm
INVALID = 2147483640
SURFACE = freeform()
X, Y = (1e3 * PITCH * (np.arange(n) - (n - 1) / 2) for n in (COLUMNS, ROWS))
HEIGHTS = SURFACE.grid(X, Y).T + ripple(*np.meshgrid(X, Y))  # rows of constant y, from -y
POINTS = np.stack([*(g.ravel() for g in np.meshgrid(X, Y)), HEIGHTS.ravel()])

AXIS = """<C{0}><AxisType>{1}</AxisType><DataType>D</DataType><Increment>{2!r}</Increment>
<Offset>{3!r}</Offset></C{0}>"""
MAIN = """<?xml version="1.0" encoding="UTF-8"?>
<p:ISO5436_2 xmlns:p="http://www.opengps.eu/2008/ISO5436_2"><Record1><Revision>ISO5436 - 2000</Revision>
<FeatureType>SUR</FeatureType><Axes>{axes}</Axes></Record1><Record3><MatrixDimension><SizeX>{columns}</SizeX>
<SizeY>{rows}</SizeY><SizeZ>1</SizeZ></MatrixDimension><DataLink><PointDataLink>bindata/data.bin</PointDataLink>
<MD5ChecksumPointData>{sum}</MD5ChecksumPointData></DataLink></Record3>
<Record4><ChecksumFile>md5checksum.hex</ChecksumFile></Record4></p:ISO5436_2>
"""


def x3p(
    heights: Floats = HEIGHTS, corner: tuple[float, float] = (X[0], Y[0]), parts: dict | None = None
) -> bytes:
    """Return an X3P file.  corner : of the first height, mm.  parts : that take the place of its own."""
    rows, columns = heights.shape
    data = (1e-3 * heights).astype("<f8").tobytes()
    axes = "".join(AXIS.format(word, "I", PITCH, float(1e-3 * at)) for word, at in zip("XY", corner))
    main = MAIN.format(
        axes=axes + AXIS.format("Z", "A", 1.0, 0.0), columns=columns, rows=rows, sum=md5(data).hexdigest()
    )
    out = BytesIO()
    with ZipFile(out, "w", ZIP_DEFLATED) as file:
        for name, content in ({"main.xml": main, "bindata/data.bin": data} | (parts or {})).items():
            file.writestr(name, content)
    return out.getvalue()


def gxyzf(points: Floats = POINTS, unit: str = "m", **fields: object) -> bytes:
    """Return a GXYZF file of heights and of another channel.  fields : that take the place of its own."""
    stated = {
        "NChannels": 2,
        "NPoints": points.shape[1],
        "XYUnits": unit,
        "ZUnits1": "µm",
        "ZUnits2": "V",
    } | fields
    text = "Gwyddion XYZ Field 1.0\n" + "".join(f"{k} = {v}\n" for k, v in stated.items() if v is not None)
    head = text.encode()
    scale = {"m": 1e-3, "mm": 1.0}[unit]
    rows = np.column_stack([scale * points[0], scale * points[1], 1e3 * points[2], np.ones(points.shape[1])])
    return head + bytes(8 - len(head) % 8) + rows.astype("<f8").tobytes()


def dat(heights: Floats = HEIGHTS, resolution: int = 1, **fields: tuple[int, str, object]) -> bytes:
    """Return a MetroPro file with two frames of intensity.  fields : place, layout, numbers of the header."""
    rows, columns = heights.shape
    head = bytearray(834)
    head[:4] = b"\x88\x1b\x03\x6f"
    for place, layout, *numbers in (
        (4, "HI", 1, 834),
        (52, "3H", 5, 4, 2),
        (68, "2H", columns, rows),
        (164, "2f", SCALE, WAVELENGTH),
        (176, "3f", OBLIQUITY, 1.0, PITCH),
        (218, "H", resolution),
        *fields.values(),
    ):
        struct.pack_into(f">{layout}", head, place, *numbers)
    quantum = QUANTUM * 32768 / {0: 4096, 1: 32768, 2: 131072}.get(resolution, 1)
    phases = np.where(np.isnan(heights), INVALID, np.rint(np.nan_to_num(heights[::-1]) / quantum))
    return bytes(head) + bytes(2 * 5 * 4 * 2) + phases.astype(">i4").tobytes()


def datx(
    heights: Floats = HEIGHTS, fringes: bool = True, change=lambda file: None, **options: object
) -> bytes:
    """Return a .datx file.  change : is done to the open file.  options : of the dataset."""
    out = BytesIO()
    with h5py.File(out, "w") as file:
        fringe = 1e3 * SCALE * WAVELENGTH * OBLIQUITY
        values = np.nan_to_num(heights[::-1] / (fringe if fringes else 1e-6), nan=1e30)
        surface = file.create_dataset("Data/Surface/{A}", data=values, **options)
        surface.attrs["No Data"] = np.array([1e30])
        surface.attrs["Unit"] = np.array([b"Fringes" if fringes else b"NanoMeters"])
        surface.attrs["Wavelength"] = np.array([WAVELENGTH])
        surface.attrs["Interferometric Scale Factor"] = np.array([SCALE])
        surface.attrs["Obliquity Factor"] = np.array([OBLIQUITY])
        context = file.create_group("Attributes/{B}")
        context.attrs["Data Context.Lateral Resolution:Value"] = np.array([9.0])  # of another image
        context.attrs["Surface Data Context.Lateral Resolution:Value"] = np.array([PITCH])
        change(file)
    return out.getvalue()
