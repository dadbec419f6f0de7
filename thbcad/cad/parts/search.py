"""A lens found within a part of any program: its optical faces, and how the part has moved it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.BRepBuilderAPI import BRepBuilderAPI_Copy, BRepBuilderAPI_Transform
from OCP.Geom import Geom_Surface
from OCP.TopAbs import TopAbs_SOLID
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Face, TopoDS_Shape

from thbcad.cad.exchange import edges_of, explore, faces_of, optical_form
from thbcad.cad.parts.numbers_of_surfaces import SurfaceNumbers, matrix_of, rigid_motion, surface_numbers
from thbcad.cad.shapes import TOLERANCE, Part, lens_part
from thbcad.checks import Floats
from thbcad.lens import FreeformSurface, Lens, OpticalForm

OPTICAL = ("front", "rear")
ON_EDGE = 5  # points of an edge, its ends too, that show whether a face leaves the outline of a lens
REMEDY = "add to a lens with thbcad.cad.join, or without clean()"
APART = 10 * TOLERANCE  # mm; booleans of OCCT move edges by a few of its tolerances


@dataclass(frozen=True, eq=False)
class PlacedLens:
    """A lens within a part.

    solid : TopoDS_Solid of the part, mm
    placement : TopLoc_Location, from the lens's frame to that of the part
    faces : {"front": face, "rear": face}, TopoDS_Face of the solid
    surfaces : {"front": surface, "rear": surface}, Geom_Surface of the lens, in its frame
    """

    solid: TopoDS_Shape
    placement: TopLoc_Location
    faces: dict[str, TopoDS_Face]
    surfaces: dict[str, Geom_Surface]

    @property
    def matrix(self) -> Floats:
        """The placement as a rotation beside a shift in mm, (3, 4)."""
        return matrix_of(self.placement.Transformation())

    @property
    def moved(self) -> bool:
        """Whether the part lies elsewhere than the lens."""
        return not np.array_equal(self.matrix, np.eye(4)[:3])

    @property
    def numbers(self) -> tuple[int, int]:
        """The numbers of front and rear among the faces of the solid, from 0."""
        faces = faces_of(self.solid)
        front, rear = (
            next(k for k, face in enumerate(faces) if face.IsSame(self.faces[name])) for name in OPTICAL
        )
        return front, rear

    def geometry(self, name: str) -> Geom_Surface:
        """Return the surface under the front or the rear as the part has it, without its location."""
        return BRep_Tool.Surface_s(self.faces[name], TopLoc_Location())

    @property
    def forms(self) -> tuple[OpticalForm, OpticalForm]:
        """Front and rear as the part has them, in the lens's frame.

        Raises ValueError : a surface that no lens has.
        """
        faces = faces_of(self.in_lens_frame())
        front, rear = (optical_form(faces[number]) for number in self.numbers)
        if front is None or rear is None:
            name = OPTICAL[front is not None]
            raise ValueError(f"the {name} of the part is no spline over x and y and no conic around z")
        return front, rear

    def in_lens_frame(self) -> TopoDS_Shape:
        """Return a copy of the solid in the frame of the lens, whose numbers are those of that frame: nothing
        of it has a location."""
        unmoved = self.solid.Located(TopLoc_Location())
        rest = self.solid.Location().Inverted().Multiplied(self.placement)
        if rest.IsIdentity():
            return BRepBuilderAPI_Copy(unmoved, False, False).Shape()
        return BRepBuilderAPI_Transform(unmoved, rest.Inverted().Transformation(), True).Shape()


def is_shape(part: object) -> bool:
    """Return whether something is a part of build123d, of cadquery, a Workplane or a shape of OCP itself."""
    return isinstance(_wrapped(part), TopoDS_Shape)


def occt_shape(part: object) -> TopoDS_Shape:
    """Return the OCCT shape of what `is_shape`."""
    shape = _wrapped(part)
    if not isinstance(shape, TopoDS_Shape) or shape.IsNull():
        raise ValueError(
            f"part must be a Lens or one shape of build123d, cadquery or OCP, got {type(part).__name__}"
        )
    return shape


def _wrapped(part: object) -> Any:
    shape: Any = part
    if hasattr(part, "vals"):  # a Workplane of cadquery
        values = part.vals()
        shape = values[0] if len(values) == 1 else None
    elif isinstance(part, Part):
        shape = part.solid
    elif hasattr(part, "part"):  # a BuildPart of build123d
        shape = part.part
    return getattr(shape, "wrapped", shape)


def one_solid(part: object) -> TopoDS_Shape:
    """Return the one solid of a part, as `occt_shape`; raise ValueError where there is not one."""
    solids = explore(occt_shape(part), TopAbs_SOLID)
    if len(solids) != 1:
        raise ValueError(
            f"part must hold one solid, got {len(solids)}; write each solid of an assembly alone"
        )
    return solids[0]


def placed_lens(part: object, lens: Lens) -> PlacedLens:
    """Return where a part has a lens: the faces whose surfaces are its front and its rear, wherever it is
    moved to.

    Raises ValueError : not one solid; a front or a rear that is missing, grew beyond the lens or fell into
        pieces; a mirrored part.
    """
    solid = one_solid(part)
    own = lens_part(lens)
    surfaces = {
        name: BRep_Tool.Surface_s(face) for name, face in zip(own.names, own.faces) if name in OPTICAL
    }
    wanted = {name: surface_numbers(surface) for name, surface in surfaces.items()}
    faces = [_NumberedFace.of(face) for face in faces_of(solid)]
    best = missing = [_missing(name) for name in OPTICAL]
    for placement in _placements(faces, wanted):
        found, wrong = _faces_at(faces, wanted, placement, lens)
        if not wrong:
            if placement.Transformation().VectorialPart().Determinant() < 0:
                raise ValueError("the part is mirrored, which no placement in a file can do; mirror the lens")
            return PlacedLens(solid, placement, found, surfaces)
        # a missing face is farther from a lens that is found than a large one
        best = min(best, wrong, key=lambda sentences: sum(1 + (s in missing) for s in sentences))
    raise ValueError("; ".join(best))


class _NumberedFace(NamedTuple):
    """A face, the numbers of its surface without its location, and that location."""

    face: TopoDS_Face
    numbers: SurfaceNumbers
    location: TopLoc_Location

    @classmethod
    def of(cls, face: TopoDS_Face) -> _NumberedFace:
        location = TopLoc_Location()
        return cls(face, surface_numbers(BRep_Tool.Surface_s(face, location)), location)

    @property
    def placed(self) -> SurfaceNumbers:
        return self.numbers.moved_by(matrix_of(self.location.Transformation()))


def _missing(name: str) -> str:
    return (
        f"the part holds no face with the surface of the {name}: it has another lens, or clean() merged the "
        f"face with others; {REMEDY}"
    )


def _placements(faces: list[_NumberedFace], wanted: dict[str, SurfaceNumbers]) -> Iterator[TopLoc_Location]:
    """Yield the motions that take front or rear to a face, the exact ones first: where a face has the very
    numbers of the lens, its location is the motion."""
    pairs = [(face, own) for face in faces for own in wanted.values() if face.numbers.matches(own)]
    for face, own in pairs:
        if not face.numbers.differing(own):
            yield face.location
    yield TopLoc_Location()
    for face, own in pairs:
        motion = rigid_motion(own, face.numbers)
        if motion is not None:
            yield face.location.Multiplied(TopLoc_Location(motion))


def _faces_at(
    faces: list[_NumberedFace], wanted: dict[str, SurfaceNumbers], placement: TopLoc_Location, lens: Lens
) -> tuple[dict[str, TopoDS_Face], list[str]]:
    """Return the optical faces at a placement by name, and a sentence for each that is not found."""
    found: dict[str, TopoDS_Face] = {}
    wrong = []
    matrix = matrix_of(placement.Transformation())
    back = placement.Inverted().Transformation()
    for name, numbers in wanted.items():
        moved = numbers.moved_by(matrix)
        there = [f.face for f in faces if f.numbers.matches(moved) and f.placed.same_points(moved, APART)]
        own = lens.front if name == "front" else lens.rear
        inside = [face for face in there if _beyond(face, back, own) is None]
        if len(inside) == 1:
            found[name] = inside[0]
        elif inside:
            wrong.append(f"the {name} is cut into {len(inside)} pieces")
        elif there:
            wrong.append(_merged(name, there, back, own))
        else:
            wrong.append(_missing(name))
    return found, wrong


def _beyond(face: TopoDS_Face, back: Any, surface: FreeformSurface) -> Floats | None:
    """Return the point of a face's edges, in the lens's frame, that lies farthest outside of the outline of
    a surface, None where none does."""
    points = []
    for edge in edges_of(face):
        if not BRep_Tool.Degenerated_s(edge):
            curve = BRepAdaptor_Curve(edge)
            steps = np.linspace(curve.FirstParameter(), curve.LastParameter(), ON_EDGE)
            points += [curve.Value(t).Transformed(back).Coord() for t in steps.tolist()]
    rows = np.array(points).reshape(-1, 3)
    # a lower bound of the distance
    outside = (surface.outline.gauge(*rows[:, :2].T) - 1) * min(surface.half_width)
    far = int(np.argmax(outside)) if len(rows) else 0
    return rows[far] if len(rows) and outside[far] > APART else None


def _merged(name: str, faces: list[TopoDS_Face], back: Any, surface: FreeformSurface) -> str:
    """Return what is wrong with an optical face that is only part of a larger face."""
    points = [p for face in faces if (p := _beyond(face, back, surface)) is not None]
    x, y, _ = min(points, key=lambda p: float(np.abs(p[:2]).max()))
    hx, hy = surface.half_width
    return (
        f"the {name} is merged with the face round it, which reaches x = {x:.6g}, y = {y:.6g} mm where the "
        f"{name} ends at {hx:.6g} x {hy:.6g} mm; {REMEDY}"
    )
