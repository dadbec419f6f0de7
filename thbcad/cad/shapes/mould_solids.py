"""Bodies that leave a mould, and inserts of moulds, as OCCT solids with shared topology."""

from contextlib import suppress

from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.BRepFilletAPI import BRepFilletAPI_MakeFillet
from OCP.ShapeAnalysis import ShapeAnalysis_ShapeTolerance
from OCP.ShapeFix import ShapeFix_ShapeTolerance
from OCP.Standard import Standard_Failure
from OCP.StdFail import StdFail_NotDone
from OCP.TopAbs import TopAbs_FACE, TopAbs_SOLID
from OCP.TopExp import TopExp, TopExp_Explorer
from OCP.TopoDS import TopoDS, TopoDS_Face, TopoDS_Shape
from OCP.TopTools import TopTools_IndexedMapOfShape

from thbcad.cad.shapes.forms import form_of
from thbcad.cad.shapes.lens_parts import trimmed_face, upright_face
from thbcad.cad.shapes.tapered_wall import TaperedWall, drafted_faces
from thbcad.cad.shapes.topology import Part, closed_part, face_on, turned_face
from thbcad.cad.shapes.walls import Ring, UprightWall, plane_face, wall_faces
from thbcad.moulds import FACES, INSERT_BACK, DraftedWall, Foot, Insert, MouldedBody

# of OCCT's roundings: least angle between faces, then mm of spine, traces and splines in space and in the
# plane, and how far a chord of the spine may lie beside it
FILLET = (1e-2, 1e-4, 1e-5, 1e-8, 1e-8, 1e-3)
MOST_TOLERANCE = 1e-6  # mm
LEVEL, NEARLY_LEVEL = 1e-9, 0.0125  # mm, of a rim's heights


def insert_part(insert: Insert) -> Part:
    """Return an insert as a closed Part: front or rear with the poles of the lens, the back, and an edge on
    every piece of the outline."""
    wall = UprightWall(insert.shape.pieces)
    face, rim = upright_face(insert.lens, insert.number, wall)
    ring = wall.level(insert.back)
    above = insert.number == 1
    back = turned_face(face_on(form_of(insert.forms[1]).surface(), ring.edges), not above)
    edges = wall_faces(wall, *((rim, ring) if above else (ring, rim)))
    names = (FACES[insert.number], INSERT_BACK, *(f"edge {k + 1}" for k in range(len(edges))))
    return closed_part(names, (TopoDS.Face_s(face.Reversed()), back, *edges))


def moulded_part(body: MouldedBody) -> Part:
    """Return a moulded body as a closed Part: front, rear, the edges below and above the parting line, and
    the land with the step to the smaller surface."""
    optical: list[TopoDS_Face] = []
    rings: list[Ring] = []
    for k in (0, 1):
        foot, wall = body.feet[k], _wall(body.wall(k))
        rings.append(_rim(wall, foot))
        optical.append(trimmed_face(body.lens, k, foot.pieces, foot.rims, rings[k]))
    names, faces = list(FACES), optical
    if body.inner is not None and body.small is not None:
        inner, land = _wall(body.inner), body.inner.level
        side = 1 - body.small if land == body.parting else body.small
        outer = _wall(body.walls[side]).level(land)
        hole = inner.level(land) if body.stepped else rings[body.small]
        added = [plane_face(land, [hole], outer, body.small == 1)]
        if body.stepped:
            pair = (hole, rings[body.small]) if body.inner.side > 0 else (rings[body.small], hole)
            walls = drafted_faces(inner, *pair)
            # the glass lies outside where the step runs into it
            outward = body.inner.side == (-1 if body.small == 0 else 1)
            added += walls if outward else [TopoDS.Face_s(face.Reversed()) for face in walls]
        rings[body.small] = outer
        faces += added
        names += ["land", *(f"step {k + 1}" for k in range(len(added) - 1))]
    edges = _edges(body, rings)
    sharp = closed_part((*names, *(f"edge {k + 1}" for k in range(len(edges)))), (*faces, *edges))
    return _rounded(sharp, body, [edge for k in body.rounded for edge in rings[k].edges])


