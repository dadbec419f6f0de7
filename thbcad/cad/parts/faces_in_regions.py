"""Which faces of a solid come into a convex region: a proof where none does.

A face is shut out piece by piece by half-spaces.  Where a piece may come in it is halved, until a point of
the face is found inside, or the pieces are too many to go on.
"""

from collections.abc import Collection
from itertools import pairwise

import numpy as np
from OCP.Bnd import Bnd_Box2d
from OCP.BndLib import BndLib_Add2dCurve
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve, BRepAdaptor_Curve2d
from OCP.BRepClass import BRepClass_FaceClassifier
from OCP.Geom import Geom_Plane, Geom_RectangularTrimmedSurface
from OCP.GeomAbs import GeomAbs_Line
from OCP.gp import gp_Pnt, gp_Pnt2d
from OCP.TopAbs import TopAbs_OUT
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Shape

from thbcad.cad.exchange import edges_of, faces_of
from thbcad.cad.occt_names import box_limits
from thbcad.cad.parts.face_enclosures import Pieces, edge_pieces, face_pieces, split
from thbcad.cad.shapes import TOLERANCE
from thbcad.certified import ConvexRegion
from thbcad.checks import Bools, Floats

HALVINGS = 24
MOST = 4096  # pieces at once: what is not decided by then comes in for all that is known
OF_EDGE = 64  # pieces of an edge in the parameters of a face
SECTION = 9  # points of a section with a plane, in each direction


def faces_within(
    solid: TopoDS_Shape, region: ConvexRegion, left_out: Collection[int] = ()
) -> dict[int, Floats]:
    """Return the faces of a solid that may come into a region, by number from 0: for each the points of it
    inside that were found, (n, 3) mm, none where it is undecided.

    What is not returned stays outside, as far as edges lie on their faces.
    left_out : numbers of faces that are not looked at.
    """
    found = {}
    for number, face in enumerate(faces_of(solid)):
        if number not in left_out:
            points = _face_within(face, region)
            if points is not None:
                found[number] = points
    return found


def edges_within(face: TopoDS_Face, region: ConvexRegion) -> bool:
    """Return whether an edge of a face may come into a region."""
    return any(_edge_within(edge, region) is not None for edge in real_edges(face))


def real_edges(face: TopoDS_Face) -> list[TopoDS_Edge]:
    """Return the edges of a face but those that are a point, as at the poles of a sphere."""
    return [edge for edge in edges_of(face) if not BRep_Tool.Degenerated_s(edge)]


def on_face(face: TopoDS_Face, points: Floats) -> Bools:
    """Return which points of the surface under a face lie in the face, (n,).  points : (n, 3), mm."""
    states = [BRepClass_FaceClassifier(face, gp_Pnt(*p), TOLERANCE).State() for p in points.tolist()]
    return np.array([state != TopAbs_OUT for state in states], dtype=bool)


def _face_within(face: TopoDS_Face, region: ConvexRegion) -> Floats | None:
    """Return the points of a face inside a region that were found; None where it is proven to be outside."""
    surface = BRep_Tool.Surface_s(face)
    while isinstance(surface, Geom_RectangularTrimmedSurface):
        surface = surface.BasisSurface()
    if isinstance(surface, Geom_Plane):
        return _plane_within(face, surface, region)
    pieces = face_pieces(face)
    return _pieces_within(pieces, region, None if pieces is None else _Inside(face, pieces))


def _edge_within(edge: TopoDS_Edge, region: ConvexRegion) -> Floats | None:
    """Return points of an edge inside a region, as `_face_within`."""
    curve = BRepAdaptor_Curve(edge)
    if curve.GetType() == GeomAbs_Line:
        ends = [np.array(curve.Value(t).Coord()) for t in (curve.FirstParameter(), curve.LastParameter())]
        part = region.part_of_line(*ends)
        return part.mean(axis=0, keepdims=True) if len(part) else None
    return _pieces_within(edge_pieces(edge), region)


