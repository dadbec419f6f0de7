"""A lens on the stack of a cadquery Workplane, its faces tagged by name."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from thbcad.cad.exchange import library
from thbcad.cad.parts.named_booleans import named_part
from thbcad.cad.parts.search import one_solid
from thbcad.cad.shapes import Part, lens_part
from thbcad.checks import require_type
from thbcad.lens import Lens

if TYPE_CHECKING:  # it takes seconds to load
    import cadquery


def workplane(lens: Lens) -> cadquery.Workplane:
    """Return a cadquery Workplane with the lens as a solid on its stack, in mm, and its faces tagged.

    `workplane(lens).faces(tag="front")` is the front; so are rear, edge -y, edge +x, edge +y, edge -x.
    `join` and `cut` keep the tags; cadquery's own operations leave the tags at the solid before them.

    Raises ImportError : cadquery is not installed, or beside another OCP.
    Raises ValueError : something else than a Lens; as `require_sound`.
    """
    require_type("lens", lens, Lens)
    return tagged(lens_part(lens), lens)


def tagged(part: Part, lens: Lens | None) -> cadquery.Workplane:
    """Return a Workplane with a part on its stack; faces with one name share a tag."""
    cq = library("cadquery")
    plane = cq.Workplane(obj=cq.Solid(part.solid))
    by_name: dict[str, list[Any]] = {}
    for name, face in zip(part.names, part.faces):
        by_name.setdefault(name, []).append(cq.Face(face))
    for name, faces in by_name.items():
        if name:
            plane.newObject(faces).tag(name)
    plane.ctx.lens = lens
    return plane


def untagged(plane: cadquery.Workplane) -> Part:
    """Return the solid of a Workplane as a Part, its faces under the names of their tags."""
    solid = one_solid(plane)
    context: Any = plane.ctx
    tags = [(name, own.wrapped) for name, at in context.tags.items() for own in at.objects]
    faces = library("cadquery").Solid(solid).Faces()
    return named_part(solid, [next((n for n, own in tags if f.wrapped.IsSame(own)), "") for f in faces])
