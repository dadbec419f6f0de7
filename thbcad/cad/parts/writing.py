"""STEP files of lenses and of the parts that hold one.

A part is given back the lens's own surfaces: numbers that other programs have moved are exact again.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from OCP.BRep import BRep_Tool
from OCP.Geom import Geom_Plane, Geom_Surface
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Face

from thbcad.cad.exchange import edges_of, faces_of, part_step, product_of, step_bytes
from thbcad.cad.parts.cadquery_lens import untagged
from thbcad.cad.parts.named_booleans import named_part, numbered
from thbcad.cad.parts.search import PlacedLens, is_shape, placed_lens
from thbcad.cad.shapes import BUILDER, TOLERANCE, Part
from thbcad.checks import require_suffix, require_type
from thbcad.io import write_bytes
from thbcad.lens import Lens, Product


def exact_part(placed: PlacedLens, names: Sequence[str] = ()) -> Part:
    """Return the part in the frame of the lens, as a copy, whose optical faces have the very surfaces of the
    lens.

    names : of the faces in the order of OCCT's explorer, where they are known; front and rear are named
        anyhow.
    """
    copied = placed.in_lens_frame()
    faces = faces_of(copied)
    own_names = list(names) if len(names) == len(faces) else [""] * len(faces)
    for number, (name, surface) in zip(placed.numbers, placed.surfaces.items(), strict=True):
        own_names[number] = name
        _put_back(faces[number], surface)
    for face in faces:
        _without_images(face)
    return named_part(copied, numbered(own_names))


def _without_images(face: TopoDS_Face) -> None:
    """Take the images of edges from a plane face: OCCT projects edges on planes itself, and the images that
    booleans leave there may end a rounding before their edges do."""
    if not isinstance(BRep_Tool.Surface_s(face), Geom_Plane):
        return
    none: Any = None
    for edge in edges_of(face):
        BUILDER.UpdateEdge(edge, none, face, TOLERANCE)


def _put_back(face: TopoDS_Face, surface: Geom_Surface) -> None:
    """Give a face another surface of the same points, and its edges the images that they had."""
    location = TopLoc_Location()
    if BRep_Tool.Surface_s(face, location) is surface and location.IsIdentity():
        return
    edges = edges_of(face)
    images = [BRep_Tool.CurveOnSurface_s(edge, face, 0.0, 0.0) for edge in edges]
    BUILDER.UpdateFace(face, surface, TopLoc_Location(), BRep_Tool.Tolerance_s(face))
    if isinstance(surface, Geom_Plane):
        return
    for edge, image in zip(edges, images):
        BUILDER.UpdateEdge(edge, image, face, TOLERANCE)


def write_step(
    part: Lens | Any,
    path: str | Path,
    product: Product | None = None,
    schema: str = "AP242",
    lens: Lens | None = None,
) -> None:
    """Write a lens, or a part with a lens, as one closed solid with names and colours of faces, in mm.

    part : Lens; or a part of build123d, cadquery or OCP that holds the faces of the lens, moved or not.  Its
        front and its rear are written with the very numbers of the lens, in the lens's frame; where the part
        is moved, a placement of the file moves it.  Other faces are as OCCT has them.
    product : names and material for the file; None is Product().  A material without an index gets the index
        of the lens.
    schema : AP242 or AP214.
    lens : of the part; a `LensPart` and the Workplane of `workplane` know their own.

    Raises OSError : the file cannot be written.
    Raises ValueError : a suffix other than .step and .stp; another schema; as `require_sound`; a part without
        its lens; one whose front or rear is missing, merged with another face or cut into pieces.
    Raises RuntimeError : OCCT refuses the solid.
    """
    require_suffix(path, ".step", ".stp")
    if isinstance(part, Lens):
        if lens is not None and lens is not part:
            raise ValueError("lens must be left out where a Lens is written")
        write_bytes(path, step_bytes(part, product, schema))
        return
    if lens is None:
        lens = getattr(part, "lens", None) or getattr(getattr(part, "ctx", None), "lens", None)
    if lens is None:
        if not is_shape(part):
            require_type("lens", part, Lens)
        raise ValueError("lens must be given: write_step(part, path, lens=lens) finds its faces in the part")
    require_type("lens", lens, Lens)
    write_bytes(path, placed_step(part, lens, product, schema))


def placed_step(part: Any, lens: Lens, product: Product | None = None, schema: str = "AP242") -> bytes:
    """Return the STEP file of a part with a lens, as `write_step`; the same part gives the same bytes."""
    product = product_of(lens, product)
    placed = placed_lens(part, lens)
    known = untagged(part) if hasattr(part, "ctx") else part
    names = known.names if isinstance(known, Part) else getattr(part, "face_names", ())
    return part_step(exact_part(placed, names), product, schema, placed.placement if placed.moved else None)
