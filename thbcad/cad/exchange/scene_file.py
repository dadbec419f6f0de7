"""STEP files of scenes: assemblies of named parts, each with the numbers of its own frame and a placement."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from OCP.BRepPrimAPI import BRepPrimAPI_MakePrism
from OCP.gp import gp_Vec
from OCP.TDataStd import TDataStd_Name
from OCP.TDF import TDF_Label
from OCP.TopoDS import TopoDS_Shape
from OCP.XCAFDoc import XCAFDoc_DocumentTool, XCAFDoc_ShapeTool

from thbcad.cad.exchange.loose_splines import face_of
from thbcad.cad.exchange.occt_texts import STRING, compact
from thbcad.cad.exchange.reading import faces_of, step_document
from thbcad.cad.exchange.step import part_step, step_bytes
from thbcad.cad.occt_names import Labels, as_solid
from thbcad.cad.shapes import Part
from thbcad.checks import Floats
from thbcad.lens import Product
from thbcad.poses import IDENTITY, Pose
from thbcad.splines import BSplineSurface

if TYPE_CHECKING:
    from thbcad.moulds import Made

NAMED = re.compile(rf"PRODUCT\(\s*{STRING}\s*,\s*{STRING}\s*,".encode("ascii"))
# the entities of a part's file that an assembly speaks of
SPOKEN_OF = [
    re.compile(r"#\d+=PRODUCT\([^;]*\((?P<discipline>#\d+)\)\);"),
    re.compile(r"(?P<definition>#\d+)=PRODUCT_DEFINITION\([^;]*,(?P<stage>#\d+)\);"),
    re.compile(
        r"(?P<shape>#\d+)=ADVANCED_BREP_SHAPE_REPRESENTATION\('',\((?P<frame>#\d+),"
        r"[^;]*,(?P<space>#\d+)\);"
    ),
]
# entities; {0}, {1}, ... are their own numbers
FRAME = """{0}=AXIS2_PLACEMENT_3D('',{1},{2},{3});
{1}=CARTESIAN_POINT('',({origin}));
{2}=DIRECTION('',({z}));
{3}=DIRECTION('',({x}));
"""
WHOLE = """{0}=PRODUCT_DEFINITION('design','',{1},{stage});
{1}=PRODUCT_DEFINITION_FORMATION('','',{2});
{2}=PRODUCT('{name}','{name}','',({discipline}));
{3}=PRODUCT_RELATED_PRODUCT_CATEGORY('part',$,({2}));
{4}=SHAPE_DEFINITION_REPRESENTATION({5},{6});
{5}=PRODUCT_DEFINITION_SHAPE('','',{0});
{6}=SHAPE_REPRESENTATION('',({frames}),{space});
"""
USE = """{0}=NEXT_ASSEMBLY_USAGE_OCCURRENCE('{k}','{name}','',{whole},{definition},$);
{1}=PRODUCT_DEFINITION_SHAPE('Placement','Placement of an item',{0});
{2}=CONTEXT_DEPENDENT_SHAPE_REPRESENTATION({3},{1});
{3}=(REPRESENTATION_RELATIONSHIP('','',{shape},{all})
REPRESENTATION_RELATIONSHIP_WITH_TRANSFORMATION({4})SHAPE_REPRESENTATION_RELATIONSHIP());
{4}=ITEM_DEFINED_TRANSFORMATION('','',{frame},{place});
"""
END = "ENDSEC;\nEND-ISO-10303-21;\n"


@dataclass(frozen=True, eq=False)
class PlacedShape:
    """A part of an assembly.  shape : TopoDS_Shape in its own frame, mm.  pose : from there to the file's."""

    name: str
    shape: TopoDS_Shape
    pose: Pose


