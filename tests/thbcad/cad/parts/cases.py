"""Lenses, flush flanges and motions; parts read back."""

import numpy as np
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder
from OCP.gp import gp_Ax1, gp_Ax2, gp_Dir, gp_Pnt, gp_Trsf, gp_Vec
from OCP.TopLoc import TopLoc_Location

from tests.thbcad.cad.shapes.cases import CASES, rough
from thbcad.lens import FreeformSurface, Lens
from thbcad.sags import Conic

LENSES = {name: CASES[name][0] for name in ("round", "upright", "front smaller", "rear smaller", "sphere")}
LENSES["flat, smaller"] = Lens(
    FreeformSurface((5, 4)), FreeformSurface((7, 8), Conic(-50.0, -1.0), rough()), 6.0, 1.5
)
LENSES["ellipsoid"] = Lens(
    FreeformSurface((5, 5), Conic(-30.0, 0.6)), FreeformSurface((5, 5), Conic(-50.0, -1.0), rough()), 6.0, 1.5
)
FLUSH = ("round", "flat, smaller")  # lenses with a flat front


def box(x, y, low, high):
    return BRepPrimAPI_MakeBox(gp_Pnt(-x, -y, low), gp_Pnt(x, y, high)).Shape()


def rod(x, y, radius, low, high):
    return BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(x, y, low), gp_Dir(0, 0, 1)), radius, high - low).Shape()


def motions():
    """Return a shift, a half turn and a slanted screw, as gp_Trsf."""
    shift, turn, screw = gp_Trsf(), gp_Trsf(), gp_Trsf()
    shift.SetTranslation(gp_Vec(0.1, -20.3, 1 / 3))
    turn.SetRotation(gp_Ax1(gp_Pnt(0, 0, 0), gp_Dir(1, 0, 0)), np.pi)
    screw.SetRotation(gp_Ax1(gp_Pnt(1, 2, 3), gp_Dir(1, 1, 1)), 0.7)
    return {"shift": shift, "turn": turn, "screw": screw}


MOTIONS = motions()


def located(shape, motion):
    return shape.Moved(TopLoc_Location(motion))


def rows(motion):
    return np.array([[motion.Value(i, j) for j in range(1, 5)] for i in range(1, 4)])
