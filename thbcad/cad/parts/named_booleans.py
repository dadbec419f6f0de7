"""Unions and differences of solids whose faces have names.

Faces that lie in one plane stay apart, so that a flange flush with a flat front does not swallow it.  Names
follow OCCT's history of the operation.
"""

from collections import Counter
from collections.abc import Sequence

from OCP.BRepAlgoAPI import BRepAlgoAPI_BooleanOperation, BRepAlgoAPI_Cut, BRepAlgoAPI_Fuse
from OCP.TopAbs import TopAbs_SOLID
from OCP.TopoDS import TopoDS_Shape

from thbcad.cad.exchange import explore, faces_of
from thbcad.cad.occt_names import ShapeList, ShapeNumbers, as_solid
from thbcad.cad.parts.search import OPTICAL
from thbcad.cad.shapes import Part


def named_part(solid: TopoDS_Shape, names: Sequence[str]) -> Part:
    """Return the Part of a shape with one solid, whose faces have names in their order."""
    (own,) = explore(solid, TopAbs_SOLID)
    return Part(as_solid(own), tuple(names), tuple(faces_of(own)))


def numbered(names: Sequence[str]) -> list[str]:
    """Return names without repetition: "flange", "flange 2", "flange 3"; no name stays none."""
    count: Counter[str] = Counter()
    result = []
    for name in names:
        count[name] += 1
        result.append(name if count[name] == 1 or not name else f"{name} {count[name]}")
    return result


def fused(part: Part, tool: Part | TopoDS_Shape, name: str = "") -> Part:
    """Return the union of a part and a tool, whose faces keep their names or get one."""
    return _operated(BRepAlgoAPI_Fuse(), part, tool, name)


def without(part: Part, tool: Part | TopoDS_Shape, name: str = "") -> Part:
    """Return a part less a tool, whose faces keep their names or get one."""
    return _operated(BRepAlgoAPI_Cut(), part, tool, name)


def _operated(
    operation: BRepAlgoAPI_BooleanOperation, part: Part, tool: Part | TopoDS_Shape, name: str
) -> Part:
    what = "join" if isinstance(operation, BRepAlgoAPI_Fuse) else "cut"
    shape = tool.solid if isinstance(tool, Part) else tool
    arguments, tools = ShapeList(), ShapeList()
    arguments.Append(part.solid)
    tools.Append(shape)
    operation.SetArguments(arguments)
    operation.SetTools(tools)
    operation.SetRunParallel(False)  # the same solids give the same faces in the same order
    operation.Build()
    if not operation.IsDone():
        raise ValueError(f"{what}: OpenCASCADE finds no result for this tool; move it by more than 1e-6 mm")
    solids = explore(operation.Shape(), TopAbs_SOLID)
    for own, face in zip(part.names, part.faces):
        pieces = len(_images(operation, face))
        if own in OPTICAL and pieces != 1:
            done = f"cuts the {own} into {pieces} pieces" if pieces else f"leaves nothing of the {own}"
            raise ValueError(f"{what}: the tool {done}; keep it out of the {own}")
    if len(solids) != 1:
        raise ValueError(f"{what}: the part would fall into {len(solids)} solids, where one is wanted")
    added = tool.names if isinstance(tool, Part) else [name] * len(faces_of(shape))
    origins = [*zip(added, faces_of(shape)), *zip(part.names, part.faces)]
    return _renamed(operation, solids[0], origins)


def _renamed(
    operation: BRepAlgoAPI_BooleanOperation, solid: TopoDS_Shape, origins: list[tuple[str, TopoDS_Shape]]
) -> Part:
    """Return the result of an operation with the names of the faces from which its faces come; of two, the
    last one counts."""
    faces = faces_of(solid)
    numbers = ShapeNumbers()
    for face in faces:
        numbers.Add(face)
    names = [""] * numbers.Extent()
    for own, face in origins:
        for image in _images(operation, face):
            if numbers.Contains(image):
                names[numbers.FindIndex(image) - 1] = own
    return named_part(solid, [names[numbers.FindIndex(face) - 1] for face in faces])


def _images(operation: BRepAlgoAPI_BooleanOperation, face: TopoDS_Shape) -> list[TopoDS_Shape]:
    """Return what an operation has made of a face."""
    if operation.IsDeleted(face):
        return []
    return list(operation.Modified(face)) or [face]
