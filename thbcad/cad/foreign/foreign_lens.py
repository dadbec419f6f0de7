"""A lens that another program wrote: its front and its rear, found by geometry, and its frame.

Names, units, order of entities, placement and kinds of surfaces do not matter.  The doubly curved face of the
greatest area is one optical surface; of a cylinder lens, which has none, the largest of the faces that are
curved in one direction and end in sharp edges.  A line from its middle along the axis leaves the glass
through the other one.  Faces that continue each other smoothly are one surface, such as the halves and
quarters in which some programs write surfaces of revolution.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from OCP.TopAbs import TopAbs_SHELL, TopAbs_SOLID
from OCP.TopoDS import TopoDS_Shape

from thbcad.cad.exchange import explore, face_hits, silence, step_shape
from thbcad.cad.foreign.face_groups import axial_heights, continued, unified
from thbcad.cad.foreign.optical_surface import OpticalFace, lens_axes, optical_face
from thbcad.cad.foreign.refitting import Refit, refitted
from thbcad.cad.foreign.surveyed_faces import SurveyedFace, surveyed
from thbcad.checks import Floats, require_number
from thbcad.io import Entities, entities_of, having, read_part21
from thbcad.poses import Pose

ASSIGNED = "GLOBAL_UNIT_ASSIGNED_CONTEXT"
LEAST_FACING = 0.2  # cosine of the normal with the axis, from which a face can be optical
STEEPEST = float(np.degrees(np.arccos(LEAST_FACING)))
NAMES = ("front", "rear")


@dataclass(frozen=True, eq=False)
class ForeignLens:
    """What a STEP file of any program holds of a lens.

    path : Path.  unit : of length in the file, such as "millimetre" or "INCH"; all numbers here are mm
    frame : Pose of the lens in the file; z is the axis, the origin the front's point on it
    thickness : float, mm, along the axis.  front, rear : OpticalFace.  shape : TopoDS_Shape, mm

    >>> flat, ball = FreeformSurface((5.0, 4.0)), FreeformSurface((5.0, 4.0), Conic(-20.0))
    >>> path = Path(mkdtemp()) / "lens.step"
    >>> write_step(Lens(flat, ball, thickness=3.0, index=1.5), path)
    >>> found = read_lens_solid(path)
    >>> found.front.kind, found.rear.kind, round(found.rear.radius, 9), round(found.thickness, 9)
    ('plane', 'sphere', 20.0, 3.0)
    """

    path: Path
    unit: str
    frame: Pose
    thickness: float
    front: OpticalFace
    rear: OpticalFace
    shape: TopoDS_Shape

    def __repr__(self) -> str:
        return f"ForeignLens({self.path.name}, front {self.front.kind}, rear {self.rear.kind})"

    def __str__(self) -> str:
        """Return all of it, a line for each part."""
        rows = [
            f"ForeignLens of {self.path.name}, in {self.unit}",
            f"  vertex {_vector(self.frame.shift)} mm, axis {_vector(self.frame.rotation[:, 2])}, "
            f"x along {_vector(self.frame.rotation[:, 0])}",
            f"  thickness on the axis {self.thickness:.9g} mm",
            *(f"  {name}: {getattr(self, name)!r}" for name in NAMES),
        ]
        return "\n".join(rows)

    def refit(self, index: float, tolerance: float = 1e-6) -> Refit:
        """Return a Lens with these surfaces, and how far it is from them.

        index : refractive index; STEP files of other programs have none.  tolerance : mm, in z.

        Raises ValueError : surfaces that are not centred on one axis; outlines that differ, or that are
            neither rectangles, with round corners or not, nor ellipses; a surface that a fit does not meet;
            glass that is not that of the solid (an opening, a cavity); as `Lens`.
        """
        require_number("tolerance", tolerance, above=0, finite=True)
        faces = self.front, self.rear
        with _speaking_of(self.path):
            return refitted(self.frame, self.thickness, faces, self.shape, index, tolerance)

    def turned(self) -> ForeignLens:
        """Return the same lens with front and rear exchanged: half a turn around x."""
        frame = self.frame @ Pose(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, self.thickness]))
        front, rear = (optical_face(list(face.faces), frame) for face in (self.rear, self.front))
        return replace(self, frame=frame, front=front, rear=rear)


def read_lens_solid(path: str | Path) -> ForeignLens:
    """Read a STEP file of a lens by any program, and find its front and its rear by geometry.

    Raises OSError : the file cannot be read.
    Raises ValueError : it is no STEP file or damaged; it does not hold one solid; the solid has no curved
        face that can be optical, or none that faces it along the axis.
    """
    path = Path(path)
    entities = read_part21(path)
    silence()
    shape, unit = step_shape(path), _unit_of(entities)
    with _speaking_of(path):
        return _found(path, unit, shape)


@contextmanager
def _speaking_of(path: Path) -> Iterator[None]:
    """Put the path before the message of every ValueError of the block."""
    try:
        yield
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _found(path: Path, unit: str, shape: TopoDS_Shape) -> ForeignLens:
    """Return the ForeignLens of the shape of a file."""
    solids = explore(shape, TopAbs_SOLID)
    if len(solids) != 1:
        raise ValueError(f"the file holds {len(solids)} solids where a lens is one")
    if len(explore(solids[0], TopAbs_SHELL)) > 1:
        raise ValueError("the file holds a solid with a cavity; a Lens is glass throughout")
    solid = unified(solids[0])
    faces = surveyed(solid)
    curved = [face for face in faces if not face.is_ruled] or _arched(solid, faces)
    if not curved:
        raise ValueError(
            "the file holds no curved face that ends in sharp edges and faces one way: no lens surface was "
            "found"
        )
    main = max(curved, key=lambda face: face.area)
    if not main.area > 0:
        raise ValueError(
            f"{path} holds curved faces without area; correct their radii or edges, which do not fit"
        )
    normal = main.samples[1].mean(axis=0)
    frame = Pose(lens_axes(_group(solid, faces, main, normal), faces), np.zeros(3))
    axis = frame.rotation[:, 2]
    pair = main, _opposite(solid, faces, main, frame)
    if pair[0] is pair[1]:
        raise ValueError("the file holds one curved face and none opposite: a lens has a front and a rear")
    groups = [_group(solid, faces, one, axis) for one in pair]
    for group in groups:
        _require_single(faces, group, axis)
    front, rear = (optical_face(one, frame) for one in (groups if normal @ axis < 0 else groups[::-1]))
    heights = [axial_heights(one.faces, frame, *front.centre[:, None])[0] for one in (front, rear)]
    if not np.isfinite(heights).all():
        raise ValueError(
            "the axis through the middle of the front misses one of the two faces, as at an opening, which a "
            "Lens does not have"
        )
    frame = frame @ Pose.at((*front.centre, heights[0]))
    front, rear = (optical_face(list(one.faces), frame) for one in (front, rear))
    return ForeignLens(path, unit, frame, float(heights[1] - heights[0]), front, rear, solid)


def _vector(vector: Floats) -> str:
    return "(" + ", ".join(f"{round(value, 9) + 0.0:.6g}" for value in vector.tolist()) + ")"


def _arched(solid: TopoDS_Shape, faces: Sequence[SurveyedFace]) -> list[SurveyedFace]:
    """Return the faces curved in one direction that can be optical: they face one way, as walls of round
    plates do not, and end in sharp edges, as rounded edges do not."""
    arched = []
    for face in faces:
        normals = face.samples[1]
        one_way = (normals @ normals.mean(axis=0) > LEAST_FACING).all()
        curved = not face.is_flat and face.kind != "cone"
        if curved and one_way and not any(f.is_flat for f in continued(solid, faces, face)):
            arched.append(face)
    return arched


def _opposite(
    solid: TopoDS_Shape, faces: Sequence[SurveyedFace], main: SurveyedFace, frame: Pose
) -> SurveyedFace:
    """Return the face through which a line from the middle of the main face leaves the glass."""
    points, normals = main.samples
    middle = int(np.argmin(np.linalg.norm(points - points.mean(axis=0), axis=1)))
    inward = -frame.rotation[:, 2] * np.sign(normals[middle] @ frame.rotation[:, 2])
    hits = face_hits(solid, points[[middle]], inward[None])
    if hits.faces[0] < 0 or hits.normals[0] @ inward < LEAST_FACING:
        raise ValueError("the lens has no surface opposite to its largest curved face, along its axis")
    return faces[int(hits.faces[0])]


def _group(
    solid: TopoDS_Shape, faces: Sequence[SurveyedFace], main: SurveyedFace, axis: Floats
) -> list[SurveyedFace]:
    """Return the faces of the optical surface that a face belongs to."""
    facing = [f for f in faces if _faces_one_way(f, main, axis)]
    if main.kind == "plane":
        facing = [f for f in facing if f.kind == "plane"]
    return continued(solid, facing, main)


def _faces_one_way(face: SurveyedFace, main: SurveyedFace, axis: Floats) -> bool:
    """Return whether all of a face looks along an axis to the side to which `main` does."""
    sign = np.sign(main.samples[1].mean(axis=0) @ axis)
    return bool((sign * (face.samples[1] @ axis) > LEAST_FACING).all())


def _require_single(faces: Sequence[SurveyedFace], group: Sequence[SurveyedFace], axis: Floats) -> None:
    """Raise ValueError where one side of a lens has several curved surfaces, such as a dimple in another, or
    one that is nearly upright somewhere."""
    known, main = {face.number for face in group}, group[0]
    for other in faces:
        curved = not (other.is_ruled or other.is_flat or other.kind == "torus")
        if other.number not in known and curved and _faces_one_way(other, main, axis):
            raise ValueError(
                f"one side of the lens has two curved surfaces, {_words(main)} and {_words(other)}, that are "
                "not continued by each other; a Lens has one on each side"
            )
    if not _faces_one_way(main, main, axis):
        raise ValueError(
            f"an optical face, {_words(main)}, is steeper than {STEEPEST:.0f} degrees, as a half ball is "
            "at its equator; a Lens holds surfaces z(x, y) of lesser slope"
        )


def _words(face: SurveyedFace) -> str:
    return f"a {face.kind}" if face.radius is None else f"a {face.kind} of radius {face.radius:.6g} mm"


def _unit_of(entities: Entities) -> str:
    """Return the unit of length of a STEP file, "unknown" where it says none, several or another kind."""
    found = set()
    for context in having(entities, ASSIGNED):
        (units,) = context.parameters(ASSIGNED, 1)
        for unit in entities_of(entities, units, context):
            if "LENGTH_UNIT" not in unit.parts:
                continue
            if "CONVERSION_BASED_UNIT" in unit.parts:
                words = unit.parts["CONVERSION_BASED_UNIT"][:1]
            else:
                words = unit.parts.get("SI_UNIT", [])
            found.add("".join(word.lower() for word in words if isinstance(word, str)) or "unknown")
    return found.pop() if len(found) == 1 else "unknown"
