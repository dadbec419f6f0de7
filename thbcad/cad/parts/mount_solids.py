"""The solids of a mount: flange, holes, pins, bosses and gate, and the lens with them."""

from collections.abc import Sequence
from itertools import pairwise

from OCP.BRepBuilderAPI import (
    BRepBuilderAPI_MakeEdge,
    BRepBuilderAPI_MakeFace,
    BRepBuilderAPI_MakePolygon,
    BRepBuilderAPI_MakeVertex,
)
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeRevol
from OCP.gp import gp_Ax1, gp_Dir, gp_Pln, gp_Pnt, gp_Trsf, gp_Vec
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Shape

from thbcad.cad.exchange import faces_of
from thbcad.cad.parts.named_booleans import fused, named_part, without
from thbcad.cad.shapes import Part, closed_part, lens_part, new_wire
from thbcad.lens import FreeformSurface, Lens
from thbcad.mounts import Gate, Hole, Mount, MountProof, Post, require_mount
from thbcad.outlines import Outline

Point3 = tuple[float, float, float]


def mounted_part(lens: Lens, mount: Mount) -> Part:
    """Return the lens with its mount as one closed Part: front, rear, edges, and flange, hole, pin, boss,
    gate with their numbers.

    Raises ValueError : as `require_mount`.
    """
    return fused(lens_part(lens), mount_part(mount, require_mount(mount, lens), lens))


def mount_part(mount: Mount, proof: MountProof, lens: Lens) -> Part:
    """Return the mount alone as a Part; where it is a plate, the glass that it crosses belongs to it."""
    body = _flange_body(mount, proof)
    part = named_part(body, ["flange"] * len(faces_of(body)))
    if proof.framed:
        part = without(part, _prism(lens.front.outline, proof.low - 1, proof.high + 1), "flange")
    if mount.gate is not None:
        part = fused(part, _gate_body(mount, mount.gate, proof), "gate")
    count = {"hole": 0, "pin": 0, "boss": 0}
    for post in mount.posts:
        for place in post.places.points(post.word):
            count[post.word] += 1
            part = fused(part, _turned(_post_profile(post, proof), place), f"{post.word} {count[post.word]}")
    for hole in mount.holes:
        for place in hole.places.points("holes"):
            count["hole"] += 1
            part = without(part, _turned(_hole_profile(hole, proof), place), f"hole {count['hole']}")
    return part


