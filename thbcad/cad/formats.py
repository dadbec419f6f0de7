"""The solid of a lens in IGES and BREP files, and back.

IGES holds it as a manifold solid (entity 186), BREP as OCCT's own topology.  Reals have 17 digits
and the time stamp is fixed: poles and knots read back bit for bit, the same lens gives the same bytes.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from OCP.BRep import BRep_Tool
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.BRepGProp import BRepGProp
from OCP.Geom import Geom_BSplineSurface
from OCP.GProp import GProp_GProps
from OCP.IGESControl import IGESControl_Controller
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_SOLID
from OCP.TopExp import TopExp
from OCP.TopoDS import TopoDS
from OCP.TopTools import TopTools_IndexedDataMapOfShapeListOfShape

from thbcad.cad.geom import spline_surface
from thbcad.cad.iges_writing import SOLID, brep_text, iges_text
from thbcad.cad.reading import brep_shape, explore, iges_shape
from thbcad.cad.solid import lens_solid
from thbcad.cad.writing import silence
from thbcad.surface import BSplineSurface

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Shape

    from thbcad.lens import Lens

VOLUME_TOLERANCE = 1e-6  # relative, asked of OCCT's volume integral


@dataclass(frozen=True, eq=False)
class SolidFile:
    """What an IGES or BREP file holds: the optical faces as splines and the state of the solid.

    front, rear : BSplineSurface with poles (x, y, z) in mm, as in the file
    solids, faces, free_edges : int; an edge is free when it does not border two faces
    valid : bool, OCCT's validity check
    volume : float, mm^3, by OCCT
    """

    front: BSplineSurface
    rear: BSplineSurface
    solids: int
    faces: int
    free_edges: int
    valid: bool
    volume: float


def iges_bytes(lens: Lens) -> bytes:
    """Return an IGES file of the lens as a solid, mm.

    Raises
    ------
    RuntimeError : OCCT refuses the solid.
    """
    return iges_text(lens_solid(lens), SOLID, "lens")


def brep_bytes(lens: Lens) -> bytes:
    """Return a BREP file of the lens as a solid, mm."""
    return brep_text(lens_solid(lens))


def read_iges(path: str | Path) -> SolidFile:
    """Read an IGES file with a lens solid; lengths are converted to mm.

    Raises
    ------
    OSError : the file cannot be read.
    ValueError : it is no IGES file, or does not hold two optical faces.
    """
    silence()
    IGESControl_Controller.Init_s()
    return _solid_file(iges_shape(Path(path)), path)


def read_brep(path: str | Path) -> SolidFile:
    """Read a BREP file with a lens solid.

    Raises
    ------
    OSError : the file cannot be read.
    ValueError : it is no BREP file, or does not hold two optical faces.
    """
    silence()
    return _solid_file(brep_shape(Path(path)), path)


def _solid_file(shape: TopoDS_Shape, path: str | Path) -> SolidFile:
    geoms = [BRep_Tool.Surface_s(TopoDS.Face_s(face)) for face in explore(shape, TopAbs_FACE)]
    # the ruled edges are straight one way, front and rear are not
    curved = [spline_surface(g) for g in geoms if isinstance(g, Geom_BSplineSurface) and min(g.UDegree(), g.VDegree()) > 1]
    splines = [spline for spline in curved if isinstance(spline, BSplineSurface)]
    if len(splines) != 2:
        raise ValueError(f"{path} holds {len(splines)} curved spline faces where a lens has 2, front and rear")
    front, rear = sorted(splines, key=_centre_height)
    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, properties, VOLUME_TOLERANCE)
    owners = TopTools_IndexedDataMapOfShapeListOfShape()
    TopExp.MapShapesAndAncestors_s(shape, TopAbs_EDGE, TopAbs_FACE, owners)
    return SolidFile(
        front=front,
        rear=rear,
        solids=len(explore(shape, TopAbs_SOLID)),
        faces=len(geoms),
        free_edges=sum(owners.FindFromIndex(k).Extent() != 2 for k in range(1, owners.Extent() + 1)),
        valid=BRepCheck_Analyzer(shape).IsValid(),
        volume=properties.Mass(),
    )


def _centre_height(spline: BSplineSurface) -> float:
    """Return z at the middle of the parameters."""
    u, v = ((kv.start + kv.stop) / 2 for kv in (spline.kv_u, spline.kv_v))
    return float(spline([u], [v])[0, 2])
