"""The solid of a lens in IGES and BREP files, and back.

IGES holds it as a manifold solid (entity 186) with names, BREP as OCCT's own topology.  Reals have 17 digits
and the time stamp is fixed: poles and knots read back bit for bit, the same lens gives the same bytes.
"""

from pathlib import Path

from OCP.IGESControl import IGESControl_Controller

from thbcad.cad.exchange.occt_texts import SOLID, brep_text, iges_text, silence
from thbcad.cad.exchange.reading import brep_shape, iges_shape
from thbcad.cad.exchange.solid_file import SolidFile, solid_file
from thbcad.cad.shapes import Part, lens_part, lens_solid
from thbcad.lens import Lens, Product


def iges_bytes(lens: Lens, product: Product | None = None) -> bytes:
    """Return an IGES file of the lens as a solid, mm.

    product : its name, author and organization stand in the file, in ASCII; None is Product().  IGES has no
        material.

    Raises RuntimeError : OCCT refuses the solid.
    """
    return part_iges(lens_part(lens), Product() if product is None else product)


def part_iges(part: Part, product: Product) -> bytes:
    """Return an IGES file of a Part, as `iges_bytes`."""
    return iges_text(part.solid, SOLID, product, product.named(part.names))


def brep_bytes(lens: Lens) -> bytes:
    """Return a BREP file of the lens as a solid, mm."""
    return brep_text(lens_solid(lens))


def read_iges(path: str | Path) -> SolidFile:
    """Read an IGES file with a lens solid; lengths are converted to mm.

    Raises OSError : the file cannot be read.
    Raises ValueError : it is no IGES file, or does not hold two optical faces.
    """
    silence()
    IGESControl_Controller.Init_s()
    return solid_file(iges_shape(Path(path)), path)


def read_brep(path: str | Path) -> SolidFile:
    """Read a BREP file with a lens solid.

    Raises OSError : the file cannot be read.
    Raises ValueError : it is no BREP file, or does not hold two optical faces.
    """
    silence()
    return solid_file(brep_shape(Path(path)), path)
