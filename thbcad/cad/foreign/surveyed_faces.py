"""The faces of a solid that another program wrote: kind, samples, area, heights along the axis, and which
continue each other.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve, BRepAdaptor_Surface
from OCP.BRepClass import BRepClass_FaceClassifier
from OCP.BRepGProp import BRepGProp
from OCP.BRepTools import BRepTools
from OCP.Geom import Geom_BSplineSurface, Geom_RectangularTrimmedSurface
from OCP.GeomAbs import (
    GeomAbs_BezierSurface,
    GeomAbs_BSplineSurface,
    GeomAbs_Cone,
    GeomAbs_Cylinder,
    GeomAbs_Plane,
    GeomAbs_Sphere,
    GeomAbs_SurfaceOfExtrusion,
    GeomAbs_SurfaceOfRevolution,
    GeomAbs_Torus,
)
from OCP.GeomConvert import GeomConvert
from OCP.gp import gp_Dir, gp_Lin, gp_Pnt, gp_Pnt2d
from OCP.GProp import GProp_GProps
from OCP.IntCurvesFace import IntCurvesFace_Intersector
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_IN
from OCP.TopExp import TopExp
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Shape
from OCP.TopTools import TopTools_IndexedDataMapOfShapeListOfShape
from scipy.optimize import minimize_scalar

from thbcad.cad.exchange import edges_of, faces_of, point_and_normal
from thbcad.cad.shapes import spline_surface
from thbcad.checks import MAX_DEGREE, Floats
from thbcad.poses import Pose
from thbcad.splines import BSplineSurface, NURBSSurface

KINDS = {
    GeomAbs_Plane: "plane",
    GeomAbs_Cylinder: "cylinder",
    GeomAbs_Cone: "cone",
    GeomAbs_Sphere: "sphere",
    GeomAbs_Torus: "torus",
    GeomAbs_BezierSurface: "spline",
    GeomAbs_BSplineSurface: "spline",
    GeomAbs_SurfaceOfRevolution: "surface of revolution",
    GeomAbs_SurfaceOfExtrusion: "extrusion",
}
STRAIGHT = ("plane", "cylinder", "cone", "extrusion")  # kinds with straight lines
FLAT = 1e-9  # between unit normals: of a plane that was written as something else
GRID = 7  # samples along each parameter of a face
RIM = 33  # samples of an edge
STEP = 1e-6  # of two samples' distance: a greatest value errs by its square
SMOOTH = 1e-3  # rad between normals on a common edge: one surface that was split
TOLERANCE = 1e-6  # mm: rays through the rim count
FARTHEST = 1e6  # mm along a line


@dataclass(frozen=True, eq=False)
class SurveyedFace:
    """A face, its number in the solid, and what its surface is.

    kind : "plane", "sphere", "spline", ... or "other".
    """

    face: TopoDS_Face
    number: int
    kind: str

    @cached_property
    def _geometry(self) -> Geom_BSplineSurface | None:
        """OCCT's surface of a spline face."""
        if self.kind != "spline":
            return None
        surface = BRep_Tool.Surface_s(self.face)
        if not isinstance(surface, Geom_BSplineSurface):  # a Bezier surface
            surface = GeomConvert.SurfaceToBSplineSurface_s(surface)
        return surface

    @cached_property
    def spline(self) -> BSplineSurface | NURBSSurface | None:
        """The spline under the face with the numbers of the file, of a spline face; None of the high degrees
        that OCCT gives chamfers."""
        surface = self._geometry
        if surface is None or max(surface.UDegree(), surface.VDegree()) > MAX_DEGREE:
            return None
        return spline_surface(surface)

    @cached_property
    def exact_spline(self) -> BSplineSurface | NURBSSurface | None:
        """The spline under the face; of a surface of revolution a rational one with the same points; None of
        a degree above 10."""
        if self.kind != "surface of revolution":
            return self.spline
        trimmed = Geom_RectangularTrimmedSurface(
            BRep_Tool.Surface_s(self.face), *BRepTools.UVBounds_s(self.face)
        )
        surface = GeomConvert.SurfaceToBSplineSurface_s(trimmed)
        return spline_surface(surface) if max(surface.UDegree(), surface.VDegree()) <= MAX_DEGREE else None

    @cached_property
    def area(self) -> float:
        """mm^2."""
        properties = GProp_GProps()
        BRepGProp.SurfaceProperties_s(self.face, properties)
        return properties.Mass()

    @cached_property
    def samples(self) -> tuple[Floats, Floats]:
        """Points inside the face and outward unit normals there, (n, 3) each, n at least 1."""
        u0, u1, v0, v1 = BRepTools.UVBounds_s(self.face)
        steps = (np.arange(GRID) + 0.5) / GRID
        pairs = [(u, v) for u in u0 + (u1 - u0) * steps for v in v0 + (v1 - v0) * steps]
        states = [BRepClass_FaceClassifier(self.face, gp_Pnt2d(*pair), 1e-9).State() for pair in pairs]
        inside = [pair for pair, state in zip(pairs, states) if state == TopAbs_IN] or pairs
        jets = np.array([_point_and_normal(self.face, *pair) for pair in inside])
        return jets[:, 0], jets[:, 1]

    @cached_property
    def is_ruled(self) -> bool:
        """Whether its surface consists of straight lines, by its kind or its degree."""
        surface = self._geometry
        return self.kind in STRAIGHT or (
            surface is not None and min(surface.UDegree(), surface.VDegree()) == 1
        )

    @cached_property
    def radius(self) -> float | None:
        """mm, of a sphere or a cylinder, else None."""
        adaptor = BRepAdaptor_Surface(self.face)
        if self.kind == "sphere":
            return adaptor.Sphere().Radius()
        return adaptor.Cylinder().Radius() if self.kind == "cylinder" else None

    @cached_property
    def centre(self) -> Floats | None:
        """(3,) mm, of a sphere, else None."""
        if self.kind != "sphere":
            return None
        return np.array(BRepAdaptor_Surface(self.face).Sphere().Location().Coord())

    @property
    def periodic(self) -> tuple[bool, bool]:
        """Whether its surface is periodic in u, in v."""
        surface = BRep_Tool.Surface_s(self.face)
        return bool(surface.IsUPeriodic()), bool(surface.IsVPeriodic())

    @cached_property
    def is_flat(self) -> bool:
        """Whether it is plane, of whatever kind its surface is."""
        normals = self.samples[1]
        return self.kind == "plane" or bool(np.abs(normals - normals[0]).max() < FLAT)

    @cached_property
    def direction(self) -> Floats | None:
        """The normal of a flat face; the axis of a cylinder, cone, torus or surface of revolution; the
        direction of an extrusion; else None."""
        if self.kind != "plane" and self.is_flat:
            return self.samples[1][0]
        adaptor = BRepAdaptor_Surface(self.face)
        if self.kind in ("plane", "cylinder", "cone", "torus"):
            return np.array(getattr(adaptor, self.kind.capitalize())().Axis().Direction().Coord())
        if self.kind == "surface of revolution":
            return np.array(adaptor.AxeOfRevolution().Direction().Coord())
        return np.array(adaptor.Direction().Coord()) if self.kind == "extrusion" else None

    @property
    def rim(self) -> Floats:
        """Points of its edges, both ends included, (n, 3); seams lie within the face and are left out."""
        return np.concatenate([np.empty((0, 3)), *(points for _, _, points in self._edges)])

    def reach(self, direction: Floats) -> float:
        """Return the greatest d . p over the points p of its edges, mm; seams are left out."""
        farthest = -np.inf
        for curve, t, points in self._edges:
            along = points @ direction
            best = int(np.argmax(along))
            # a closed edge goes on at its other end
            for near in {best} if 0 < best < RIM - 1 else {0, RIM - 1}:
                ends = t[[max(near - 1, 0), min(near + 1, RIM - 1)]]
                between = minimize_scalar(
                    lambda at, curve=curve: -float(direction @ curve.Value(float(at)).Coord()),
                    bounds=ends,
                    method="bounded",
                    options={"xatol": STEP * (ends[1] - ends[0])},
                )
                farthest = max(farthest, float(along[near]), -float(between.fun))
        return farthest

    @cached_property
    def _edges(self) -> list[tuple[BRepAdaptor_Curve, Floats, Floats]]:
        """The curves of its edges, with parameters from end to end (n,) and the points there (n, 3)."""
        found = []
        for edge in edges_of(self.face):
            if BRep_Tool.Degenerated_s(edge) or BRep_Tool.IsClosed_s(edge, self.face):
                continue
            curve = BRepAdaptor_Curve(edge)
            t = np.linspace(curve.FirstParameter(), curve.LastParameter(), RIM)
            found.append((curve, t, np.array([curve.Value(each).Coord() for each in t.tolist()])))
        return found


