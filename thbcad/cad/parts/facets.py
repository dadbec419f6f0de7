"""Closed triangle meshes of parts by OCCT's mesher, with a chord error that is measured.

The mesher misses its own deflection many times over on splines: it is asked for less until the limit is kept.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.BRepTools import BRepTools
from OCP.Geom import Geom_BSplineSurface
from OCP.TopAbs import TopAbs_REVERSED
from OCP.TopLoc import TopLoc_Location

from thbcad.cad.shapes import spline_surface
from thbcad.checks import Floats, Integers, require_number
from thbcad.lens import Tessellation

if TYPE_CHECKING:
    from OCP.Geom import Geom_Surface
    from OCP.TopoDS import TopoDS_Face

    from thbcad.cad.shapes import Part

LEAST_CHORD = 1e-5  # mm; finer meshes of whole parts have no use for printers, and take minutes
ANGLE = 0.2  # radians between neighbouring facets of holes and pins: 32 round a circle
ROUNDS = 8  # of meshing, each at half the deflection or less
SAME = 9  # decimals of mm within which nodes of neighbouring faces are one
WEIGHTS = np.array([[1, 1, 1], [3, 3, 0], [0, 3, 3], [3, 0, 3]]) / np.array([[3], [6], [6], [6]])


class _Facets(NamedTuple):
    """The facets of a face: nodes (n, 3), their parameters (n, 2), triangles (t, 3)."""

    nodes: Floats
    parameters: Floats
    triangles: Integers


def part_mesh(part: Part, chord: float, single: bool = False) -> Tessellation:
    """Return a closed mesh of a part; its facets lie within `chord` of its faces, mm, as measured.

    The distance is measured at the centroid and at the middles of the sides of every triangle, against the
    points of the face at the same parameters.  `faces` of the mesh are the numbers of the part's faces.

    single : round the vertices to float32.

    Raises
    ------
    ValueError : a chord below 1e-5 mm, or one that OCCT's mesher does not reach.
    """
    require_number("chord", chord, least=LEAST_CHORD, finite=True)
    deflection = chord / 4
    for _ in range(ROUNDS):
        BRepTools.Clean_s(part.solid)
        BRepMesh_IncrementalMesh(part.solid, deflection, False, ANGLE, False)
        facets = [_facets(face) for face in part.faces]
        error = max(_chord_error(face, own) for face, own in zip(part.faces, facets))
        if single:
            error += _rounding(facets)
        if error <= chord:
            return _closed(
                facets, [face.Orientation() == TopAbs_REVERSED for face in part.faces], error, single
            )
        deflection *= min(0.5, 0.7 * chord / error)
    raise ValueError(f"OCCT's mesher reaches {error:.3g} mm, not a chord error of {chord:g} mm; allow more")


def _facets(face: TopoDS_Face) -> _Facets:
    mesh = BRep_Tool.Triangulation_s(face, TopLoc_Location())
    if mesh is None:
        raise ValueError("OCCT's mesher leaves a face without facets; allow another chord error")
    numbers = range(1, mesh.NbNodes() + 1)
    nodes = np.array([mesh.Node(k).Coord() for k in numbers])
    parameters = np.array([mesh.UVNode(k).Coord() for k in numbers])
    triangles = np.array([mesh.Triangle(k).Get() for k in range(1, mesh.NbTriangles() + 1)]) - 1
    return _Facets(nodes, parameters, triangles)


def _chord_error(face: TopoDS_Face, facets: _Facets) -> float:
    """Return the greatest distance of facets from the points of the face at the same parameters, mm."""
    flat = np.einsum("pk,tkd->tpd", WEIGHTS, facets.nodes[facets.triangles]).reshape(-1, 3)
    at = np.einsum("pk,tkd->tpd", WEIGHTS, facets.parameters[facets.triangles]).reshape(-1, 2)
    return float(np.linalg.norm(flat - _points(BRep_Tool.Surface_s(face), at), axis=1).max())


def _points(surface: Geom_Surface, parameters: Floats) -> Floats:
    """Return the points of a surface at parameters (n, 2), (n, 3)."""
    if isinstance(surface, Geom_BSplineSurface) and not (surface.IsUPeriodic() or surface.IsVPeriodic()):
        spline = spline_surface(surface)
        u, v = (np.clip(a, kv.start, kv.stop) for a, kv in zip(parameters.T, (spline.kv_u, spline.kv_v)))
        return spline(u, v)
    return np.array([surface.Value(u, v).Coord() for u, v in parameters.tolist()])


def _rounding(facets: list[_Facets]) -> float:
    """Return how far float32 moves the nodes at most, mm."""
    return max(
        float(np.linalg.norm(own.nodes - own.nodes.astype(np.float32), axis=1).max()) for own in facets
    )


def _closed(facets: list[_Facets], reversed_faces: list[bool], error: float, single: bool) -> Tessellation:
    """Return the facets of all faces as one mesh, the nodes of neighbours as one vertex each."""
    nodes = np.concatenate([own.nodes for own in facets])
    if single:
        nodes = nodes.astype(np.float32).astype(np.float64)
    _, first, numbers = np.unique(nodes.round(SAME) + 0.0, axis=0, return_index=True, return_inverse=True)
    starts = np.cumsum([0, *(len(own.nodes) for own in facets)])
    rows = [
        (own.triangles[:, ::-1] if turned else own.triangles) + start
        for own, start, turned in zip(facets, starts, reversed_faces)
    ]
    triangles = numbers.ravel()[np.concatenate(rows)]
    faces = np.repeat(np.arange(len(rows)), [len(row) for row in rows])
    whole = np.array([len(set(row)) == 3 for row in triangles.tolist()])  # rounding can close a sliver
    return Tessellation(nodes[first], triangles[whole], faces[whole], error)
