"""STEP files of lenses: written with every digit, read back as splines.

Reals are written with 17 significant digits, so that poles and knots read back bit for bit.
The time stamp is fixed: the same lens gives the same bytes.
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
from OCP.ShapeAnalysis import ShapeAnalysis_ShapeTolerance
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_SHELL, TopAbs_SOLID
from OCP.TopExp import TopExp
from OCP.TopoDS import TopoDS
from OCP.TopTools import TopTools_IndexedDataMapOfShapeListOfShape

from thbcad.cad.geom import spline_surface
from thbcad.cad.reading import explore, step_shape
from thbcad.cad.solid import lens_solid
from thbcad.cad.writing import silence, step_text
from thbcad.checks import require_type
from thbcad.files import write_bytes
from thbcad.lens import Lens
from thbcad.surface import BSplineSurface

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Shape

PRODUCT = "lens"
VOLUME_TOLERANCE = 1e-6  # relative, asked of OCCT's volume integral


@dataclass(frozen=True, eq=False)
class StepLens:
    """What a STEP file holds: the two optical faces as splines and the state of the solid.

    front, rear : BSplineSurface with poles (x, y, z) in mm, as in the file
    solids, faces, free_edges : int; an edge is free when it does not border two faces
    tolerance : float, mm, the greatest that faces, edges and vertices need to meet
    closed, valid : bool, OCCT's closedness of the shell and its validity check
    volume : float, mm^3, by OCCT
    """

    front: BSplineSurface
    rear: BSplineSurface
    solids: int
    faces: int
    free_edges: int
    tolerance: float
    closed: bool
    valid: bool
    volume: float


def write_step(lens: Lens, path: str | Path) -> None:
    """Write the lens as one closed solid of six faces, in mm.

    Raises
    ------
    OSError : the file cannot be written.
    RuntimeError : OCCT refuses the solid.
    """
    require_type("lens", lens, Lens)
    write_bytes(path, step_bytes(lens))


def step_bytes(lens: Lens) -> bytes:
    """Return the STEP file of a lens; the same lens gives the same bytes."""
    return step_text(lens_solid(lens), PRODUCT)


def read_step(path: str | Path) -> StepLens:
    """Read a STEP file with a lens solid; lengths are converted to mm.

    Raises
    ------
    OSError : the file cannot be read.
    ValueError : it is no STEP file, or does not hold two optical faces (curved both ways, not rational).
    """
    path = Path(path)
    with path.open("rb"):
        pass
    silence()
    shape = step_shape(path)
    splines = []
    for face in explore(shape, TopAbs_FACE):
        surface = BRep_Tool.Surface_s(TopoDS.Face_s(face))
        # the ruled edges are straight one way, front and rear are not
        if isinstance(surface, Geom_BSplineSurface) and min(surface.UDegree(), surface.VDegree()) > 1:
            splines.append(spline_surface(surface))
    splines = [spline for spline in splines if isinstance(spline, BSplineSurface)]
    if len(splines) != 2:
        raise ValueError(f"{path} holds {len(splines)} curved spline faces where a lens has 2, front and rear")
    front, rear = sorted(splines, key=_centre_height)
    shells = [TopoDS.Shell_s(s) for s in explore(shape, TopAbs_SHELL)]
    return StepLens(
        front=front,
        rear=rear,
        solids=len(explore(shape, TopAbs_SOLID)),
        faces=len(explore(shape, TopAbs_FACE)),
        free_edges=_free_edges(shape),
        tolerance=ShapeAnalysis_ShapeTolerance().Tolerance(shape, 1),
        closed=bool(shells) and all(BRep_Tool.IsClosed_s(s) for s in shells),
        valid=BRepCheck_Analyzer(shape).IsValid(),
        volume=_volume(shape, VOLUME_TOLERANCE),
    )


def step_volume(path: str | Path, tolerance: float) -> float:
    """Return the volume in a STEP file, mm^3, by OCCT's integral; it estimates its error and may miss the relative tolerance.

    Raises
    ------
    OSError : the file cannot be read.
    ValueError : it is no STEP file.
    """
    silence()
    return _volume(step_shape(Path(path)), tolerance)


def _volume(shape: TopoDS_Shape, tolerance: float) -> float:
    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, properties, tolerance)
    return properties.Mass()


def _centre_height(spline: BSplineSurface) -> float:
    """Return z at the middle of the parameters."""
    u, v = ((kv.start + kv.stop) / 2 for kv in (spline.kv_u, spline.kv_v))
    return float(spline([u], [v])[0, 2])


def _free_edges(shape: TopoDS_Shape) -> int:
    owners = TopTools_IndexedDataMapOfShapeListOfShape()
    TopExp.MapShapesAndAncestors_s(shape, TopAbs_EDGE, TopAbs_FACE, owners)
    return sum(owners.FindFromIndex(k).Extent() != 2 for k in range(1, owners.Extent() + 1))