def surveyed(solid: TopoDS_Shape) -> list[SurveyedFace]:
    """Return the faces of a solid in the order of OCCT."""
    faces = faces_of(solid)
    kinds = [KINDS.get(BRepAdaptor_Surface(face).GetType(), "other") for face in faces]
    return [SurveyedFace(face, k, kind) for k, (face, kind) in enumerate(zip(faces, kinds))]


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
                if shared and _is_smooth(edge, own.face, other.face):
                    found.add(other.number)
                    waiting.append(other)
    return [face for face in faces if face.number in found]


def _point_and_normal(face: TopoDS_Face, u: float, v: float) -> tuple[Floats, Floats]:
    point, normal = point_and_normal(face, u, v)
    return point, normal / (float(np.linalg.norm(normal)) or 1.0)


def _is_smooth(edge: TopoDS_Edge, first: TopoDS_Face, second: TopoDS_Face) -> bool:
    """Return whether two faces have one normal in the middle of their common edge."""
    normals = []
    for face in (first, second):
        curve = BRep_Tool.CurveOnSurface_s(edge, face, 0.0, 0.0)
        low, high = BRep_Tool.Range_s(edge, face)
        normals.append(_point_and_normal(face, *curve.Value((low + high) / 2).Coord())[1])
    return float(np.linalg.norm(normals[0] - normals[1])) < SMOOTH


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