def _flange_body(mount: Mount, proof: MountProof) -> TopoDS_Shape:
    """Return the flange without anything on it: a stack of cones or of pyramid stumps."""
    flange = mount.flange
    levels = [(proof.low + s, inset) for s, inset in flange.sections()]
    if flange.seat == "rear":
        levels = [(proof.high - s, inset) for s, inset in reversed(flange.sections())]
    x, y = flange.half
    if flange.outline == "round":
        rim = [(x - inset, z) for z, inset in levels]
        return _turned([(0.0, rim[0][1]), *rim, (0.0, rim[-1][1])], (0.0, 0.0))
    loops = [
        [(a * (x - inset), b * (y - inset), z) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        for z, inset in levels
    ]
    sides = [
        [low[k - 1], low[k], high[k], high[k - 1]] for low, high in pairwise(loops) for k in range(len(low))
    ]
    return _polyhedron([loops[0][::-1], loops[-1], *sides])


def _hole_profile(hole: Hole, proof: MountProof) -> list[tuple[float, float]]:
    """Return (radius, z) round a hole; it reaches beyond the flange by its thickness."""
    depth = proof.high - proof.low
    inner, outer = hole.diameter / 2, hole.radius
    back, face, far = proof.low - depth, proof.high, proof.high + depth
    sign = 1.0
    if hole.side == "front":
        back, face, far, sign = proof.high + depth, proof.low, proof.low - depth, -1.0
    rim = (
        [(inner, far)] if outer == inner else [(inner, face - sign * hole.sink), (outer, face), (outer, far)]
    )
    return [(0.0, back), (inner, back), *rim, (0.0, far)]


def _post_profile(post: Post, proof: MountProof) -> list[tuple[float, float]]:
    """Return (radius, z) round a pin or a boss, from the middle of the flange to its end."""
    face, sign = (proof.high, 1.0) if post.side == "rear" else (proof.low, -1.0)
    middle, end = (proof.low + proof.high) / 2, face + sign * post.length
    radius, bore = post.diameter / 2, post.bore / 2
    rim = [(radius, middle), (radius, end - sign * post.chamfer)]
    if post.chamfer:
        rim.append((radius - post.chamfer, end))
    inside = [(bore, end), (bore, face), (0.0, face)] if bore else [(0.0, end)]
    return [(0.0, middle), *rim, *inside]


def _gate_body(mount: Mount, gate: Gate, proof: MountProof) -> TopoDS_Shape:
    """Return the tab of a gate, from within the flange beyond its outline."""
    flange = mount.flange
    axis, sign = int(gate.side[1] == "y"), -1.0 if gate.side[0] == "-" else 1.0
    start = flange.half[axis] - flange.inset
    if flange.outline == "round":  # its corners lie on the circle
        start = (start**2 - (gate.width / 2) ** 2) ** 0.5
    reach = sorted((sign * (start - mount.wall / 2), sign * (flange.half[axis] + gate.length)))
    middle = (proof.low + proof.high) / 2
    low, high = (
        (r, side * gate.width / 2, middle + side * gate.thickness / 2) for r, side in zip(reach, (-1.0, 1.0))
    )
    if axis == 1:
        low, high = (low[1], low[0], low[2]), (high[1], high[0], high[2])
    return _box(low, high)


def _prism(outline: Outline, low: float, high: float) -> TopoDS_Shape:
    """Return what lies within an outline between two heights."""
    x, y = outline.half_width
    if outline.is_rectangle:
        return _box((-x, -y, low), (x, y, high))
    flat = FreeformSurface((x, y), corners=outline.corners)
    lift = gp_Trsf()
    lift.SetTranslation(gp_Vec(0, 0, low))
    return lens_part(Lens(flat, flat, high - low, 1.5)).solid.Moved(TopLoc_Location(lift))


def _box(low: Point3, high: Point3) -> TopoDS_Shape:
    return BRepPrimAPI_MakeBox(gp_Pnt(*low), gp_Pnt(*high)).Solid()


def _polyhedron(loops: Sequence[Sequence[Point3]]) -> TopoDS_Shape:
    """Return the solid within plane faces that share their edges; loops run counter-clockwise, seen from
    outside."""
    vertices = {point: BRepBuilderAPI_MakeVertex(gp_Pnt(*point)).Vertex() for loop in loops for point in loop}
    edges: dict[tuple[Point3, Point3], TopoDS_Shape] = {}
    faces = []
    for loop in loops:
        used = []
        for start, stop in pairwise([*loop, loop[0]]):
            if (stop, start) not in edges:
                edges[start, stop] = BRepBuilderAPI_MakeEdge(vertices[start], vertices[stop]).Edge()
            used.append(edges[start, stop] if (start, stop) in edges else edges[stop, start].Reversed())
        a, b, c = (gp_Pnt(*point) for point in loop[:3])
        plane = gp_Pln(a, gp_Dir(gp_Vec(a, b).Crossed(gp_Vec(b, c))))
        faces.append(BRepBuilderAPI_MakeFace(plane, new_wire(used), False).Face())
    return closed_part([""] * len(faces), faces).solid


def _turned(profile: Sequence[tuple[float, float]], place: tuple[float, float]) -> TopoDS_Shape:
    """Return the solid that a closed profile of (radius, z) makes round a vertical axis."""
    x, y = place
    polygon = BRepBuilderAPI_MakePolygon()
    for r, z in profile:
        polygon.Add(gp_Pnt(x + r, y, z))
    polygon.Close()
    face = BRepBuilderAPI_MakeFace(polygon.Wire(), True).Face()
    return BRepPrimAPI_MakeRevol(face, gp_Ax1(gp_Pnt(x, y, 0.0), gp_Dir(0, 0, 1))).Shape()
