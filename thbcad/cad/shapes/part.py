"""A solid whose faces have names, as CAD files show them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # a mesh is handed over without OpenCASCADE
    from OCP.TopoDS import TopoDS_Face, TopoDS_Solid


@dataclass(frozen=True, eq=False)
class Part:
    """A solid and its faces in the order in which they were added.

    solid : TopoDS_Solid, mm
    names : of the faces; the first word says what a face is: front, rear, edge or flange
    faces : TopoDS_Face, as they lie in the solid (orientation included)
    """

    solid: TopoDS_Solid
    names: Sequence[str]
    faces: Sequence[TopoDS_Face]
