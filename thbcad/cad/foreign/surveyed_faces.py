"""The faces of a solid that another program wrote: kind, surface, samples, area and edges."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

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
from OCP.gp import gp_Pnt2d
from OCP.GProp import GProp_GProps
from OCP.TopAbs import TopAbs_IN
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Shape

from thbcad.cad.exchange import edges_of, faces_of, point_and_normal
from thbcad.cad.shapes import spline_surface
from thbcad.checks import MAX_DEGREE, Floats
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


class FaceEdge(NamedTuple):
    """An edge of a face: its curve, parameters from end to end (n,), and the points there (n, 3), mm."""

    edge: TopoDS_Edge
    curve: BRepAdaptor_Curve
    parameters: Floats
    points: Floats


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

    @cached_property
    def axis_point(self) -> Floats | None:
        """(3,) mm, a point of the axis of a surface of revolution, else None."""
        if self.kind != "surface of revolution":
            return None
        return np.array(BRepAdaptor_Surface(self.face).AxeOfRevolution().Location().Coord())

    @cached_property
    def edges(self) -> list[FaceEdge]:
        """Its edges; seams, which bound it on both sides, lie within the face and are left out."""
        edges, found = edges_of(self.face), []
        for edge in edges:
            if BRep_Tool.Degenerated_s(edge) or sum(edge.IsSame(other) for other in edges) > 1:
                continue
            curve = BRepAdaptor_Curve(edge)
            t = np.linspace(curve.FirstParameter(), curve.LastParameter(), RIM)
            points = np.array([curve.Value(each).Coord() for each in t.tolist()])
            found.append(FaceEdge(edge, curve, t, points))
        return found


def surveyed(solid: TopoDS_Shape) -> list[SurveyedFace]:
    """Return the faces of a solid in the order of OCCT."""
    faces = faces_of(solid)
    kinds = [KINDS.get(BRepAdaptor_Surface(face).GetType(), "other") for face in faces]
    return [SurveyedFace(face, k, kind) for k, (face, kind) in enumerate(zip(faces, kinds))]


def _point_and_normal(face: TopoDS_Face, u: float, v: float) -> tuple[Floats, Floats]:
    point, normal = point_and_normal(face, u, v)
    return point, normal / (float(np.linalg.norm(normal)) or 1.0)
