"""How far optical faces and their edges are from what they should be, as OCCT evaluates them."""

from __future__ import annotations

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.Geom import Geom_BSplineSurface, Geom_Line, Geom_Plane, Geom_Surface
from OCP.GeomAPI import GeomAPI_IntCS, GeomAPI_ProjectPointOnSurf
from OCP.gp import gp_Dir, gp_Lin, gp_Pnt, gp_Vec
from OCP.TopAbs import TopAbs_REVERSED
from OCP.TopoDS import TopoDS_Face

from thbcad.cad.exchange import edges_of
from thbcad.cad.parts.part_topology import ON_EDGE
from thbcad.checks import Floats
from thbcad.lens import FreeformSurface
from thbcad.splines import gauss_rule

PER_SPAN = 3  # points of a spline in every span and direction; its numbers are compared too
NODES = 8  # of Gauss, on each piece of an edge
ELSEWHERE = 33  # points of another surface in each direction


def face_deviation(geometry: Geom_Surface, surface: FreeformSurface, vertex: float) -> float:
    """Return the greatest |z_face(x, y) - z_surface(x, y)| in mm within the rectangle of a lens surface.

    geometry : Geom_Surface in the lens's frame.  surface : FreeformSurface at z = vertex.
    """
    if isinstance(geometry, Geom_BSplineSurface):
        points = _spline_points(geometry)
    else:
        points = _points_over(geometry, surface)
    (x, y), half = points[:, :2].T, surface.half_width
    inside = np.logical_and(*(np.abs(a) <= h * (1 + 1e-12) for a, h in zip((x, y), half)))
    if not inside.any():
        return np.inf
    return float(np.abs(points[inside, 2] - vertex - surface(x[inside], y[inside])).max())


def _spline_points(geometry: Geom_BSplineSurface) -> Floats:
    spans = [
        [knot(k) for k in range(1, count + 1)]
        for knot, count in ((geometry.UKnot, geometry.NbUKnots()), (geometry.VKnot, geometry.NbVKnots()))
    ]
    fractions = np.arange(PER_SPAN) / PER_SPAN
    u, v = (
        np.append((np.array(b[:-1])[:, None] + np.diff(b)[:, None] * fractions).ravel(), b[-1]) for b in spans
    )
    return np.array([geometry.Value(a, b).Coord() for a in u.tolist() for b in v.tolist()])


def _points_over(geometry: Geom_Surface, surface: FreeformSurface) -> Floats:
    """Return the points of a surface over a grid of the rectangle of a lens surface, nearest to z = 0."""
    found = []
    x, y = (np.linspace(-h, h, ELSEWHERE).tolist() for h in surface.half_width)
    for a in x:
        for b in y:
            meeting = GeomAPI_IntCS(Geom_Line(gp_Lin(gp_Pnt(a, b, 0.0), gp_Dir(0, 0, 1))), geometry)
            points = [meeting.Point(k).Coord() for k in range(1, meeting.NbPoints() + 1)]
            found.append(min(points, key=lambda p: abs(p[2]), default=(a, b, np.inf)))
    return np.array(found)


def edge_deviation(face: TopoDS_Face) -> float:
    """Return the greatest distance of the edges of a face from their images on its surface, mm.

    Edges of a plane without images count by their distance from the plane.
    """
    surface = BRep_Tool.Surface_s(face)
    greatest = 0.0
    for edge in edges_of(face):
        curve = BRepAdaptor_Curve(edge)
        plane = isinstance(surface, Geom_Plane)
        image = None if plane else BRep_Tool.CurveOnSurface_s(edge, face, 0.0, 0.0)
        for t in np.linspace(curve.FirstParameter(), curve.LastParameter(), ON_EDGE).tolist():
            point = curve.Value(t)
            if image is None:
                off = GeomAPI_ProjectPointOnSurf(point, surface).LowerDistance()
            else:
                at = image.Value(t)
                off = point.Distance(surface.Value(at.X(), at.Y()))
            greatest = max(greatest, off)
    return greatest


def projected_area(face: TopoDS_Face) -> float:
    """Return the area under a face in x and y, the integral of x dy along its edges, mm^2.

    Of an arc, the eight nodes of Gauss on each of 32 pieces leave rounding errors.
    """
    area = 0.0
    for edge in edges_of(face):
        curve = BRepAdaptor_Curve(edge)
        t, weights = gauss_rule(np.linspace(curve.FirstParameter(), curve.LastParameter(), ON_EDGE), NODES)
        point, slope = gp_Pnt(), gp_Vec()
        rows = []
        for place in t.tolist():
            curve.D1(place, point, slope)
            rows.append(point.X() * slope.Y())
        along = -1.0 if edge.Orientation() == TopAbs_REVERSED else 1.0
        area += along * float(weights @ rows)
    return abs(area)