def scene_step(
    bodies: Sequence[tuple[Made | Part | bytes, Product, Pose]], whole: Product, schema: str = "AP242"
) -> bytes:
    """Return the STEP file of an assembly of bodies that lie where their poses say, in mm.

    It holds the entities of the file that each body has by itself, and a placement of each.  OCCT would write
    the colours of several parts in another order every time.

    bodies : bytes are the file that a body has in this schema, of which only the name is changed.
    whole : its name is that of the assembly.  schema : as `thbcad.write_step`, which also raises.
    """
    head, texts, last = "", [], 0
    whose = 10 ** len(str(len(bodies)))  # numbers of the first body begin with these digits
    for digits, (body, product, _) in enumerate(bodies, whose):
        if isinstance(body, bytes):
            file = _named(body, product.name)
        elif isinstance(body, Part):
            file = part_step(body, product, schema)
        else:
            file = step_bytes(body, product, schema)
        head, _, data = file.decode("ascii").partition("DATA;\n")
        texts.append(_renumbered(data.removesuffix(END), digits))

    def new(template: str, size: int, **words: str) -> list[str]:
        """Add entities and return their numbers."""
        nonlocal last
        own = [f"#{whose + len(bodies)}{last + k}" for k in range(1, size + 1)]
        last += size
        texts.append(compact(template.format(*own, **words)))
        return own

    spoken = [_spoken_of(text) for text in texts]
    places = [new(FRAME, 4, **_frame(pose))[0] for pose in (IDENTITY, *(pose for _, _, pose in bodies))]
    name = _quoted(whole.name)
    own = new(WHOLE, 7, name=name, frames=",".join(places), **spoken[0])
    for k, ((_, product, _), numbers, place) in enumerate(zip(bodies, spoken, places[1:]), 1):
        words = {"k": str(k), "name": _quoted(product.name), "whole": own[0], "all": own[6], "place": place}
        new(USE, 5, **words, **numbers)
    head = re.sub(rf"FILE_NAME\({STRING}", lambda _: f"FILE_NAME('{name}'", head, count=1)
    return "".join([compact(head), "DATA;\n", *texts, END]).encode("ascii")


def sheet_part(surface: BSplineSurface, thickness: float) -> Part:
    """Return what lies between a surface and the same surface moved along z, mm, as a Part."""
    solid = BRepPrimAPI_MakePrism(face_of(surface), gp_Vec(0.0, 0.0, thickness)).Shape()
    faces = faces_of(solid)
    return Part(as_solid(solid), [""] * len(faces), faces)


def _named(file: bytes, name: str) -> bytes:
    """Return the file of a body with another name."""
    text = compact(f"'{_quoted(name)}'")
    return NAMED.sub(lambda _: f"PRODUCT({text},{text},".encode("ascii"), file, count=1)


def _renumbered(data: str, digits: int) -> str:
    """Return entities whose numbers begin with other digits; texts stay."""
    pieces = data.split("'")  # every second one is text, and '' in it an empty piece
    pieces[::2] = [piece.replace("#", f"#{digits}") for piece in pieces[::2]]
    return "'".join(pieces)


def _spoken_of(text: str) -> dict[str, str]:
    """Return the numbers of the entities of a part that an assembly speaks of."""
    found = (pattern.search(text) for pattern in SPOKEN_OF)
    return {name: number for match in found if match for name, number in match.groupdict().items()}


def _frame(pose: Pose) -> dict[str, str]:
    """Return origin, z and x of a pose as text."""
    rows: dict[str, Floats] = {"origin": pose.shift, "z": pose.rotation[:, 2], "x": pose.rotation[:, 0]}
    return {name: ",".join(f"{x:#.17G}" for x in row) for name, row in rows.items()}


def _quoted(text: str) -> str:
    return text.replace("\\", r"\\").replace("'", "''")


def read_scene(path: str | Path) -> tuple[PlacedShape, ...]:
    """Return the parts of the assembly in a STEP file; lengths are converted to mm.

    Raises OSError : the file cannot be read.  ValueError : it is no STEP file, or its one shape is no
        assembly.
    """
    path = Path(path)
    _, document = step_document(path)
    roots, uses = Labels(), Labels()
    XCAFDoc_DocumentTool.ShapeTool_s(document.Main()).GetFreeShapes(roots)
    if roots.Length() != 1 or not XCAFDoc_ShapeTool.IsAssembly_s(roots.Value(1)):
        raise ValueError(f"{path} must hold one assembly, got {roots.Length()} shapes of another kind")
    XCAFDoc_ShapeTool.GetComponents_s(roots.Value(1), uses)
    return tuple(_placed(uses.Value(k)) for k in range(1, uses.Length() + 1))


def _placed(use: TDF_Label) -> PlacedShape:
    own, name = TDF_Label(), TDataStd_Name()
    XCAFDoc_ShapeTool.GetReferredShape_s(use, own)
    said = own.IsAttribute(name.ID()) and own.FindAttribute(name.ID(), name)
    moved = XCAFDoc_ShapeTool.GetLocation_s(use).Transformation()
    rows = np.array([[moved.Value(i, j) for j in range(1, 5)] for i in range(1, 4)])
    shape = XCAFDoc_ShapeTool.GetShape_s(own)
    return PlacedShape(name.Get().ToExtString() if said else "", shape, Pose(rows[:, :3], rows[:, 3]))
