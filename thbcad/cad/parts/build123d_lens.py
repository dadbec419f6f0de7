"""A lens as a part of build123d, in algebra and in builder mode."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import build123d as bd
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Shape

from thbcad.cad.exchange import GLASS
from thbcad.cad.parts.mount_solids import mounted_part
from thbcad.cad.parts.named_booleans import fused, named_part, numbered, without
from thbcad.cad.parts.search import occt_shape, one_solid
from thbcad.cad.shapes import Part, lens_part
from thbcad.checks import require_type
from thbcad.lens import Lens
from thbcad.mounts import Mount


class LensPart(bd.BasePartObject):
    """A lens as a build123d part in mm: front vertex at the origin, z along the optical axis.

    `Pos`, `Rot` and joints move it. `+` and `-` are `join` and `cut`: the result is a LensPart again, with
    the names of its faces.  In a BuildPart it is added to the part at every location.  It has rigid joints
    "front vertex", "rear vertex" and "rim" (at the middle of the edge +x), z outward.

    lens : Lens
    label : the name of the part
    rotation, align, mode : as those of `build123d.Box`

    Raises ValueError : as `require_sound`.
    """

    lens: Lens
    face_names: tuple[str, ...]

    def __init__(
        self,
        lens: Lens,
        label: str = "lens",
        rotation: bd.RotationLike = (0, 0, 0),
        align: bd.Align | tuple[bd.Align, bd.Align, bd.Align] | None = None,
        mode: bd.Mode = bd.Mode.ADD,
    ) -> None:
        require_type("lens", lens, Lens)
        part = lens_part(lens)
        solid = bd.Solid(part.solid, label=label)
        super().__init__(solid, rotation=rotation, align=align, mode=mode)
        self._describe(lens, tuple(part.names) * len(self.solids()))
        for name, place in _places(lens).items():
            bd.RigidJoint(name, self, self.solids()[0].location * place)

    def _describe(self, lens: Lens, face_names: Iterable[str]) -> None:
        self.lens = lens
        self.face_names = tuple(face_names)
        self.color = bd.Color(*GLASS)

    @property
    def named_faces(self) -> dict[str, bd.Face]:
        """{name: face} of front, rear, edges and of what was joined under a name, normals outward.

        Where a name has several faces, the further ones are "name 2", "name 3", ...
        """
        found: dict[str, bd.Face] = {}
        for name, face in zip(numbered(self.face_names), self.faces(), strict=True):
            face.label = name
            if name:
                found[name] = face
        return found

    def mounted(self, mount: Mount) -> LensPart:
        """Return the lens with a mount, moved as this part is; what was joined to this part is left out.

        Raises ValueError : as `thbcad.mounts.require_mount`.
        """
        return self.with_shape(mounted_part(self.lens, mount), occt_shape(self).Location())

    def with_shape(self, part: Part, placement: TopLoc_Location) -> LensPart:
        """Return a LensPart of this lens with another solid, moved to a placement."""
        compound = occt_shape(bd.Compound([bd.Solid(part.solid)]))
        result = object.__new__(LensPart)
        bd.Part.__init__(result, compound.Moved(placement), label=self.label)
        self.copy_attributes_to(result, ["wrapped", "_NodeMixin__children"])
        result.rotation = self.rotation
        result._describe(self.lens, part.names)
        return result

    def __add__(self, other: Any) -> LensPart:
        return self._each(fused, other)

    def __sub__(self, other: Any) -> LensPart:
        return self._each(without, other)

    def _each(self, operation: Any, tools: Any) -> LensPart:
        result = self
        for tool in () if tools is None else (tools,) if hasattr(tools, "wrapped") else tools:
            result = operated(operation, result, occt_shape(tool), getattr(tool, "label", ""))
        return result


def operated(operation: Any, part: LensPart, tool: TopoDS_Shape, name: str) -> LensPart:
    """Return a LensPart after an operation with a tool, done in the frame in which the part was made: numbers
    of faces that the tool does not meet stay as they are."""
    shape = occt_shape(part)
    placement = shape.Location()
    here = named_part(one_solid(shape.Located(TopLoc_Location())), part.face_names)
    return part.with_shape(operation(here, tool.Moved(placement.Inverted()), name), placement)


def _places(lens: Lens) -> dict[str, bd.Location]:
    """Return where the joints are in the frame of the lens, z outward."""
    front, rear = float(lens.front(0.0, 0.0)), lens.thickness + float(lens.rear(0.0, 0.0))
    (a, b), (c, d) = ((s.half_width[0], float(s(s.half_width[0], 0.0))) for s in (lens.front, lens.rear))
    middle = bd.Vector((a + c) / 2, 0, (b + lens.thickness + d) / 2)
    along = bd.Vector(c - a, 0, lens.thickness + d - b)
    return {
        "front vertex": bd.Location((0, 0, front), (180, 0, 0)),
        "rear vertex": bd.Location((0, 0, rear)),
        "rim": bd.Plane(middle, x_dir=(0, 1, 0), z_dir=(along.Z, 0, -along.X)).location,
    }
