"""Vertices, edges and faces of solids, made once and shared, so that shells are closed by construction, and
the solid whose faces have names, as CAD files show them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.Geom import Geom_Conic, Geom_Curve, Geom_Line, Geom_Plane, Geom_Surface
from OCP.Geom2d import Geom2d_Curve, Geom2d_Line
from OCP.gp import gp_Dir, gp_Dir2d, gp_Pln, gp_Pnt, gp_Pnt2d
from OCP.TopAbs import TopAbs_REVERSED
from OCP.TopoDS import (
    TopoDS_Edge,
    TopoDS_Face,
    TopoDS_Shape,
    TopoDS_Shell,
    TopoDS_Solid,
    TopoDS_Vertex,
    TopoDS_Wire,
)

from thbcad.cad.occt_names import as_edge, as_face
from thbcad.cad.shapes.occt_splines import TOLERANCE, geom_curve, geom_surface, trace
from thbcad.checks import Floats
from thbcad.lens import SIDES, Side, rim_parameter
from thbcad.outlines import fitted_curve
from thbcad.splines import UNIT, BSplineSurface

BUILDER = BRep_Builder()  # it has no state
NAMES = ("front", "rear", *(side.name for side in SIDES))


@dataclass(frozen=True, eq=False)
class Part:
    """A solid and its faces in the order in which they were added.

    solid : TopoDS_Solid, mm
    names : of the faces; the first word says what a face is: front, rear, edge or flange
    faces : TopoDS_Face, as they lie in the solid (orientation included)
    """

    solid: TopoDS_Solid
    names: Sequence[str]
    faces: Sequence[TopoDS_Face]


def closed_part(names: Sequence[str], faces: Sequence[TopoDS_Face]) -> Part:
    """Return the solid between faces that share their edges and whose normals point outward."""
    shell = TopoDS_Shell()
    solid = TopoDS_Solid()
    BUILDER.MakeShell(shell)
    for face in faces:
        BUILDER.Add(shell, face)
    shell.Closed(True)
    BUILDER.MakeSolid(solid)
    BUILDER.Add(solid, shell)
    return Part(solid, tuple(names), tuple(faces))


def new_vertex(point: Floats) -> TopoDS_Vertex:
    """Return a vertex at a point, (3,) float, mm."""
    vertex = TopoDS_Vertex()
    BUILDER.MakeVertex(vertex, gp_Pnt(*point.tolist()), TOLERANCE)
    return vertex


def new_edge(
    curve: Geom_Curve,
    first: float,
    last: float,
    start: TopoDS_Vertex,
    stop: TopoDS_Vertex,
) -> TopoDS_Edge:
    """Return the piece [first, last] of a curve between two vertices as an edge."""
    edge = TopoDS_Edge()
    BUILDER.MakeEdge(edge, curve, TOLERANCE)
    BUILDER.Add(edge, start)
    stop = stop.Oriented(TopAbs_REVERSED)
    BUILDER.Add(edge, stop)
    BUILDER.Range(edge, first, last)
    return edge


def strut(ends: Sequence[Floats], vertices: Sequence[TopoDS_Vertex], straight: bool) -> TopoDS_Edge:
    """Return the edge from a front corner to the rear corner.

    ends : their points, (3,) float, mm.  straight : as a line, else as a spline of degree 1 over [0, 1]
    """
    if straight:
        step = ends[1] - ends[0]
        length = float(np.linalg.norm(step))
        curve = Geom_Line(gp_Pnt(*ends[0].tolist()), gp_Dir(*step.tolist()))
    else:
        length = 1.0
        curve = geom_curve(UNIT, np.stack(ends))
    return new_edge(curve, 0.0, length, *vertices)


def side_line(surface: BSplineSurface, side: Side) -> Geom2d_Line:
    """Return the parameter-space line of a side of a tensor-product face."""
    fixed = rim_parameter(surface, side)
    if side.axis == 0:
        return Geom2d_Line(gp_Pnt2d(0.0, fixed), gp_Dir2d(1, 0))
    return Geom2d_Line(gp_Pnt2d(fixed, 0.0), gp_Dir2d(0, 1))


def turned(edge: TopoDS_Edge, reverse: bool) -> TopoDS_Shape:
    """Return the edge, reversed or not."""
    return edge.Reversed() if reverse else edge


def turned_face(face: TopoDS_Face, reverse: bool) -> TopoDS_Face:
    """Return the face, reversed or not."""
    return as_face(face.Reversed()) if reverse else face


def new_wire(edges: Sequence[TopoDS_Shape]) -> TopoDS_Wire:
    """Return the closed wire of edges that follow each other head to tail."""
    wire = TopoDS_Wire()
    BUILDER.MakeWire(wire)
    for edge in edges:
        BUILDER.Add(wire, edge)
    wire.Closed(True)
    return wire


def face_on(
    surface: Geom_Surface,
    loop: Sequence[TopoDS_Shape],
    upward: bool = True,
    images: Iterable[Geom2d_Curve | None] = (),
) -> TopoDS_Face:
    """Return the face of a surface within a loop of edges that runs counter-clockwise around its normal.

    upward : False where it runs clockwise
    images : of the edges in the parameters of the surface, None where OCCT needs none
    """
    face = TopoDS_Face()
    wire = new_wire(loop)
    BUILDER.MakeFace(face, surface, TOLERANCE)
    BUILDER.Add(face, wire if upward else wire.Reversed())
    draw_on_plane(face, loop)
    for edge, image in zip(loop, images):
        if image is not None:
            BUILDER.UpdateEdge(as_edge(edge), image, face, TOLERANCE)
    return face


def draw_on_plane(face: TopoDS_Face, edges: Sequence[TopoDS_Shape]) -> None:
    """Give circles, ellipses and hyperbolas among the edges of a plane face their images in its parameters.

    OCCT needs none, but writes its own into STEP files: closed rational splines of another parameter.  These
    have that of the edge, within 1e-9 mm at eight points of every span.
    """
    surface = BRep_Tool.Surface_s(face)
    if not isinstance(surface, Geom_Plane):
        return
    position = surface.Position()
    origin = np.array(position.Location().Coord())
    axes = np.array([position.XDirection().Coord(), position.YDirection().Coord()])
    for edge in map(as_edge, edges):
        if isinstance(BRep_Tool.Curve_s(edge, 0.0, 0.0), Geom_Conic):
            curve = BRepAdaptor_Curve(edge)
            ends = np.array([curve.FirstParameter(), curve.LastParameter()])

            def image(t: Floats, value: Callable[[float], gp_Pnt] = curve.Value) -> Floats:
                return (np.array([value(a).Coord() for a in t.tolist()]) - origin) @ axes.T

            drawn = trace(*fitted_curve(image, ends, np.ones(2, dtype=np.int64)))
            BUILDER.UpdateEdge(edge, drawn, face, TOLERANCE)


def plane_edge_face(corner: Floats, side: Side, chains: Sequence[Sequence[TopoDS_Shape]]) -> TopoDS_Face:
    """Return the plane between the rims of a lens whose front and rear have one size, its normal outward.

    corner : of the front, at the start of the side, (3,) float, mm
    chains : the edges along the front rim, the strut at its end, the rear rim (reversed) and the strut at its
        start (reversed).
    """
    normal = gp_Dir(0, -1, 0) if side.axis == 0 else gp_Dir(1, 0, 0)
    plane = Geom_Plane(gp_Pln(gp_Pnt(*corner.tolist()), normal))
    return turned_face(face_on(plane, list(chain.from_iterable(chains))), side.clockwise)


def ruled_edge_face(
    ruled: BSplineSurface,
    side: Side,
    chains: Sequence[Sequence[TopoDS_Shape]],
    rims: Sequence[Geom2d_Curve | None] = (None, None),
) -> TopoDS_Face:
    """Return the ruled face between two rims, its second parameter from front to rear; the rest is as of
    `plane_edge_face`.

    ruled : as `ruled_edge`
    rims : the images of front and rear rim in its parameters; None where they have the parameter of `ruled`
    """
    across, along = gp_Dir2d(0, 1), gp_Dir2d(1, 0)
    images = [
        rims[0] or Geom2d_Line(gp_Pnt2d(0, 0), along),
        Geom2d_Line(gp_Pnt2d(ruled.kv_u.stop, 0), across),
        rims[1] or Geom2d_Line(gp_Pnt2d(0, 1), along),
        Geom2d_Line(gp_Pnt2d(ruled.kv_u.start, 0), across),
    ]
    of_edges = [image for edges, image in zip(chains, images) for _ in edges]
    face = face_on(geom_surface(ruled), list(chain.from_iterable(chains)), True, of_edges)
    return turned_face(face, side.clockwise)
