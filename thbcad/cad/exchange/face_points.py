"""Points and normals of the faces of an OCCT shape, as OCCT computes them: over a grid of their parameters,
and where rays first meet them.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from OCP.BRep import BRep_Tool
from OCP.gp import gp_Dir, gp_Lin, gp_Pnt, gp_Vec
from OCP.IntCurvesFace import IntCurvesFace_ShapeIntersector
from OCP.TopAbs import TopAbs_FACE, TopAbs_REVERSED
from OCP.TopExp import TopExp
from OCP.TopoDS import TopoDS_Face, TopoDS_Shape

from thbcad.cad.exchange.occt_texts import silence
from thbcad.cad.exchange.reading import faces_of, step_shape
from thbcad.cad.occt_names import ShapeNumbers, as_face
from thbcad.cad.shapes import TOLERANCE
from thbcad.checks import Floats, Integers
from thbcad.io import parse_brep

FARTHEST = 1e9  # mm along a ray
NEARER = 1.1  # times the start of a search: OCCT 8.0 finds the face that a ray leaves nearer than this


@dataclass(frozen=True, eq=False)
class FaceNodes:
    """Points (n_u, n_v, 3) in mm and outward unit normals (n_u, n_v, 3) of a face."""

    points: Floats
    normals: Floats


def face_nodes(shape: TopoDS_Shape, number: int, u: ArrayLike, v: ArrayLike) -> FaceNodes:
    """Return the FaceNodes of the surface under a face, at the parameters u x v, (n_u,) and (n_v,), or at
    pairs of them, (n_u, n_v) both.

    About 10 microseconds per node.

    number : of the face in the shape, from 0.
    """
    face = faces_of(shape)[number]
    evaluate = BRep_Tool.Surface_s(face).D1
    point, along_u, along_v = gp_Pnt(), gp_Vec(), gp_Vec()
    a, b = (np.asarray(row, dtype=np.float64) for row in (u, v))
    pairs = np.stack(np.broadcast_arrays(*((a[:, None], b) if a.ndim == 1 else (a, b))), axis=-1)
    rows = []
    for line in pairs.tolist():
        row = []
        for a, b in line:
            evaluate(a, b, point, along_u, along_v)
            row.append(point.Coord() + along_u.Coord() + along_v.Coord())
        rows.append(np.array(row))
    jet = np.stack(rows)
    normals = np.cross(jet[..., 3:6], jet[..., 6:])
    outward = -1.0 if face.Orientation() == TopAbs_REVERSED else 1.0
    return FaceNodes(jet[..., :3], outward * normals / np.linalg.norm(normals, axis=-1, keepdims=True))


@dataclass(frozen=True, eq=False)
class FaceHits:
    """Where n rays first meet a face: points (n, 3) in mm and outward unit normals (n, 3), NaN for rays that
    meet none.

    faces : (n,) int, the number of the face in the shape, -1 for none.
    """

    points: Floats
    normals: Floats
    faces: Integers


def step_solid(path: str | Path) -> TopoDS_Shape:
    """Return the shape of a STEP file with one solid, in mm.

    The text is read first by `parse_brep`: OCCT can end the process over a damaged file.

    Raises OSError : the file cannot be read.  ValueError : as `parse_brep`, or OCCT cannot read it.
    """
    parse_brep(path)
    silence()
    return step_shape(Path(path))


def face_hits(
    solid: str | Path | TopoDS_Shape, origins: ArrayLike, directions: ArrayLike, after: float = 1e-6
) -> FaceHits:
    """Return where rays first meet a face of a shape, or of the solid in a STEP file.

    origins, directions : (n, 3) float, mm and unit vectors.
    after : mm along the ray, from where meetings count; the default lets a ray leave the face that it starts
        on.

    Raises OSError, ValueError : as `step_solid`; origins and directions that are not (n, 3) or not finite.
    """
    origins, directions = (np.asarray(a, dtype=np.float64) for a in (origins, directions))
    if origins.shape != directions.shape or origins.ndim != 2 or origins.shape[1] != 3:
        raise ValueError(
            f"origins and directions must have the same shape (n, 3), got {origins.shape} and "
            f"{directions.shape}"
        )
    if not (np.isfinite(origins).all() and np.isfinite(directions).all() and directions.any(axis=1).all()):
        raise ValueError("origins and directions must be finite, directions not zero")
    shape = solid if isinstance(solid, TopoDS_Shape) else step_solid(solid)
    numbers = ShapeNumbers()
    TopExp.MapShapes_s(shape, TopAbs_FACE, numbers)
    intersector = IntCurvesFace_ShapeIntersector()
    intersector.Load(shape, TOLERANCE)
    points, normals = (np.full(origins.shape, np.nan) for _ in range(2))
    faces = np.full(len(origins), -1)
    for k, (origin, direction) in enumerate(zip(origins.tolist(), directions.tolist())):
        if first := first_hit(intersector, gp_Lin(gp_Pnt(*origin), gp_Dir(*direction)), after):
            face = intersector.Face(first)
            faces[k] = numbers.FindIndex(face) - 1
            points[k] = intersector.Pnt(first).Coord()
            u, v = intersector.UParameter(first), intersector.VParameter(first)
            normals[k] = point_and_normal(face, u, v)[1]
    return FaceHits(points, normals / np.linalg.norm(normals, axis=1, keepdims=True), faces)


def first_hit(intersector: IntCurvesFace_ShapeIntersector, line: gp_Lin, after: float) -> int:
    """Return the number of a line's first meeting with faces farther than `after`, mm; 0 for none.

    OCCT 8.0 reports a face just before `after` as if the line met it there.
    """
    intersector.PerformNearest(line, after, FARTHEST)
    if not intersector.NbPnt() or intersector.WParameter(1) > NEARER * after:
        return int(intersector.NbPnt() > 0)
    intersector.Perform(line, after, FARTHEST)
    lengths = [(intersector.WParameter(k), k) for k in range(1, intersector.NbPnt() + 1)]
    return min((found for found in lengths if found[0] > NEARER * after), default=(0.0, 0))[1]


def point_and_normal(face: TopoDS_Face, u: float, v: float) -> tuple[Floats, Floats]:
    """Return a point of the surface under a face, mm, and its outward normal there, of any length, (3,)
    each."""
    point, along_u, along_v = gp_Pnt(), gp_Vec(), gp_Vec()
    BRep_Tool.Surface_s(as_face(face)).D1(u, v, point, along_u, along_v)
    outward = -1.0 if face.Orientation() == TopAbs_REVERSED else 1.0
    return np.array(point.Coord()), outward * np.array(along_u.Crossed(along_v).Coord())
