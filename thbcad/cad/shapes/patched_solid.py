"""The lens as an OCCT solid whose front and rear are several exact faces, one for each patch of the THB
surface.

Patches meet at T-junctions.  The corners of all patches are vertices; an edge is the piece of a patch's
boundary between two consecutive vertices, so that it belongs to exactly two faces.  Nothing is sewn.
"""

from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Vertex

from thbcad.cad.occt_names import as_face
from thbcad.cad.shapes.occt_splines import TOLERANCE, geom_curve, geom_surface
from thbcad.cad.shapes.topology import (
    NAMES,
    Part,
    closed_part,
    face_on,
    new_edge,
    new_vertex,
    plane_edge_face,
    ruled_edge_face,
    side_line,
    strut,
    turned,
)
from thbcad.checks import Floats
from thbcad.lens import (
    CORNERS,
    SIDES,
    Corner,
    FreeformSurface,
    Lens,
    Side,
    placed_surfaces,
    require_sound,
    rim,
    rim_parameter,
    ruled_edge,
)
from thbcad.sags import conic_graph
from thbcad.splines import BSplineSurface, KnotVector
from thbcad.surfaces import THBSurface

NEAR = 1e-12  # of the half-width: knots that differ by rounding only


def patched_part(lens: Lens) -> Part:
    """Return the lens as a closed Part with one face for each patch: "front 1", ..., "rear 1", ..., then the
    four edges.

    Raises ValueError : as `require_sound`; a lens with another outline than a rectangle; a patch with an edge
        of 2e-7 mm or less, which CAD takes for a point.
    """
    whole = placed_surfaces(require_sound(lens))
    if not lens.rear.outline.is_rectangle:
        raise ValueError("patches are those of a lens with the outline of a rectangle; leave them out")
    sheets = [_Sheet(patches) for patches in lens_patches(lens)]
    vertices = [{c: sheet.vertices[_corner(whole[1], c)] for c in CORNERS} for sheet in sheets]
    planar = lens.front.half_width == lens.rear.half_width
    struts = {c: strut([s.coefficients[c] for s in whole], [v[c] for v in vertices], planar) for c in CORNERS}

    # the normal of the parametrisation points to +z: outward at the rear, inward at the front
    faces = [as_face(face.Reversed()) for face in sheets[0].faces] + sheets[1].faces
    for side in SIDES:
        front, rear = (sheet.chain(side, s) for sheet, s in zip(sheets, whole))
        chains = [
            front,
            [struts[side.stop]],
            [edge.Reversed() for edge in reversed(rear)],
            [struts[side.start].Reversed()],
        ]
        if planar:
            faces.append(plane_edge_face(whole[0].coefficients[side.start], side, chains))
        else:
            faces.append(ruled_edge_face(ruled_edge(whole, side), side, chains))
    names = [f"{name} {k + 1}" for name, sheet in zip(NAMES, sheets) for k in range(len(sheet.faces))]
    return closed_part([*names, *NAMES[2:]], faces)


def lens_patches(lens: Lens) -> tuple[list[BSplineSurface], list[BSplineSurface]]:
    """Return the patches of front and rear with poles (x, y, z) in the lens frame, in mm.

    As `placed_surfaces`, all are parametrised over the rear's rectangle.  Sags, planes and paraboloids are
    exact but for rounding, other conics are within 1e-11 mm.  A surface without sag is one patch.
    """
    target = lens.rear.half_width
    rows = zip((lens.front, lens.rear), placed_surfaces(lens), (0.0, lens.thickness))
    front, rear = (
        [whole] if surface.sag is None else list(_placed(surface, surface.sag, vertex, target))
        for surface, whole, vertex in rows
    )
    return front, rear


