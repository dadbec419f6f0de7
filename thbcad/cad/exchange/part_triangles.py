"""Triangle meshes of any solid by OCCT, with a measured chord error.

OCCT misses the deflection that it is asked for.  Its mesh is therefore measured against the surfaces, and
made again, finer, until the measured error keeps the chord.  A point of a triangle is compared with the point
of the surface at the same barycentric coordinates of the parameters, which is an upper bound of the distance.
The mesher is slow on spline faces: the room of meshes has proven ones of lenses with apertures and flanges.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.BRepTools import BRepTools
from OCP.Geom import Geom_BSplineSurface, Geom_Plane
from OCP.TopAbs import TopAbs_REVERSED
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Face, TopoDS_Shape

from thbcad.cad.shapes import Part, spline_surface
from thbcad.checks import MAX_DEGREE, Floats, Integers, require_number
from thbcad.lens import Tessellation

LEAST = 1e-5  # mm; finer meshes take OCCT hours
ANGLE = 0.35  # rad between neighbouring chords: 18 to a turn, so that small bores stay round
ROUNDS = 8
SAME = 9  # decimals of mm within which points of neighbours are one
SLOWEST = 100_000  # triangles, up to which OCCT's mesher takes some minutes
SAMPLES = (
    np.array(  # barycentric: the quarters of a triangle, its rim included
        [(i, j, 4 - i - j) for i in range(5) for j in range(5 - i)], dtype=np.float64
    )
    / 4
)


def part_mesh(part: Part, chord: float, single: bool = False) -> Tessellation:
    """Return a mesh of a Part, its faces named as those of the part, within a measured chord error.

    chord : mm.  Fifteen points of every triangle are measured.
    single : round the vertices to float32.

    Raises ValueError : a chord below 1e-5 mm, or one that OCCT does not keep with 100,000 triangles.
    Raises RuntimeError : OCCT leaves a face without triangles.
    """
    require_number("chord", chord, least=LEAST, finite=True)
    pieces, error = _meshed(part.solid, part.faces, chord / 2, chord, single, True)
    if error > chord:
        count = sum(len(piece.triangles) for piece in pieces)
        raise ValueError(
            f"OCCT's mesh of {count:,} triangles is {error:.2g} mm off; allow a chord error of more than that"
        )
    return _joined(pieces, error, tuple(part.names))


def face_triangles(faces: Sequence[TopoDS_Face], chord: float) -> Floats:
    """Return the corners of triangles of some faces, (n, 3, 3), mm.

    chord : mm, that OCCT is asked for; for splines it is asked again where the measured error exceeds it.

    Raises RuntimeError : OCCT leaves a face without triangles.
    """
    found = [np.empty((0, 3, 3))]
    for face in faces:
        curved = isinstance(BRep_Tool.Surface_s(face), Geom_BSplineSurface)
        (piece,), _ = _meshed(face, [face], chord, chord, False, curved)
        found.append(piece.points[piece.triangles])
    return np.concatenate(found)


@dataclass(frozen=True, eq=False)
class _Piece:
    """The triangles of a face: points (n, 3) in mm, their parameters (n, 2), corners (t, 3), outward.

    rounding : mm, how far the points were moved at most.
    """

    points: Floats
    parameters: Floats
    triangles: Integers
    rounding: float


def _meshed(
    shape: TopoDS_Shape, faces: Sequence[TopoDS_Face], asked: float, chord: float, single: bool, measure: bool
) -> tuple[list[_Piece], float]:
    """Return the triangles of the faces of a shape, and their error where it is measured: OCCT is asked for
    less and less until they keep a chord, or are too many to go on."""
    for _ in range(ROUNDS):
        BRepTools.Clean_s(shape)
        BRepMesh_IncrementalMesh(shape, asked, False, ANGLE, False)
        pieces = [_piece(face, single) for face in faces]
        error = max(map(_error, faces, pieces)) if measure else 0.0
        if error <= chord or sum(len(piece.triangles) for piece in pieces) > SLOWEST:
            break
        asked *= min(0.5, 0.7 * chord / error)
    BRepTools.Clean_s(shape)  # the shape is as it was
    return pieces, error


def _piece(face: TopoDS_Face, single: bool) -> _Piece:
    location = TopLoc_Location()
    mesh = BRep_Tool.Triangulation_s(face, location)
    if mesh is None:
        raise RuntimeError("OCCT left a face of the solid without triangles")
    shift = location.Transformation()
    nodes = range(1, mesh.NbNodes() + 1)
    points = np.array([mesh.Node(k).Transformed(shift).Coord() for k in nodes])
    parameters = np.array([mesh.UVNode(k).Coord() for k in nodes])
    corners = np.array([mesh.Triangle(k).Get() for k in range(1, mesh.NbTriangles() + 1)]) - 1
    inward = face.Orientation() == TopAbs_REVERSED
    kept = points.astype(np.float32).astype(np.float64) if single else points
    rounding = float(np.linalg.norm(kept - points, axis=1).max())
    return _Piece(kept, parameters, corners[:, ::-1] if inward else corners, rounding)


def _error(face: TopoDS_Face, piece: _Piece) -> float:
    """Return the greatest measured distance of the triangles of a face from its surface, mm."""
    surface = BRep_Tool.Surface_s(face)
    if isinstance(surface, Geom_Plane):
        return piece.rounding
    points, parameters = (
        np.einsum("kc,tcd->tkd", SAMPLES, rows[piece.triangles]).reshape(-1, rows.shape[1])
        for rows in (piece.points, piece.parameters)
    )
    if isinstance(surface, Geom_BSplineSurface) and max(surface.UDegree(), surface.VDegree()) <= MAX_DEGREE:
        spline = spline_surface(surface)
        exact = spline(*spline.on_domain(*parameters.T))
    else:
        exact = np.array([surface.Value(u, v).Coord() for u, v in parameters.tolist()])
    return float(np.linalg.norm(points - exact, axis=1).max())


def _joined(pieces: list[_Piece], error: float, names: tuple[str, ...]) -> Tessellation:
    """Return the mesh of all faces, with one vertex where the points of neighbours agree."""
    points = np.concatenate([piece.points for piece in pieces])
    first = np.cumsum([0, *(len(piece.points) for piece in pieces)])
    triangles = np.concatenate([piece.triangles + start for piece, start in zip(pieces, first)])
    faces = np.repeat(np.arange(len(pieces)), [len(piece.triangles) for piece in pieces])
    _, chosen, owner = np.unique(points.round(SAME) + 0.0, axis=0, return_index=True, return_inverse=True)
    triangles = owner.ravel()[triangles]
    whole = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)  # OCCT leaves some at seams and poles
    triangles = triangles[whole]
    edges = np.concatenate([triangles[:, [k, (k + 1) % 3]] for k in range(3)])
    codes, back = (edges @ [[len(points)], [1]]).ravel(), (edges[:, ::-1] @ [[len(points)], [1]]).ravel()
    if not np.array_equal(np.sort(codes), np.sort(back)):
        raise RuntimeError(
            "OCCT's mesh is not closed: neighbouring faces have different points on their edges"
        )
    return Tessellation(points[chosen], triangles, faces[whole], error, names)
