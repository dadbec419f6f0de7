"""The faces of the closed lens, and where rays meet them.

Front, rear and slanted edges of rectangles are graphs z = Z(x, y) over convex pieces of the plan; edges
between rims of equal half-width are walls, pieces of a plane x = const or y = const.  Where corners are
rounded, one ruled wall joins the rims.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import and_, or_

import numpy as np

from optics.base.runtime import Backend, DrArray
from optics.light.intersections import DeviceRays, PlacedSurface
from optics.light.tracing.graph_face import START, GraphFace, Jet, Meeting, Trim
from optics.light.tracing.ruled_wall import RuledWall
from thbcad.checks import Floats
from thbcad.lens import Lens
from thbcad.outlines import Outline

RIM = 1e-12  # of the lens's size: faces reach this far over their rims, so that no gap opens between them
ROOM = 1e-6  # of the lens's size: room in z above and below a face
WALL = 1e-9  # of the lens's size: rims whose half-widths differ by less are joined by a wall


@dataclass(eq=False)
class PlaneFace:
    """The part of the plane s a = distance whose points a mask holds.

    a is x, y or z, by the axis.  sign : s = +-1; air lies at greater s a.
    """

    backend: Backend
    axis: int
    sign: float
    distance: float
    size: float
    holds: Callable[[Jet], DrArray | bool]

    def __post_init__(self) -> None:
        numbers = self.sign, self.distance, START * self.size
        self._sign, self._distance, self._near = map(self.backend.opaque, numbers)

    def reach(self, rays: DeviceRays) -> DrArray:
        """Return the path at which rays meet the endless plane; inf where they do not."""
        dr = self.backend.dr
        speed = self._sign * rays.direction[self.axis]
        t = (self._distance - self._sign * rays.origin[self.axis]) / speed
        found = ((speed > 0) == rays.inside) & (speed != 0) & (t >= -self._near)
        return dr.select(found, dr.maximum(t, 0), dr.inf)

    def meet(self, rays: DeviceRays) -> Meeting:
        """Return the Meeting of rays with the face."""
        dr, Float = self.backend.dr, self.backend.Float
        reach = self.reach(rays)
        found = dr.isfinite(reach)
        t = dr.select(found, reach, 0)
        point, normal = list(rays.at(t)), [Float(0)] * 3
        point[self.axis], normal[self.axis] = self._sign * self._distance, self._sign
        x, y, z = point
        nx, ny, nz = normal
        return Meeting(dr.select(found & self.holds((x, y, z)), t, dr.inf), (nx, ny, nz), Float(dr.inf))


def lens_faces(backend: Backend, lens: Lens) -> list[GraphFace | PlaneFace | RuledWall]:
    """Return the front, the rear and the edges: +x, -x, +y, -y of a rectangle, else one."""
    size = max(*lens.front.half_width, *lens.rear.half_width, lens.thickness)
    surfaces = [PlacedSurface(backend, lens.front, 0.0), PlacedSurface(backend, lens.rear, lens.thickness)]
    outlines = [s.outline for s in (lens.front, lens.rear)]
    graphs = [
        surface_face(backend, s, outline, outward, size)
        for s, outline, outward in zip(surfaces, outlines, (-1.0, 1.0))
    ]
    if not outlines[0].is_rectangle:
        return [*graphs, RuledWall(surfaces, outlines, START * size, RIM * size)]
    rims = list(zip(lens.front.half_width, lens.rear.half_width))
    sides = [(axis, sign) for axis in (0, 1) for sign in (1.0, -1.0)]
    slanted = [side for side in sides if abs(np.subtract(*rims[side[0]])) > WALL * size]
    graphs += [_edge_face(_Edge(surfaces, *side), size) for side in slanted]

    def enclosed(point: Jet) -> DrArray | bool:
        x, y, _ = point
        above = [face.covers(x, y) for face in graphs]
        within = (~covered | face.encloses(point) for covered, face in zip(above, graphs))
        return reduce(or_, above) & reduce(and_, within)

    walls = [
        PlaneFace(backend, axis, sign, min(rims[axis]), min(rims[axis]), enclosed)
        for axis, sign in sides
        if (axis, sign) not in slanted
    ]
    return [*graphs, *walls]


class _Edge:
    """The ruled edge on the side of `axis` towards `sign`, between rims of different half-width.

    With a along and b across the axis it is the graph of (1 - w) z_front + w z_rear, where
    a = (1 - w) a_front + w a_rear and b = s ((1 - w) b_front + w b_rear) give w and s.
    """

    def __init__(self, surfaces: list[PlacedSurface], axis: int, sign: float) -> None:
        backend = surfaces[0].backend
        self.backend, self.surfaces, self.axis, self.sign = backend, surfaces, axis, sign
        self.along = [s.half_width[axis] for s in surfaces]
        self.across = [s.half_width[1 - axis] for s in surfaces]
        growth = self.along[1] - self.along[0], self.across[1] - self.across[0]
        self._numbers = [*map(backend.opaque, (sign, *self.along, *self.across, *growth))]

    def height(self, x: DrArray, y: DrArray) -> Jet:
        """Return Z, Zx, Zy."""
        sign, a_front, a_rear, b_front, b_rear, da, db = self._numbers
        a, b = (sign * x, y) if self.axis == 0 else (sign * y, x)
        w = (a - a_front) / da
        width = b_front + w * db
        s = b / width
        front, front_b = self._rim(0, sign * a_front, s * b_front)
        rear, rear_b = self._rim(1, sign * a_rear, s * b_rear)
        by_b = ((1 - w) * front_b * b_front + w * rear_b * b_rear) / width
        by_a = (rear - front - by_b * s * db) / da
        z, along = (1 - w) * front + w * rear, sign * by_a
        return (z, along, by_b) if self.axis == 0 else (z, by_b, along)

    def _rim(self, which: int, along: DrArray, across: DrArray) -> tuple[DrArray, DrArray]:
        """Return z of a rim and its slope across."""
        z, zx, zy = self.surfaces[which].jet(*((along, across) if self.axis == 0 else (across, along)))
        return (z, zy) if self.axis == 0 else (z, zx)

    def domain(self, size: float) -> Floats:
        """Return the domain: bounds of x and y, and of z the planes through the lowest and the highest points
        of either rim."""
        (a_front, a_rear), (b_front, b_rear) = self.along, self.across
        da, db = a_rear - a_front, b_rear - b_front
        grows, rate = np.sign(da), db / da
        rows = [[grows, 0, 0, -grows * a_front], [-grows, 0, 0, grows * a_rear]]
        rows += [[rate, side, 0, b_front - rate * a_front] for side in (1, -1)]
        end = 0 if self.sign < 0 else -1
        heights = zip(*(s.rim_heights(self.axis, end) for s in self.surfaces))
        for up, (front, rear) in zip((1, -1), heights):
            climb = (rear - front) / da
            rows.append([-up * climb, 0, up, up * (climb * a_front - front)])
        own = [
            [self.sign * a, b, c, e] if self.axis == 0 else [b, self.sign * a, c, e] for a, b, c, e in rows
        ]
        return _domain(own, size)


def surface_face(
    backend: Backend,
    surface: PlacedSurface,
    outline: Outline,
    outward: float,
    size: float,
    trim: Trim | None = None,
) -> GraphFace:
    """Return the face of a front (outward -1) or a rear (+1) within its outline, and what else trims it."""
    hx, hy = surface.half_width
    if outline.is_rectangle:
        plan, rounded = [[1, 0, 0, hx], [-1, 0, 0, hx], [0, 1, 0, hy], [0, -1, 0, hy]], None
    else:
        (cx, cy), more = outline.corners, RIM * size
        plan, rounded = [], Outline((hx + more, hy + more), (cx + more, cy + more))
    domain = _domain([*plan, [0, 0, 1, -surface.low], [0, 0, -1, surface.high]], size)
    return GraphFace(backend, surface.jet, outward, domain, surface.cell, size, surface, rounded, trim)


def _edge_face(edge: _Edge, size: float) -> GraphFace:
    step = edge.along[1] - edge.along[0]
    across = min(edge.across) * min(
        s.cell[1 - edge.axis] / s.half_width[1 - edge.axis] for s in edge.surfaces
    )
    cell = (abs(step) / 2, across) if edge.axis == 0 else (across, abs(step) / 2)
    # where the rear is wider, air lies before the edge, else behind it
    return GraphFace(edge.backend, edge.height, -float(np.sign(step)), edge.domain(size), cell, size)


def _domain(rows: Sequence[Sequence[float]], size: float) -> Floats:
    """Return unit rows; those that bound the plan are widened by RIM, those that bound z by ROOM."""
    domain = np.array(rows, dtype=float)
    domain /= np.linalg.norm(domain[:, :3], axis=1, keepdims=True)
    domain[:, 3] += size * np.where(domain[:, 2] == 0, RIM, ROOM)
    return domain
