"""Faces that form one surface of a solid: which they are, the rim round them, and heights along an axis."""

from collections.abc import Sequence

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.BRepBuilderAPI import BRepBuilderAPI_Copy
from OCP.BRepTools import BRepTools
from OCP.GeomAbs import GeomAbs_CN, GeomAbs_Sphere
from OCP.gp import gp_Dir, gp_Lin, gp_Pnt, gp_Vec
from OCP.IntCurvesFace import IntCurvesFace_Intersector
from OCP.ShapeUpgrade import ShapeUpgrade_UnifySameDomain
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_REVERSED
from OCP.TopExp import TopExp
from OCP.TopoDS import TopoDS_Edge, TopoDS_Shape
from scipy.optimize import minimize_scalar

from thbcad.cad.exchange import OCCT_ERRORS, edges_of, faces_of, point_and_normal, solid_volume
from thbcad.cad.foreign.surveyed_faces import FaceEdge, SurveyedFace
from thbcad.cad.occt_names import RealArray, ShapeOwners
from thbcad.checks import Floats
from thbcad.poses import Pose
from thbcad.splines import gauss_rule

STEP = 1e-6  # of two samples' distance: a greatest value errs by its square
SMOOTH = 1e-3  # rad between normals on a common edge: one surface that was split
TOLERANCE = 1e-6  # mm: rays through the rim count
FARTHEST = 1e6  # mm along a line
INTEGRAL = 1e-8  # relative: how well the volume of a solid is computed
UNCHANGED = 1e-7  # relative: by how much the volume may differ after faces were merged
BESIDE = 1e-5 * np.array([(0.8, 0.6), (-0.6, 0.8), (-0.8, -0.6), (0.6, -0.8)])  # mm: the sag there is 1e-11
MERIDIAN = 129  # samples of a meridian, between which Newton's method starts
NEWTON = 6  # steps, of which four suffice for rounding
PANELS = 8  # of an edge at least, for an integral along it
NODES = 6  # of the Gauss rule on each panel


def unified(solid: TopoDS_Shape) -> TopoDS_Shape:
    """Return a solid with one face where faces of one plane, cylinder, cone or torus meet smoothly.

    A merge that changes the volume is not taken.  Splines and spheres stay in their faces, which `continued`
    finds: over spheres that meet in a pole OCCT 7.9 ends the process.
    """
    copy = BRepBuilderAPI_Copy(solid).Shape()  # where OCCT fails, it leaves a shape half changed
    merging = ShapeUpgrade_UnifySameDomain(copy, True, True, False)  # edges, faces, splines along edges
    for face in faces_of(copy):
        if BRepAdaptor_Surface(face).GetType() == GeomAbs_Sphere:
            for edge in edges_of(face):
                merging.KeepShape(edge)
    try:
        merging.Build()
    except OCCT_ERRORS:
        return solid
    merged = merging.Shape()
    if len(faces_of(merged)) == len(faces_of(solid)):
        return solid
    before, after = (solid_volume(shape, INTEGRAL) for shape in (solid, merged))
    return merged if abs(after - before) <= UNCHANGED * abs(before) else solid


def continued(solid: TopoDS_Shape, faces: Sequence[SurveyedFace], start: SurveyedFace) -> list[SurveyedFace]:
    """Return `start` and the faces that continue it smoothly, from one to the next, in their order.

    faces : those that may belong to it.
    """
    owners = ShapeOwners()
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


def outer_edges(edges: Sequence[FaceEdge]) -> list[FaceEdge]:
    """Return the edges of the outline among those round a group of faces, without those of openings: the loop
    with the largest box."""
    loops: list[list[FaceEdge]] = []
    for own in edges:
        joined = [loop for loop in loops if any(_share_vertex(own.edge, other.edge) for other in loop)]
        loops = [loop for loop in loops if all(loop is not one for one in joined)] + [
            [own, *(e for loop in joined for e in loop)]
        ]
    return max(loops, key=lambda loop: float(np.linalg.norm(np.ptp(rim_points(loop), axis=0))), default=[])


def _share_vertex(first: TopoDS_Edge, second: TopoDS_Edge) -> bool:
    """Return whether two edges meet in a vertex."""
    ends = [(TopExp.FirstVertex_s(edge), TopExp.LastVertex_s(edge)) for edge in (first, second)]
    return any(own.IsSame(other) for own in ends[0] for other in ends[1])


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
        spans = RealArray(1, curve.NbIntervals(GeomAbs_CN) + 1)  # within which it is smooth
        curve.Intervals(spans, GeomAbs_CN)
        at, weights = gauss_rule(np.union1d(list(spans), t[:: len(t) // PANELS]), NODES)
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

    OCCT can miss a face on its rim, on its seam and where it meets the next one: there the height follows
    from points beside it, up to 2e-5 mm away.  About 0.1 ms per position and face.
    """
    heights = _hit_heights(faces, frame, x, y)
    for step in BESIDE:
        missed = np.flatnonzero(np.isnan(heights))
        if not len(missed):
            break
        near, other, far = (
            _hit_heights(faces, frame, x[missed] + way * step[0], y[missed] + way * step[1])
            for way in (1, -1, 2)
        )
        heights[missed] = np.where(np.isnan(other), 2 * near - far, (near + other) / 2)
    return heights


def _hit_heights(faces: Sequence[SurveyedFace], frame: Pose, x: Floats, y: Floats) -> Floats:
    """Return where lines along the axis meet faces, as `axial_heights`."""
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


def meridian_heights(faces: Sequence[SurveyedFace], frame: Pose, radius: Floats) -> Floats:
    """Return z of faces on surfaces of revolution around the axis of a frame at distances from it, (n,), NaN
    where they have none, mm."""
    heights = np.full(len(radius), np.nan)
    for face in faces:
        missing = np.flatnonzero(np.isnan(heights))
        if len(missing):
            heights[missing] = _meridian_of(face, frame, radius[missing])
    return heights


def _meridian_of(face: SurveyedFace, frame: Pose, radius: Floats) -> Floats:
    """Return z of one face, as `meridian_heights`: by Newton's method from the nearest sample."""
    surface = BRepAdaptor_Surface(face.face)
    u0, u1, v0, v1 = BRepTools.UVBounds_s(face.face)
    u, (x, y, z) = (u0 + u1) / 2, frame.rotation.T
    point, along_u, along_v = gp_Pnt(), gp_Vec(), gp_Vec()

    def at(v: Floats) -> tuple[Floats, Floats, Floats]:
        rows = []
        for each in v.tolist():
            surface.D1(u, each, point, along_u, along_v)
            rows.append(point.Coord() + along_v.Coord())
        jet = np.array(rows)
        places, slopes = jet[:, :3] - frame.shift, jet[:, 3:]
        across = np.hypot(places @ x, places @ y)
        way = np.column_stack([places @ x, places @ y]) / np.maximum(across, TOLERANCE)[:, None]
        return across, places @ z, way[:, 0] * (slopes @ x) + way[:, 1] * (slopes @ y)

    samples = np.linspace(v0, v1, MERIDIAN)
    own, _, _ = at(samples)
    order = np.argsort(own)
    inside = (radius >= own[order[0]] - TOLERANCE) & (radius <= own[order[-1]] + TOLERANCE)
    v = np.interp(radius, own[order], samples[order])
    for _ in range(NEWTON):
        across, _, slope = at(v)
        step = np.where(np.abs(slope) > 0, (radius - across) / np.where(slope == 0, 1, slope), 0.0)
        v = np.clip(v + step, v0, v1)
    return np.where(inside, at(v)[1], np.nan)
