"""What a CAD file with a lens solid holds: the optical faces and the state of the solid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from OCP.Bnd import Bnd_Box
from OCP.BRep import BRep_Tool
from OCP.BRepBndLib import BRepBndLib
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.BRepGProp import BRepGProp
from OCP.Geom import Geom_BSplineSurface
from OCP.gp import gp_Dir, gp_Pln, gp_Pnt
from OCP.GProp import GProp_GProps
from OCP.ShapeAnalysis import ShapeAnalysis_ShapeTolerance
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_SHELL, TopAbs_SOLID
from OCP.TopExp import TopExp
from OCP.TopoDS import TopoDS, TopoDS_Shape
from OCP.TopTools import TopTools_IndexedDataMapOfShapeListOfShape

from thbcad.cad.exchange.front_and_rear import front_and_rear
from thbcad.cad.exchange.reading import explore, faces_of
from thbcad.cad.shapes import spline_surface
from thbcad.checks import MAX_DEGREE
from thbcad.lens import OpticalForm
from thbcad.splines import BSplineSurface, NURBSSurface

VOLUME_TOLERANCE = AREA_TOLERANCE = 1e-6  # relative


@dataclass(frozen=True, eq=False)
class SolidState:
    """What OCCT says of a shape.

    shape : TopoDS_Shape, mm
    """

    shape: TopoDS_Shape

    @property
    def solids(self) -> int:
        """The number of solids."""
        return len(explore(self.shape, TopAbs_SOLID))

    @property
    def faces(self) -> int:
        """The number of faces."""
        return len(faces_of(self.shape))

    @property
    def free_edges(self) -> int:
        """The number of edges that do not border two faces."""
        owners = TopTools_IndexedDataMapOfShapeListOfShape()
        TopExp.MapShapesAndAncestors_s(self.shape, TopAbs_EDGE, TopAbs_FACE, owners)
        return sum(owners.FindFromIndex(k).Extent() != 2 for k in range(1, owners.Extent() + 1))

    @property
    def tolerance(self) -> float:
        """The greatest distance in mm that faces, edges and vertices need to meet."""
        return ShapeAnalysis_ShapeTolerance().Tolerance(self.shape, 1)

    @property
    def closed(self) -> bool:
        """Whether OCCT calls the shells closed."""
        shells = [TopoDS.Shell_s(s) for s in explore(self.shape, TopAbs_SHELL)]
        return bool(shells) and all(BRep_Tool.IsClosed_s(s) for s in shells)

    @property
    def valid(self) -> bool:
        """Whether OCCT's check finds nothing wrong; it does not look for free edges."""
        return BRepCheck_Analyzer(self.shape).IsValid()

    @cached_property
    def volume(self) -> float:
        """The volume in mm^3 by OCCT."""
        return solid_volume(self.shape, VOLUME_TOLERANCE)

    @property
    def default_volume(self) -> float:
        """The volume in mm^3 by the default quadrature of OCCT, as other programs show it.

        It takes few points per face: on rough faces it is off by up to 2.5e-4.
        """
        properties = GProp_GProps()
        BRepGProp.VolumeProperties_s(self.shape, properties)
        return properties.Mass()

    @property
    def box(self) -> tuple[float, ...]:
        """The box of the shape by OCCT, (x, y, z, x, y, z) in mm: that of the poles, not the least one."""
        box = Bnd_Box()
        BRepBndLib.Add_s(self.shape, box, False)
        return box.Get()

    @cached_property
    def area(self) -> float:
        """The area of all faces in mm^2 by OCCT."""
        properties = GProp_GProps()
        BRepGProp.SurfaceProperties_s(self.shape, properties, AREA_TOLERANCE)
        return properties.Mass()


@dataclass(frozen=True, eq=False)
class SolidFile(SolidState):
    """What a STEP, IGES or BREP file with a lens solid holds, beside the state of its shape.

    front, rear : BSplineSurface with poles (x, y, z) in mm, or PlacedConic, as in the file
    face_names : of all faces in their order, "" where the file has none; only STEP has them
    product, author, organization, material : str, "" where the file has none; only STEP has them
    schema : AP203, AP214, AP242, or what else a STEP file says; "" for IGES and BREP
    """

    front: OpticalForm
    rear: OpticalForm
    face_names: Sequence[str]
    product: str = ""
    author: str = ""
    organization: str = ""
    schema: str = ""
    material: str = ""


def solid_file(shape: TopoDS_Shape, path: str | Path, names: Sequence[str] = ()) -> SolidFile:
    """Return the SolidFile of a shape that was read from `path`.

    names : of its faces in their order; none where the file has none

    Raises
    ------
    ValueError : as `front_and_rear`.
    """
    front, rear = front_and_rear(shape, path, names)
    return SolidFile(shape, front, rear, names or ("",) * len(faces_of(shape)))


def spline_faces(shape: TopoDS_Shape) -> list[BSplineSurface | NURBSSurface]:
    """Return the spline surfaces under the faces of a shape, in their order; other faces, and splines of a
    degree above 10, are left out."""
    geoms = map(BRep_Tool.Surface_s, faces_of(shape))
    splines = (geom for geom in geoms if isinstance(geom, Geom_BSplineSurface))
    return [spline_surface(s) for s in splines if max(s.UDegree(), s.VDegree()) <= MAX_DEGREE]


def solid_volume(shape: TopoDS_Shape, tolerance: float) -> float:
    """Return the volume of a closed shape, mm^3, by OCCT: V = sum over the faces of the integral of z n_z dA.

    tolerance : relative, which OCCT's Gauss-Kronrod integral keeps face by face, span by span.
    """
    properties = GProp_GProps()
    only_closed = False
    by_spans = True
    # from the plane z = 0: the flux of the whole position vector through rough faces needs far more points
    plane = gp_Pln(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1))
    BRepGProp.VolumePropertiesGK_s(shape, properties, plane, tolerance, only_closed, by_spans)
    return properties.Mass()
