"""Inserts of a mould as OCCT solids with shared topology."""

from __future__ import annotations

from OCP.BRep import BRep_Builder
from OCP.TopoDS import TopoDS

from thbcad.cad.shapes.edge_faces import face_on
from thbcad.cad.shapes.forms import form_of
from thbcad.cad.shapes.part import Part
from thbcad.cad.shapes.rings import wall_faces
from thbcad.cad.shapes.topology import closed_part, turned_face
from thbcad.cad.shapes.trimmed_solid import upright_face
from thbcad.cad.shapes.walls import UprightWall
from thbcad.moulds import WORDS, Insert


def insert_part(insert: Insert) -> Part:
    """Return an insert as a closed Part: front or rear with the poles of the lens, the back, and an edge on
    every piece of the outline."""
    builder = BRep_Builder()
    wall = UprightWall(insert.shape.pieces)
    face, rim = upright_face(builder, insert.lens, insert.number, wall)
    ring = wall.level(builder, insert.back)
    above = insert.number == 1
    back = turned_face(face_on(builder, form_of(insert.forms[1]).surface(), ring.edges), not above)
    edges = wall_faces(builder, wall, *((rim, ring) if above else (ring, rim)))
    names = (WORDS[insert.number], "back", *(f"edge {k + 1}" for k in range(len(edges))))
    return closed_part(names, (TopoDS.Face_s(face.Reversed()), back, *edges))
