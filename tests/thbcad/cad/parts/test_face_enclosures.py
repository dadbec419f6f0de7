"""Hulls of control points hold the faces that they stand for, and regions are proven free of them."""

import numpy as np
import pytest
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.BRepPrimAPI import BRepPrimAPI_MakeCone, BRepPrimAPI_MakeSphere, BRepPrimAPI_MakeTorus
from OCP.GeomAbs import GeomAbs_BSplineCurve
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt
from scipy.spatial import ConvexHull

from tests.thbcad.cad.parts.cases import LENSES, box, located, motions, rod
from tests.thbcad.cad.shapes.cases import rounded_by_occt
from thbcad.cad.exchange import edges_of, face_triangles, faces_of
from thbcad.cad.parts import faces_within
from thbcad.cad.parts.face_enclosures import edge_pieces, face_pieces, split
from thbcad.cad.shapes import lens_part
from thbcad.certified import Stack, rectangle_supports, region_between

AXES = gp_Ax2(gp_Pnt(1, 2, 3), gp_Dir(1, 2, 2))
SOLIDS = {
    "cylinder": rod(1, 2, 0.5, -3, 4),
    "cone": BRepPrimAPI_MakeCone(AXES, 2, 0.5, 3).Shape(),
    "sphere": BRepPrimAPI_MakeSphere(AXES, 2).Shape(),
    "torus": BRepPrimAPI_MakeTorus(AXES, 4, 1).Shape(),
    "moved box": located(box(1, 2, 3, 4), motions()["screw"]),
    "lens": lens_part(LENSES["upright"]).solid,
    "rounded by OCCT": rounded_by_occt(LENSES["round"], 0.3).solid,
}


@pytest.mark.parametrize("name", SOLIDS)
def test_hulls_of_the_pieces_hold_the_face(name):
    for face in faces_of(SOLIDS[name]):
        pieces = face_pieces(face)
        cells = split(pieces.roots)
        points = pieces.nets(np.repeat(cells.reshape(-1, 2, 2).mean(axis=2), 2, axis=1))[:, 0]
        for net, point in zip(pieces.nets(cells), points):
            hull = ConvexHull(net, qhull_options="QJ1e-9")
            assert (hull.equations @ np.append(point, 1)).max() < 1e-6
        # triangles of OCCT have their corners on the face
        corners = face_triangles([face], 0.2).reshape(-1, 3)
        hull = ConvexHull(np.concatenate(pieces.nets(cells)), qhull_options="QJ1e-9")
        assert (corners @ hull.equations[:, :3].T + hull.equations[:, 3]).max() < 1e-6


def test_hulls_of_the_pieces_hold_edges_of_any_degree():
    """Beside roundings OCCT makes curves of degree 14."""
    degrees = set()
    for edge in edges_of(SOLIDS["rounded by OCCT"]):
        curve = BRepAdaptor_Curve(edge)
        degrees.add(curve.Degree() if curve.GetType() == GeomAbs_BSplineCurve else 0)
        pieces = edge_pieces(edge)
        for cell, net in zip(pieces.roots, pieces.nets(pieces.roots)):
            points = np.array([curve.Value(t).Coord() for t in np.linspace(*cell, 5)])
            low, high = net.min(axis=0) - 1e-9, net.max(axis=0) + 1e-9
            assert ((low <= points) & (points <= high)).all()
    assert max(degrees) > 10


def region(half_width, low, high):
    supports = rectangle_supports(half_width)[None]
    return region_between(*(Stack(np.array([z]), supports) for z in (low, high)))


@pytest.mark.parametrize(("gap", "free"), [(1e-6, True), (-1e-6, False)])
def test_a_gap_of_a_nanometre_tells_faces_apart(gap, free):
    solid = rod(3.0 + gap, 0, 1.0, -50, 50)  # beside x <= 2
    found = faces_within(solid, region((2.0, 2.0), -1.0, 1.0))
    assert (not found) == free


def test_a_hole_in_a_face_lets_light_through():
    plate = box(5, 5, 0, 1)
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut

    holed = BRepAlgoAPI_Cut(plate, rod(0, 0, 2.0, -5, 5)).Shape()
    assert not faces_within(holed, region((1.4, 1.4), -1.0, 2.0))  # corners at 1.98
    assert faces_within(holed, region((1.42, 1.42), -1.0, 2.0))  # at 2.008
    assert len(faces_within(plate, region((1.4, 1.4), -1.0, 2.0))) == 2
