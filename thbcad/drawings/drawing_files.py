"""The drawing of a lens as an SVG or a DXF file."""

from collections.abc import Sequence
from pathlib import Path

from thbcad.checks import require_suffix, shown
from thbcad.doors import loaded
from thbcad.drawings.lens_drawing import lens_sheet
from thbcad.drawings.sheets import Sheet
from thbcad.drawings.svg_sheet import svg_bytes
from thbcad.io import write_bytes
from thbcad.lens import Flange, Lens, Product

DRAWINGS = ("svg", "dxf")


def drawing_bytes(sheet: Sheet, name: str) -> bytes:
    """Return a sheet as a file, name "svg" or "dxf"; the same sheet gives the same bytes.

    Raises ValueError : another format.
    Raises ImportError : "dxf" where ezdxf is not installed.
    """
    if name not in DRAWINGS:
        raise ValueError(f"a drawing is an svg or a dxf file, got {shown(name)}")
    if name == "svg":
        return svg_bytes(sheet)
    data: bytes = loaded("thbcad.drawings.dxf_sheet").dxf_bytes(sheet)
    return data


def write_drawing(
    lens: Lens,
    path: str | Path,
    product: Product | None = None,
    chord: float = 1e-3,
    aperture: tuple[float, float] | None = None,
    flange: Flange | None = None,
    polygon: Sequence[tuple[float, float]] | None = None,
) -> None:
    """Write the drawing of a lens, as `lens_sheet`, to a file that ends in .svg or .dxf.

    In SVG the sheet is at its scale; in DXF the lens has its true size in mm.

    Raises OSError : the file cannot be written.
    Raises ValueError : another suffix; as `lens_sheet`.
    Raises ImportError : a DXF file where ezdxf is not installed.
    """
    suffix = require_suffix(path, *(f".{name}" for name in DRAWINGS))
    write_bytes(path, drawing_bytes(lens_sheet(lens, product, chord, aperture, flange, polygon), suffix[1:]))
