"""Faces of solids within loops of edges: front, rear and the edges between their rims."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from itertools import chain

import numpy as np
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.Geom import Geom_Conic, Geom_Plane, Geom_Surface
from OCP.Geom2d import Geom2d_Curve, Geom2d_Line
from OCP.gp import gp_Dir, gp_Dir2d, gp_Pln, gp_Pnt, gp_Pnt2d
from OCP.TopoDS import TopoDS, TopoDS_Face, TopoDS_Shape

from thbcad.cad.shapes.occt_splines import TOLERANCE, geom_surface, trace
from thbcad.cad.shapes.topology import new_wire, turned_face
from thbcad.checks import Floats
from thbcad.lens import Side, Surfaces, ruled_edge
from thbcad.outlines import fitted_curve
from thbcad.splines import BSplineSurface


def face_on(
    builder: BRep_Builder,
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
    wire = new_wire(builder, loop)
    builder.MakeFace(face, surface, TOLERANCE)
    builder.Add(face, wire if upward else wire.Reversed())
    draw_on_plane(builder, face, loop)
    for edge, image in zip(loop, images):
        if image is not None:
            builder.UpdateEdge(TopoDS.Edge_s(edge), image, face, TOLERANCE)
    return face


def draw_on_plane(builder: BRep_Builder, face: TopoDS_Face, edges: Sequence[TopoDS_Shape]) -> None:
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
    for edge in map(TopoDS.Edge_s, edges):
        if isinstance(BRep_Tool.Curve_s(edge, 0.0, 0.0), Geom_Conic):
            curve = BRepAdaptor_Curve(edge)
            ends = np.array([curve.FirstParameter(), curve.LastParameter()])

            def image(t: Floats, value: Callable[[float], gp_Pnt] = curve.Value) -> Floats:
                return (np.array([value(a).Coord() for a in t.tolist()]) - origin) @ axes.T

            drawn = trace(*fitted_curve(image, ends, np.ones(2, dtype=np.int64)))
            builder.UpdateEdge(edge, drawn, face, TOLERANCE)


def edge_face(
    builder: BRep_Builder,
    surfaces: Surfaces,
    side: Side,
    chains: Sequence[Sequence[TopoDS_Shape]],
    planar: bool,
) -> TopoDS_Face:
    """Return the edge face of a side, its normal outward: a plane, or a ruled face.

    chains : the edges along the front rim, the strut at its end, the rear rim (reversed) and the strut at its
        start (reversed).
    """
    if planar:
        return plane_edge_face(builder, surfaces[0].coefficients[side.start], side, chains)
    return ruled_edge_face(builder, ruled_edge(surfaces, side), side, chains)


def plane_edge_face(
    builder: BRep_Builder, corner: Floats, side: Side, chains: Sequence[Sequence[TopoDS_Shape]]
) -> TopoDS_Face:
    """Return the plane between the rims of a lens whose front and rear have the same size, as `edge_face`.

    corner : of the front, at the start of the side, (3,) float, mm
    """
    normal = gp_Dir(0, -1, 0) if side.axis == 0 else gp_Dir(1, 0, 0)
    plane = Geom_Plane(gp_Pln(gp_Pnt(*corner.tolist()), normal))
    return turned_face(face_on(builder, plane, list(chain.from_iterable(chains))), side.clockwise)


def ruled_edge_face(
    builder: BRep_Builder,
    ruled: BSplineSurface,
    side: Side,
    chains: Sequence[Sequence[TopoDS_Shape]],
    rims: Sequence[Geom2d_Curve | None] = (None, None),
) -> TopoDS_Face:
    """Return the ruled face between two rims, as `edge_face`; its second parameter runs from front to rear.

    ruled : as `ruled_edge`
    rims : the images of front and rear rim in its parameters; None where they have the parameter of `ruled`
    """
    face = face_on(builder, geom_surface(ruled), list(chain.from_iterable(chains)))
    across, along = gp_Dir2d(0, 1), gp_Dir2d(1, 0)
    images = [
        rims[0] or Geom2d_Line(gp_Pnt2d(0, 0), along),
        Geom2d_Line(gp_Pnt2d(ruled.kv_u.stop, 0), across),
        rims[1] or Geom2d_Line(gp_Pnt2d(0, 1), along),
        Geom2d_Line(gp_Pnt2d(ruled.kv_u.start, 0), across),
    ]
    for edges, image in zip(chains, images):
        for edge in edges:
            builder.UpdateEdge(TopoDS.Edge_s(edge), image, face, TOLERANCE)
    return turned_face(face, side.clockwise)
