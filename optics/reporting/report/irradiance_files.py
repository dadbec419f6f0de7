"""The light of a lens as files that other programs compute with: float64 arrays and a 16-bit picture."""

import io
import struct
from typing import Any

import numpy as np
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from optics.scene.photometry import Density
from optics.scene.receivers import Screen
from thbcad.checks import Floats

ARRAYS, PICTURE = "irradiance.npz", "irradiance_16bit.png"
WHITE = 65535  # of 16 bits
LINEAR = struct.pack(">I", 100_000)  # the PNG's gamma, in 1/100000


def light_files(
    irradiance: Floats,
    target: Floats,
    screen: Screen,
    density: Density,
    colour: Floats | None = None,
    sharp: Floats | None = None,
) -> dict[str, bytes]:
    """Return the files of the light that arrives and of the light asked for, by name.

    The same light gives the same bytes.  The arrays come with the centres x of the columns and y of the rows,
    and the units as text.

    irradiance, target : (rows, columns), in the stored unit of `density`; in the far field intensities
    colour : (3, rows, columns), CIE 1931 X, Y, Z of a spectrum's light, in 683 lm/W times that unit
    sharp : (rows, columns), of blurred light what it is without the blur
    """
    buffer, unit = io.BytesIO(), density.stored
    x, y = screen.centres
    arrays: dict[str, Any] = {
        "irradiance": irradiance,
        "target": target,
        "x": x,
        "y": y,
        "unit": np.array(unit),
        "axes_unit": np.array(screen.unit),
    }
    more = {"xyz": colour, "sharp": sharp}
    arrays |= {name: array for name, array in more.items() if array is not None}
    np.savez_compressed(buffer, **arrays)
    return {ARRAYS: buffer.getvalue(), PICTURE: _picture(irradiance, screen, unit)}


def _picture(irradiance: Floats, screen: Screen, unit: str) -> bytes:
    """Return a PNG with one grey value of 16 bits per pixel, grey = WHITE * irradiance / max irradiance.

    Row 0 lies at +y, column 0 at -x.  Its text `Scale` says what one grey level is.
    """
    brightest = float(irradiance.max(initial=0.0))
    grey = np.round(np.maximum(irradiance, 0.0) * (WHITE / brightest if brightest > 0 else 0.0))
    (hx, hy), axes_unit = screen.half_width, screen.unit
    text = PngInfo()
    text.add(b"gAMA", LINEAR)
    text.add_text("Scale", f"{brightest / WHITE!r} {unit} per grey level, linear")
    text.add_text(
        "Extent", f"|x| <= {hx!r} {axes_unit}, |y| <= {hy!r} {axes_unit}; row 0 at +y, column 0 at -x"
    )
    buffer = io.BytesIO()
    Image.fromarray(grey.astype(np.uint16)).save(buffer, "png", pnginfo=text)
    return buffer.getvalue()
