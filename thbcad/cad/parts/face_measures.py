"""What of a part belongs to the lens in it, where its optical faces end, and how far these and their edges
are from what they should be, as OCCT evaluates them.
"""

from collections.abc import Sequence

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.BRepTools import BRepTools
from OCP.Geom import Geom_BSplineSurface, Geom_Line, Geom_Plane, Geom_Surface
from OCP.GeomAbs import GeomAbs_Line
from OCP.GeomAPI import GeomAPI_IntCS, GeomAPI_ProjectPointOnSurf
from OCP.gp import gp_Dir, gp_Lin, gp_Pnt, gp_Vec
from OCP.TopAbs import TopAbs_REVERSED, TopAbs_WIRE
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Shape

from thbcad.cad.exchange import edges_of, explore
from thbcad.cad.occt_names import ShapeNumbers
from thbcad.cad.parts.faces_in_regions import on_face, real_edges
from thbcad.cad.parts.numbers_of_surfaces import surface_numbers
from thbcad.cad.parts.search import APART, OPTICAL
from thbcad.cad.shapes import lens_part
from thbcad.checks import Floats
from thbcad.lens import FreeformSurface, Lens
from thbcad.splines import gauss_rule

ON_EDGE = 33  # points of an edge that show whether a face lies within another
OF_CURVE = 512  # segments of a curved edge
PER_SPAN = 3  # points of a spline in every span and direction; its numbers are compared too
NODES = 8  # of Gauss, on each piece of an edge
ELSEWHERE = 33  # points of another surface in each direction


def own_edges(faces: Sequence[TopoDS_Face], lens: Lens) -> frozenset[int]:
    """Return which faces of a part in the frame of its lens, by number, are edges of the lens or pieces of
    them: their surfaces are the same, and 33 points of each of their edges lie in the lens's face."""
    part = lens_part(lens)
    edges = [face for name, face in zip(part.names, part.faces) if name not in OPTICAL]
    own = [(face, surface_numbers(BRep_Tool.Surface_s(face))) for face in edges]
    found = set()
    for number, face in enumerate(faces):
        numbers = surface_numbers(BRep_Tool.Surface_s(face))
        for edge_face, wanted in own:
            points = np.concatenate([edge_points(edge, ON_EDGE) for edge in real_edges(face)])
            if numbers.same_points(wanted, APART) and on_face(edge_face, points).all():
                found.add(number)
    return frozenset(found)


def rim_faces(faces: Sequence[TopoDS_Face], optical: Sequence[int]) -> frozenset[int]:
    """Return the faces of a part, by number, that have an edge in common with an outer wire of the optical
    ones."""
    rim = ShapeNumbers()
    for number in optical:
        for edge in edges_of(BRepTools.OuterWire_s(faces[number])):
            rim.Add(edge)
    return frozenset(number for number, face in enumerate(faces) if any(map(rim.Contains, edges_of(face))))


def inner_wires(face: TopoDS_Face) -> list[TopoDS_Shape]:
    """Return the wires of a face within its outer one."""
    outer = BRepTools.OuterWire_s(face)
    return [wire for wire in explore(face, TopAbs_WIRE) if not wire.IsSame(outer)]


def outline_segments(face: TopoDS_Face) -> Floats:
    """Return the edges of a face in x and y as segments, (n, 2, 2), mm; curves are 512 of them."""
    rows = []
    for edge in real_edges(face):
        straight = BRepAdaptor_Curve(edge).GetType() == GeomAbs_Line
        points = edge_points(edge, 2 if straight else OF_CURVE + 1)[:, :2]
        rows.append(np.stack([points[:-1], points[1:]], axis=1))
    return np.concatenate(rows)


def edge_points(edge: TopoDS_Edge, count: int) -> Floats:
    """Return points of an edge at equal steps of its parameter, both ends included, (count, 3), mm."""
    curve = BRepAdaptor_Curve(edge)
    steps = np.linspace(curve.FirstParameter(), curve.LastParameter(), count)
    return np.array([curve.Value(t).Coord() for t in steps.tolist()])


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
    spans = [np.array([*knots]) for knots in (geometry.UKnots(), geometry.VKnots())]
    fractions = np.arange(PER_SPAN) / PER_SPAN
    u, v = (np.append((b[:-1, None] + np.diff(b)[:, None] * fractions).ravel(), b[-1]) for b in spans)
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
