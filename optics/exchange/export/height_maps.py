"""Heights of a surface on a grid in the format of metrology, X3P, written by x3pio and read back by numpy.

Source: ISO 25178-72:2017.
"""

import re
from pathlib import Path
from zipfile import ZipFile

import numpy as np

from optics.base.runtime import Check
from thbcad.doors import loaded
from thbcad.lens import FreeformSurface

METRE = 1e3  # mm
SURFACE = 1e-12  # mm; heights of some 100 mm in metres and back keep 1e-13


def x3p_bytes(surface: FreeformSurface, size: tuple[int, int]) -> bytes:
    """Return an X3P file of the heights over the whole rectangle, from the vertex of the surface, in metres.

    Rows follow x, from the corner at -x and -y.  No date stands in it: the same surface is the same bytes.

    size : points (nx, ny).
    """
    x3pio = loaded("x3pio")
    x, y = (np.linspace(-h, h, n) for h, n in zip(surface.half_width, size))
    steps = [2 * h / (n - 1) / METRE for h, n in zip(surface.half_width, size)]
    corner = x3pio.Placement(offset=(x[0] / METRE, y[0] / METRE, 0.0))
    file = x3pio.Surface.from_array(
        surface.grid(x, y).T / METRE,
        x_scale=steps[0],
        y_scale=steps[1],
        placement=corner,
        coordinate_system=x3pio.CoordinateSystem.VIEW,
        revision=x3pio.Revision.ISO5436_2000,  # more programs read it than the amendment of 2020
    )
    file.metadata = None
    return bytes(file.dumps())


def x3p_checks(word: str, surface: FreeformSurface, path: Path) -> list[Check]:
    """Return the Checks of an X3P file."""
    with ZipFile(path) as parts:
        heights = np.frombuffer(parts.read("bindata/data.bin"), "<f8")
        text = parts.read("main.xml").decode()
    steps, corner, sizes = (
        [float(number) for number in re.findall(f"<{key}>([^<]*)<", text)][:2]
        for key in ("Increment", "Offset", "Size[XY]")
    )
    x, y = (np.linspace(-h, h, int(n)) for h, n in zip(surface.half_width, sizes))
    beside = np.concatenate(
        [METRE * (c + d * np.arange(len(a))) - a for a, c, d in zip((x, y), corner, steps)]
    )
    wrong = METRE * heights.reshape(len(y), -1).T - surface.grid(x, y)
    by = "X3P read back by numpy"
    return [
        Check(f"{word} places of the heights, {by}", float(np.abs(beside).max()), SURFACE, "mm"),
        Check(f"{word} heights, {by}", float(np.abs(wrong).max()), SURFACE, "mm"),
    ]
