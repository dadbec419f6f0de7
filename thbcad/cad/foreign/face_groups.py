"""Faces that form one surface of a solid: which they are, the rim round them, and heights along an axis."""

from collections.abc import Sequence

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.gp import gp_Dir, gp_Lin, gp_Pnt, gp_Vec
from OCP.IntCurvesFace import IntCurvesFace_Intersector
from OCP.ShapeUpgrade import ShapeUpgrade_UnifySameDomain
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_REVERSED
from OCP.TopExp import TopExp
from OCP.TopoDS import TopoDS_Edge, TopoDS_Shape
from OCP.TopTools import TopTools_IndexedDataMapOfShapeListOfShape
from scipy.optimize import minimize_scalar

from thbcad.cad.exchange import edges_of, faces_of, point_and_normal, solid_volume
from thbcad.cad.foreign.surveyed_faces import FaceEdge, SurveyedFace
from thbcad.checks import Floats
from thbcad.poses import Pose
from thbcad.splines import gauss_rule

STEP = 1e-6  # of two samples' distance: a greatest value errs by its square
SMOOTH = 1e-3  # rad between normals on a common edge: one surface that was split
TOLERANCE = 1e-6  # mm: rays through the rim count
FARTHEST = 1e6  # mm along a line
INTEGRAL = 1e-9  # relative: how well the volume of a solid is computed
UNCHANGED = 1e-8  # relative: by how much the volume may differ after faces were merged
NODES = 6  # of the Gauss rule between two samples of an edge


def unified(solid: TopoDS_Shape) -> TopoDS_Shape:
    """Return a solid with one face where faces of one plane, sphere, cylinder, cone or torus meet smoothly.

    A merge that changes the volume is not taken.  Splines stay in their faces: `continued` finds these.
    """
    merging = ShapeUpgrade_UnifySameDomain(solid, True, True, False)  # edges, faces, splines along edges
    merging.Build()
    merged = merging.Shape()
    if len(faces_of(merged)) == len(faces_of(solid)):
        return solid
    before, after = (solid_volume(shape, INTEGRAL) for shape in (solid, merged))
    return merged if abs(after - before) <= UNCHANGED * abs(before) else solid


def continued(solid: TopoDS_Shape, faces: Sequence[SurveyedFace], start: SurveyedFace) -> list[SurveyedFace]:
    """Return `start` and the faces that continue it smoothly, from one to the next, in their order.

    faces : those that may belong to it.
    """
    owners = TopTools_IndexedDataMapOfShapeListOfShape()
    TopExp.MapShapesAndAncestors_s(solid, TopAbs_EDGE, TopAbs_FACE, owners)
    found, waiting = {start.number}, [start]
    while waiting:
        own = waiting.pop()
        for edge in edges_of(own.face):
            beside = list(owners.FindFromKey(edge))
            for other in (f for f in faces if f.number not in found):
                shared = any(other.face.IsSame(face) for face in beside)
                if shared and _is_smooth(edge, own, other):
                    found.add(other.number)
                    waiting.append(other)
    return [face for face in faces if face.number in found] or [start]


def _is_smooth(edge: TopoDS_Edge, first: SurveyedFace, second: SurveyedFace) -> bool:
    """Return whether two faces have one normal in the middle of their common edge."""
    normals = []
    for face in (first.face, second.face):
        curve = BRep_Tool.CurveOnSurface_s(edge, face, 0.0, 0.0)
        low, high = BRep_Tool.Range_s(edge, face)
        _, normal = point_and_normal(face, *curve.Value((low + high) / 2).Coord())
        normals.append(normal / (float(np.linalg.norm(normal)) or 1.0))
    return float(np.linalg.norm(normals[0] - normals[1])) < SMOOTH


def rim_edges(faces: Sequence[SurveyedFace]) -> list[FaceEdge]:
    """Return the edges round a group of faces: those that no two of them share."""
    edges = [edge for face in faces for edge in face.edges]
    return [own for own in edges if sum(own.edge.IsSame(other.edge) for other in edges) == 1]


def rim_points(edges: Sequence[FaceEdge]) -> Floats:
    """Return points of edges, both ends included, (n, 3), mm."""
    return np.concatenate([np.empty((0, 3)), *(edge.points for edge in edges)])


def reach(edges: Sequence[FaceEdge], direction: Floats) -> float:
    """Return the greatest d . p over the points p of edges, mm."""
    farthest = -np.inf
    for _, curve, t, points in edges:
        along = points @ direction
        best, last = int(np.argmax(along)), len(t) - 1
        # a closed edge goes on at its other end
        for near in {best} if 0 < best < last else {0, last}:
            ends = t[[max(near - 1, 0), min(near + 1, last)]]
            between = minimize_scalar(
                lambda at, curve=curve: -float(direction @ curve.Value(float(at)).Coord()),
                bounds=ends,
                method="bounded",
                options={"xatol": STEP * (ends[1] - ends[0])},
            )
            farthest = max(farthest, float(along[near]), -float(between.fun))
    return farthest


def shadow_area(edges: Sequence[FaceEdge], frame: Pose) -> float:
    """Return the area within edges as seen along the axis of a frame, mm^2, holes taken off:

    A = 1/2 of the closed integral of x dy - y dx.
    """
    x, y = frame.rotation.T[:2]
    point, slope = gp_Pnt(), gp_Vec()
    total = 0.0
    for edge, curve, t, _ in edges:
        at, weights = gauss_rule(t, NODES)
        rows = []
        for each in at.tolist():
            curve.D1(each, point, slope)
            rows.append(point.Coord() + slope.Coord())
        jet = np.array(rows)
        p, d = jet[:, :3] - frame.shift, jet[:, 3:]
        part = float(weights @ ((p @ x) * (d @ y) - (p @ y) * (d @ x))) / 2
        total += -part if edge.Orientation() == TopAbs_REVERSED else part
    return abs(total)


def axial_heights(faces: Sequence[SurveyedFace], frame: Pose, x: Floats, y: Floats) -> Floats:
    """Return z of the faces at positions (x, y) of the frame, (n,), NaN where they have none, mm.

    About 0.1 ms per position and face.
    """
    intersectors = [IntCurvesFace_Intersector(face.face, TOLERANCE) for face in faces]
    direction = gp_Dir(*frame.rotation[:, 2].tolist())
    starts = frame.points(np.stack([x, y, np.zeros(len(x))])).T
    heights = np.full(len(x), np.nan)
    for k, start in enumerate(starts.tolist()):
        line = gp_Lin(gp_Pnt(*start), direction)
        for intersector in intersectors:
            intersector.Perform(line, -FARTHEST, FARTHEST)
            if intersector.IsDone() and intersector.NbPnt():
                heights[k] = intersector.WParameter(1)
                break
    return heights
