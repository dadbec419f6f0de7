"""Points and normals of a face of an OCCT shape, as OCCT evaluates them, over a grid of its parameters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from OCP.BRep import BRep_Tool
from OCP.gp import gp_Pnt, gp_Vec
from OCP.TopAbs import TopAbs_REVERSED
from OCP.TopoDS import TopoDS_Shape

from thbcad.cad.exchange.reading import faces_of
from thbcad.checks import Floats


@dataclass(frozen=True, eq=False)
class FaceNodes:
    """Points (n_u, n_v, 3) in mm and outward unit normals (n_u, n_v, 3) of a face."""

    points: Floats
    normals: Floats


def face_nodes(shape: TopoDS_Shape, number: int, u: ArrayLike, v: ArrayLike) -> FaceNodes:
    """Return the FaceNodes of the surface under a face, at the parameters u x v, (n_u,) and (n_v,), or at
    pairs of them, (n_u, n_v) both.

    About 10 microseconds per node.

    number : of the face in the shape, from 0.
    """
    face = faces_of(shape)[number]
    evaluate = BRep_Tool.Surface_s(face).D1
    point, along_u, along_v = gp_Pnt(), gp_Vec(), gp_Vec()
    a, b = (np.asarray(row, dtype=np.float64) for row in (u, v))
    pairs = np.stack(np.broadcast_arrays(*((a[:, None], b) if a.ndim == 1 else (a, b))), axis=-1)
    rows = []
    for line in pairs.tolist():
        row = []
        for a, b in line:
            evaluate(a, b, point, along_u, along_v)
            row.append(point.Coord() + along_u.Coord() + along_v.Coord())
        rows.append(np.array(row))
    jet = np.stack(rows)
    normals = np.cross(jet[..., 3:6], jet[..., 6:])
    outward = -1.0 if face.Orientation() == TopAbs_REVERSED else 1.0
    return FaceNodes(jet[..., :3], outward * normals / np.linalg.norm(normals, axis=-1, keepdims=True))