def _rounded(sharp: Part, body: MouldedBody, edges: list[TopoDS_Shape]) -> Part:
    """Return a part with rounded edges; front and rear keep their surfaces."""
    if not edges:
        return sharp
    fillets = BRepFilletAPI_MakeFillet(sharp.solid)
    fillets.SetParams(*FILLET)
    for edge in edges:
        fillets.Add(body.edge_radius, TopoDS.Edge_s(edge))
    with suppress(StdFail_NotDone, Standard_Failure):
        fillets.Build()
    if not fillets.IsDone():
        raise ValueError(f"OCCT cannot round the edges by {body.edge_radius:g} mm; {_remedy(body)}")
    solids = TopExp_Explorer(fillets.Shape(), TopAbs_SOLID)
    solid = TopoDS.Solid_s(solids.Current())
    off = ShapeAnalysis_ShapeTolerance().Tolerance(solid, 1)
    # vertices are said to be twice as far off as curves that meet there: with less the solid must be valid
    ShapeFix_ShapeTolerance().LimitTolerance(solid, 0.0, MOST_TOLERANCE)
    if not BRepCheck_Analyzer(solid).IsValid():
        raise ValueError(
            f"OCCT rounds the edges by {body.edge_radius:g} mm only within {off:.3g} mm; {_remedy(body)}"
        )
    names: list[str] = []
    faces: list[TopoDS_Face] = []
    for name, face in zip(sharp.names, sharp.faces):
        kept = list(fillets.Modified(face)) or [face]
        names += [name] * len(kept)
        faces += map(TopoDS.Face_s, kept)
    held = TopTools_IndexedMapOfShape()  # as they lie in the solid
    TopExp.MapShapes_s(solid, TopAbs_FACE, held)
    order = [held.FindIndex(face) for face in faces]
    order += [k for k in range(1, held.Extent() + 1) if k not in order]
    names += [f"radius {k + 1}" for k in range(len(order) - len(names))]
    return Part(solid, names, [TopoDS.Face_s(held.FindKey(k)) for k in order])


def _remedy(body: MouldedBody) -> str:
    """Return what may help where OCCT fails.  Of 132 random bodies it did at 26 of the 27 with a rim that is
    level within NEARLY_LEVEL and not quite, whatever the radius, and at 7 of the 105 others."""
    swings = [high - low for low, high in (body.feet[k].heights for k in body.rounded)]
    uneven = [swing for swing in swings if LEVEL < swing < NEARLY_LEVEL]
    if not uneven:
        return "make edge_radius smaller"
    return f"a rim is level within {min(uneven):.2g} mm and not quite, where it fails: take edge_radius 0"


def _edges(body: MouldedBody, rings: list[Ring]) -> list[TopoDS_Face]:
    """Return the wall from the lower to the upper ring, in two where it tapers to both sides."""
    lower, upper = map(_wall, body.walls)
    if not body.walls[0].draft:
        return drafted_faces(lower, *rings)
    if body.inner is not None and body.inner.level == body.parting:
        return drafted_faces((upper, lower)[body.small or 0], *rings)
    middle = lower.level(body.parting)
    turned = upper.level(body.parting)
    shared = Ring(middle.vertices, middle.edges, turned.traces, turned.heights)
    return [
        *drafted_faces(lower, rings[0], middle),
        *drafted_faces(upper, shared, rings[1]),
    ]


def _wall(drafted: DraftedWall) -> TaperedWall | UprightWall:
    return TaperedWall(drafted) if drafted.draft else UprightWall(drafted.outline.pieces)


def _rim(wall: TaperedWall | UprightWall, foot: Foot) -> Ring:
    if isinstance(wall, TaperedWall):
        return wall.rim(foot)
    return wall.rim(foot.rims) if foot.level is None else wall.level(foot.level)