def _placed(
    surface: FreeformSurface, sag: THBSurface, vertex: float, target: tuple[float, float]
) -> Iterator[BSplineSurface]:
    """Yield the patches of conic + sag over the rectangle with half-widths `target`; equal positions get
    equal knots."""
    domains = (sag.space.kv_u, sag.space.kv_v)
    patches = sag.to_patches()
    marks = []
    for kvs, domain, h in zip(zip(*((patch.kv_u, patch.kv_v) for patch in patches)), domains, target):
        marks.append(np.unique(np.concatenate([_mapped(kv.breaks, domain, h) for kv in kvs])))
    graphs = []
    for patch in patches:
        kv_x, kv_y = (
            KnotVector(kv.degree, _mapped(kv.knots, domain, h))
            for kv, domain, h in zip((patch.kv_u, patch.kv_v), domains, surface.half_width)
        )
        graphs.append(conic_graph(surface.conic, kv_x, kv_y, patch.coefficients))
    p, q = (max(getattr(graph, kv).degree for graph in graphs) for kv in ("kv_u", "kv_v"))
    for graph in (one.elevate(p, q) for one in graphs):
        x, y = np.meshgrid(graph.kv_u.greville(), graph.kv_v.greville(), indexing="ij")
        poles = np.stack([x, y, vertex + graph.coefficients], axis=-1)
        kv_u, kv_v = (
            KnotVector(kv.degree, _snapped(kv.knots * (t / h), m))
            for kv, t, h, m in zip((graph.kv_u, graph.kv_v), target, surface.half_width, marks)
        )
        yield BSplineSurface(kv_u, kv_v, poles)


def _mapped(knots: Floats, domain: KnotVector, half: float) -> Floats:
    """Return knots of a sag as positions in [-half, half]; the same knot always gives the same float."""
    fraction = (knots - domain.start) / (domain.stop - domain.start)
    return np.where(fraction == 1, half, -half + 2 * half * fraction)


def _snapped(knots: Floats, marks: Floats) -> Floats:
    """Return the knots; those that are a mark but for rounding become it."""
    tolerance = NEAR * marks[-1]
    near = marks[np.minimum(np.searchsorted(marks, knots - tolerance), len(marks) - 1)]
    return np.where(abs(near - knots) < tolerance, near, knots)


class _Sheet:
    """Faces over rectangles that tile a rectangle, with their vertices and edges.

    vertices : TopoDS_Vertex by (u, v).  faces : in the order of the patches, normals to +z.
    """

    def __init__(self, patches: Sequence[BSplineSurface]) -> None:
        self.vertices: dict[tuple[float, float], TopoDS_Vertex] = {}
        self._edges: dict[tuple[int, float, float], TopoDS_Edge] = {}
        for patch in patches:
            for corner in CORNERS:
                position = _corner(patch, corner)
                if position not in self.vertices:
                    self.vertices[position] = new_vertex(patch.coefficients[corner])
        # by axis and line: the positions of the vertices on the line v (axis 0) or u (axis 1)
        self._positions: tuple[dict[float, list[float]], dict[float, list[float]]] = ({}, {})
        for u, v in sorted(self.vertices):
            self._positions[0].setdefault(v, []).append(u)
            self._positions[1].setdefault(u, []).append(v)
        self.faces = [self._face(patch) for patch in patches]

    def chain(self, side: Side, surface: BSplineSurface) -> list[TopoDS_Edge]:
        """Return the edges along a side of a patch, or of all patches, towards increasing x or y; makes those
        that are not there."""
        axis = side.axis
        line = rim_parameter(surface, side)
        kv, poles = rim(surface, side)
        positions = self._positions[axis][line]
        between = positions[bisect_left(positions, kv.start) : bisect_right(positions, kv.stop)]
        edges = []
        for start, stop in pairwise(between):
            key = axis, line, start
            if key not in self._edges:
                segment, operator = kv.segment(start, stop)
                points = operator @ poles
                if np.linalg.norm(points[-1] - points[0]) <= 2 * TOLERANCE:
                    raise ValueError(
                        f"a patch has an edge of at most {2 * TOLERANCE:g} mm at {points[0]} mm; use fewer "
                        "levels"
                    )
                ends = [self.vertices[(t, line) if axis == 0 else (line, t)] for t in (start, stop)]
                self._edges[key] = new_edge(geom_curve(segment, points), start, stop, *ends)
            edges.append(self._edges[key])
        return edges

    def _face(self, patch: BSplineSurface) -> TopoDS_Face:
        loop, images = [], []
        for side in SIDES:
            chain = self.chain(side, patch)
            loop += [turned(edge, side.clockwise) for edge in (chain[::-1] if side.clockwise else chain)]
            images += [side_line(patch, side)] * len(chain)
        return face_on(geom_surface(patch), loop, True, images)


def _corner(surface: BSplineSurface, corner: Corner) -> tuple[float, float]:
    """Return the parameters of a corner."""
    u, v = ((kv.start, kv.stop)[k] for kv, k in zip((surface.kv_u, surface.kv_v), corner))
    return u, v
