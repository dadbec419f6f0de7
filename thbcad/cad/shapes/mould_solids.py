"""Bodies that leave a mould, and inserts of moulds, as OCCT solids with shared topology."""

from OCP.TopoDS import TopoDS_Face

from thbcad.cad.occt_names import as_face
from thbcad.cad.shapes.forms import form_of
from thbcad.cad.shapes.lens_parts import trimmed_face, upright_face
from thbcad.cad.shapes.rounded_walls import RoundedWall
from thbcad.cad.shapes.tapered_wall import TaperedWall, drafted_faces
from thbcad.cad.shapes.topology import Part, closed_part, face_on, turned_face
from thbcad.cad.shapes.walls import Ring, UprightWall, plane_face, wall_faces
from thbcad.moulds import FACES, INSERT_BACK, DraftedWall, Foot, Insert, MouldedBody


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
    return closed_part(names, (as_face(face.Reversed()), back, *edges))


def moulded_part(body: MouldedBody) -> Part:
    """Return a moulded body as a closed Part: front, rear, the land with the step to the smaller surface, the
    edges below and above the parting line, and the radii between them and front or rear."""
    optical: list[TopoDS_Face] = []
    radii: list[TopoDS_Face] = []
    rings: list[Ring] = []
    for k in (0, 1):
        rim, foot = body.ends(k)
        rings.append(_rim(_wall(body.wall(k)), foot))
        ring, edge = rings[k], body.rounded_edges.get(k)
        if edge is not None:
            rounding = RoundedWall(edge)
            ring = rounding.rim()
            radii += rounding.between(ring, rings[k])
        optical.append(trimmed_face(body.lens, k, rim.pieces, rim.rims, ring))
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
            added += walls if outward else [as_face(face.Reversed()) for face in walls]
        rings[body.small] = outer
        faces += added
        names += ["land", *(f"step {k + 1}" for k in range(len(added) - 1))]
    edges = _edges(body, rings)
    names += [f"edge {k + 1}" for k in range(len(edges))]
    names += [f"radius {k + 1}" for k in range(len(radii))]
    return closed_part(names, (*faces, *edges, *radii))


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