def _plane_within(face: TopoDS_Face, plane: Geom_Plane, region: ConvexRegion) -> Floats | None:
    """Return points of a plane face inside a region, as `_face_within`.

    Where no edge comes into the region, its section with the plane is all in the face or all outside of it.
    """
    frame = plane.Position()
    axes = frame.Location(), frame.XDirection(), frame.YDirection()
    origin, across, along = (np.array(axis.Coord()) for axis in axes)
    reach = 2 * float(np.abs(region.offsets).max() + np.linalg.norm(origin))
    corners = region.section(origin, across, along, reach)
    if not len(corners):
        return None
    middle = corners.mean(axis=0)
    steps = np.linspace(0.0, 1.0, SECTION)[:-1, None, None]
    points = (middle + steps * (corners - middle)).reshape(-1, 3)
    crossing = [found for edge in edges_of(face) if (found := _edge_within(edge, region)) is not None]
    if not crossing and not on_face(face, middle[None])[0]:
        return None
    points = points[region.holds(points)]
    return np.concatenate([*crossing, points[on_face(face, points)]])


class _Inside:
    """What of the rectangle of parameters round a face lies in the face."""

    def __init__(self, face: TopoDS_Face, pieces: Pieces) -> None:
        self._face, self._own = face, pieces.own
        self._boxes = _edge_boxes(face) if pieces.own else np.empty((0, 4))

    def kept(self, cells: Floats) -> Floats:
        """Return the cells that may hold a part of the face: no edge crosses the others, which lie beside."""
        if not self._own or not len(cells):
            return cells
        a, b = cells[:, None], self._boxes[None]
        apart = (a[..., 0::2] > b[..., 1::2]).any(axis=-1) | (a[..., 1::2] < b[..., 0::2]).any(axis=-1)
        crossed: Bools = np.logical_not(np.all(apart, axis=1))
        crossed[~crossed] = self._holds(cells[~crossed].reshape(-1, 2, 2).mean(axis=2))
        return cells[crossed]

    def held(self, parameters: Floats, points: Floats) -> Floats:
        """Return those of the points at some parameters, (n, 2), that lie in the face, mm."""
        return points[self._holds(parameters) if self._own else on_face(self._face, points)]

    def _holds(self, parameters: Floats) -> Bools:
        places = (gp_Pnt2d(*row) for row in parameters.tolist())
        states = [BRepClass_FaceClassifier(self._face, place, TOLERANCE).State() for place in places]
        return np.array([state != TopAbs_OUT for state in states], dtype=bool)


def _pieces_within(pieces: Pieces | None, region: ConvexRegion, face: _Inside | None = None) -> Floats | None:
    """Return points of an edge or a face inside a region, as `_face_within`; all of an edge counts."""
    if pieces is None:
        return np.empty((0, 3))
    cells = pieces.roots
    for _ in range(HALVINGS):
        cells = cells[~region.misses(pieces.nets(cells))]
        cells = cells if face is None else face.kept(cells)
        if not len(cells):
            return None
        middles = cells.reshape(len(cells), -1, 2).mean(axis=2)
        points = pieces.nets(np.repeat(middles, 2, axis=1))[:, 0]
        inside = region.holds(points)
        points = points[inside] if face is None else face.held(middles[inside], points[inside])
        if len(points) or len(cells) > MOST:
            return points
        cells = split(cells)
    return np.empty((0, 3))


def _edge_boxes(face: TopoDS_Face) -> Floats:
    """Return rectangles of parameters that hold the edges of a face, (n, 4): low and high of u, then of v."""
    rows = []
    for edge in edges_of(face):
        curve = BRepAdaptor_Curve2d(edge, face)
        steps = np.linspace(curve.FirstParameter(), curve.LastParameter(), OF_EDGE + 1).tolist()
        for low, high in pairwise(steps):
            box = Bnd_Box2d()
            BndLib_Add2dCurve.Add_s(curve, low, high, TOLERANCE, box)
            low_u, low_v, high_u, high_v = box_limits(box)
            rows.append((low_u, high_u, low_v, high_v))
    return np.array(rows).reshape(-1, 4)
