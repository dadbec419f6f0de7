"""A part with a lens, given back the lens's own surfaces: numbers that other programs have moved are exact
again."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.Geom import Geom_Plane, Geom_Surface
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Face

from thbcad.cad.exchange import edges_of, faces_of
from thbcad.cad.parts.named_booleans import named_part, numbered
from thbcad.cad.parts.search import PlacedLens
from thbcad.cad.shapes import TOLERANCE, Part


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
    builder = BRep_Builder()
    none: Any = None
    for edge in edges_of(face):
        builder.UpdateEdge(edge, none, face, TOLERANCE)


def _put_back(face: TopoDS_Face, surface: Geom_Surface) -> None:
    """Give a face another surface of the same points, and its edges the images that they had."""
    builder = BRep_Builder()
    location = TopLoc_Location()
    if BRep_Tool.Surface_s(face, location) is surface and location.IsIdentity():
        return
    edges = edges_of(face)
    images = [BRep_Tool.CurveOnSurface_s(edge, face, 0.0, 0.0) for edge in edges]
    builder.UpdateFace(face, surface, TopLoc_Location(), BRep_Tool.Tolerance_s(face))
    if isinstance(surface, Geom_Plane):
        return
    for edge, image in zip(edges, images):
        builder.UpdateEdge(edge, image, face, TOLERANCE)
