"""Parts joined to a lens and cut from it, with the names of its faces kept."""

from collections.abc import Callable
from typing import Any

from OCP.TopoDS import TopoDS_Shape

from thbcad.cad.parts.cadquery_lens import tagged, untagged
from thbcad.cad.parts.named_booleans import fused, without
from thbcad.cad.parts.search import occt_shape
from thbcad.cad.shapes import Part

Operation = Callable[[Part, TopoDS_Shape, str], Part]


def join(part: Any, tool: Any, name: str = "") -> Any:
    """Return a part with a lens, joined with a tool; the kind of the part stays.

    Faces in one plane are not unified: a flange flush with a flat front leaves the front its own edges.

    part : LensPart, a cadquery Workplane as of `workplane`, or a Part with names of faces
    tool : any shape of build123d, cadquery or OCP with solids, in the frame in which the part lies
    name : of the faces that come from the tool, "" for none

    Raises ValueError : another kind of part; nothing left of the front or the rear, or pieces of it; a result
        of several solids.
    """
    return _operated(fused, part, tool, name)


def cut(part: Any, tool: Any, name: str = "") -> Any:
    """Return a part with a lens less a tool, as `join`, which also raises.

    A hole through the front or the rear is allowed.
    """
    return _operated(without, part, tool, name)


def _operated(operation: Operation, part: Any, tool: Any, name: str) -> Any:
    shape = occt_shape(tool)
    if isinstance(part, Part):
        return operation(part, shape, name)
    if hasattr(part, "ctx"):
        return tagged(operation(untagged(part), shape, name), getattr(part.ctx, "lens", None))
    if hasattr(part, "face_names"):
        from thbcad.cad.parts.build123d_lens import operated  # build123d

        return operated(operation, part, shape, name or getattr(tool, "label", ""))
    raise ValueError(
        f"part must be a LensPart, a Workplane of thbcad.cad.workplane or a Part, got {type(part).__name__}"
    )
