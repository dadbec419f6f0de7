"""What a CAD file with a lens solid holds: the state of the solid, and its optical faces, front and rear,
found by their names, else by their heights at the axis.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from OCP.Bnd import Bnd_Box
from OCP.BRep import BRep_Tool
from OCP.BRepBndLib import BRepBndLib
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.BRepClass import BRepClass_FaceClassifier
from OCP.BRepGProp import BRepGProp
from OCP.Geom import Geom_BSplineSurface, Geom_Plane, Geom_SphericalSurface
from OCP.gp import gp_Ax3, gp_Dir, gp_Pln, gp_Pnt
from OCP.GProp import GProp_GProps
from OCP.ShapeAnalysis import ShapeAnalysis_ShapeTolerance
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_OUT, TopAbs_SHELL, TopAbs_SOLID, TopAbs_VERTEX
from OCP.TopExp import TopExp
from OCP.TopoDS import TopoDS_Face, TopoDS_Shape

from thbcad.cad.exchange.reading import explore, faces_of
from thbcad.cad.occt_names import ShapeOwners, as_edge, as_shell, as_vertex, box_limits
from thbcad.cad.shapes import TOLERANCE, spline_surface
from thbcad.checks import MAX_DEGREE, Floats
from thbcad.lens import OpticalForm, optical_places
from thbcad.sags import PlacedConic, conic_of_patch, conic_of_plane, conic_of_sphere, rectangle_around
from thbcad.splines import BSplineSurface, NURBSSurface

VOLUME_TOLERANCE = AREA_TOLERANCE = 1e-6  # relative


def front_and_rear(
    shape: TopoDS_Shape, path: str | Path, names: Sequence[str]
) -> tuple[OpticalForm, OpticalForm]:
    """Return the surfaces under front and rear.

    They are the faces of these names.  Where the names are missing or not unique, they are the lowest and the
    highest of the faces that are splines curved in both directions, or planes, spheres and patches of conics
    across the middle.

    names : of all faces in their order
    """
    faces = faces_of(shape)
    places = optical_places(names)
    if places is not None:
        named = []
        for place in places:
            form = optical_form(faces[place])
            if form is None:
                raise ValueError(
                    f"the {names[place]} in {path} is neither a spline curved in both directions, nor a "
                    "plane, a sphere or another conic around z; export the lens again, or "
                    "read a part that is turned by read_lens_solid"
                )
            named.append(form)
        return named[0], named[1]
    found = _across_the_middle(faces, _corners(shape))
    if len(found) != 2:
        raise ValueError(f"{path} holds {len(found)} optical faces where a lens has 2, front and rear")
    return found[0], found[1]


def optical_form(face: TopoDS_Face) -> OpticalForm | None:
    """Return the surface under a face as a record; None unless it can be that of a front or a rear: a spline
    curved in both directions, a plane across z, a sphere or a patch of a conic around z."""
    geom = BRep_Tool.Surface_s(face)
    corners = _corners(face)
    half_width = rectangle_around(corners)
    if isinstance(geom, Geom_Plane):
        return conic_of_plane(_placement(geom.Position()), half_width)
    if isinstance(geom, Geom_SphericalSurface):
        placement = _placement(geom.Position())
        below = bool(corners[:, 2].sum() < len(corners) * placement[0, 2])
        return conic_of_sphere(placement, geom.Radius(), below, half_width)
    # the ruled edges are straight in one direction, and OCCT's roundings have degrees up to 14
    if not isinstance(geom, Geom_BSplineSurface) or not (
        min(geom.UDegree(), geom.VDegree()) >= 2 and max(geom.UDegree(), geom.VDegree()) <= MAX_DEGREE
    ):
        return None
    spline = spline_surface(geom)
    return spline if isinstance(spline, BSplineSurface) else conic_of_patch(spline, half_width)


def conic_faces(shape: TopoDS_Shape) -> list[PlacedConic]:
    """Return the planes across z, spheres and patches of conics around z under the faces of a shape, in their
    order."""
    forms = []
    for face in faces_of(shape):
        geom = BRep_Tool.Surface_s(face)
        # polynomials are left out before their poles are read
        if not isinstance(geom, Geom_BSplineSurface) or geom.IsURational() or geom.IsVRational():
            forms.append(optical_form(face))
    return [form for form in forms if isinstance(form, PlacedConic)]


def _across_the_middle(faces: Sequence[TopoDS_Face], corners: Floats) -> list[OpticalForm]:
    """Return the lowest and the highest optical surface, or all splines where they are more than two.

    The middle is that of a spline, else that of the solid.
    """
    forms = [(face, optical_form(face)) for face in faces]
    splines = [form for _, form in forms if isinstance(form, BSplineSurface)]
    if len(splines) > 2 or not len(corners):
        return [*splines]
    x, y, _ = _centre(splines[0]) if splines else (corners.min(axis=0) + corners.max(axis=0)) / 2
    conics = [form for face, form in forms if isinstance(form, PlacedConic) and _covers(face, form, x, y)]
    heights: list[tuple[float, OpticalForm]] = [(float(_centre(form)[2]), form) for form in splines]
    heights += [(float(form(x, y)), form) for form in conics]
    found = [form for _, form in sorted(heights, key=lambda pair: pair[0])]
    return [found[0], found[-1]] if len(found) > 1 else found


def _covers(face: TopoDS_Face, conic: PlacedConic, x: float, y: float) -> bool:
    """Return whether a face lies above or below (x, y)."""
    point = gp_Pnt(x, y, conic(x, y))
    return BRepClass_FaceClassifier(face, point, TOLERANCE).State() != TopAbs_OUT


def _centre(spline: BSplineSurface) -> Floats:
    """Return the point at the middle of the parameters, (3,), mm."""
    u, v = ((kv.start + kv.stop) / 2 for kv in (spline.kv_u, spline.kv_v))
    return spline([u], [v])[0]


def _corners(shape: TopoDS_Shape) -> Floats:
    """Return the vertices of a shape, (n, 3), mm."""
    vertices = (as_vertex(vertex) for vertex in explore(shape, TopAbs_VERTEX))
    return np.array([BRep_Tool.Pnt_s(vertex).Coord() for vertex in vertices]).reshape(-1, 3)


def _placement(position: gp_Ax3) -> Floats:
    """Return centre, axis and first direction, (3, 3)."""
    rows = position.Location(), position.Direction(), position.XDirection()
    return np.array([row.Coord() for row in rows])


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
        """The number of edges that do not border two faces, without those at poles, which have no length."""
        owners = ShapeOwners()
        TopExp.MapShapesAndAncestors_s(self.shape, TopAbs_EDGE, TopAbs_FACE, owners)
        numbers = range(1, owners.Extent() + 1)
        edges = [k for k in numbers if not BRep_Tool.Degenerated_s(as_edge(owners.FindKey(k)))]
        return sum(owners.FindFromIndex(k).Extent() != 2 for k in edges)

    @property
    def tolerance(self) -> float:
        """The greatest distance in mm that faces, edges and vertices need to meet."""
        return ShapeAnalysis_ShapeTolerance().Tolerance(self.shape, 1)

    @property
    def closed(self) -> bool:
        """Whether OCCT calls the shells closed."""
        shells = [as_shell(s) for s in explore(self.shape, TopAbs_SHELL)]
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
    def box(self) -> tuple[float, ...]:
        """The box of the shape by OCCT, (x, y, z, x, y, z) in mm: that of the poles, not the least one."""
        box = Bnd_Box()
        BRepBndLib.Add_s(self.shape, box, False)
        return box_limits(box)

    @cached_property
    def area(self) -> float:
        """The area of all faces in mm^2 by OCCT."""
        return solid_area(self.shape, AREA_TOLERANCE)


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
    """
    front, rear = front_and_rear(shape, path, names)
    return SolidFile(shape, front, rear, names or ("",) * len(faces_of(shape)))


def spline_faces(shape: TopoDS_Shape) -> list[BSplineSurface | NURBSSurface]:
    """Return the spline surfaces under the faces of a shape, in their order; other faces, and splines of a
    degree above 10, are left out."""
    geoms = map(BRep_Tool.Surface_s, faces_of(shape))
    splines = (geom for geom in geoms if isinstance(geom, Geom_BSplineSurface))
    return [spline_surface(s) for s in splines if max(s.UDegree(), s.VDegree()) <= MAX_DEGREE]


def solid_area(shape: TopoDS_Shape, tolerance: float) -> float:
    """Return the area of the faces of a shape, mm^2, by OCCT.

    tolerance : relative, as OCCT estimates it: its error may be ten times that.
    """
    properties = GProp_GProps()
    BRepGProp.SurfaceProperties_s(shape, properties, tolerance)
    return properties.Mass()


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
