"""The six faces of the closed lens, and where rays meet them.

Front, rear and slanted edges are graphs z = Z(x, y) over convex pieces of the plan; edges between
rims of equal half-width are walls, pieces of a plane x = const or y = const.  A ray meets a face
where it passes from its own side to the other (glass to air or air to glass); a crossing the
opposite direction does not count, so a ray may start on a face without meeting it again there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from optics.base.runtime import Backend, DrArray
from optics.light.intersections import DeviceRays, PlacedSurface, first_crossing, last_root
from thbcad.checks import Floats
from thbcad.lens import Lens

Jet: TypeAlias = "tuple[DrArray, DrArray, DrArray]"  # Z, dZ/dx, dZ/dy, or a vector

RIM = 1e-12  # of the lens's size: faces reach this far over their rims, so that no gap opens between them
START = 1e-10  # of the lens's size: a ray that starts so near a face is on its own side of it
WALL = 1e-9  # of the lens's size: rims whose half-widths differ by less are joined by a wall


@dataclass(frozen=True, eq=False)
class Meeting:
    """Where rays meet a face: path length, mm, inf where they miss it, and the outward unit normal.

    doubt : mm, from where on it is not decided whether the face is met; inf where it is.
    """

    path: DrArray
    normal: Jet
    doubt: DrArray


@dataclass(eq=False)
class GraphFace:
    """The face z = Z(x, y) where a x + b y + c z + e >= 0 for every row of the domain.

    height : x, y -> Z, Zx, Zy.  outward : +1 where air lies at greater z, else -1.
    domain : (m, 4) rows (a, b, c, e) with unit (a, b, c); two of them bound z, loosely.
    cell : lengths in x and y, mm, within which Z is smooth.
    surface : where the face is one, its first meetings are proven; else paths are sampled, twice a cell.
    """

    backend: Backend
    height: Callable[[DrArray, DrArray], Jet]
    outward: float
    domain: Floats
    cell: tuple[float, float]
    size: float
    surface: PlacedSurface | None = None

    def __post_init__(self) -> None:
        # opaque numbers do not become part of the kernels, which then serve every lens
        self._rows = [[self._opaque(value) for value in row] for row in self.domain]
        self._side = self._opaque(self.outward)
        self._per_cell = [self._opaque(1 / c) for c in self.cell]
        self._near, self._resolution = self._opaque(START * self.size), self._opaque(2.0**-51 * self.size)

    def meet(self, rays: DeviceRays) -> Meeting:
        """Return the Meeting of rays with the face."""
        dr = self.backend.dr
        side = dr.select(rays.inside, self._side, -self._side)
        start, stop = self._interval(rays)

        def f(t: DrArray) -> Jet:
            """Return the ray's depth on the other side, its rate, and the length of (-Zx, -Zy, 1)."""
            x, y, z = rays.at(t)
            dx, dy, dz = rays.direction
            height, zx, zy = self.height(x, y)
            return side * (z - height), side * (dz - zx * dx - zy * dy), dr.sqrt(1 + zx * zx + zy * zy)

        value, _, scale = f(start)
        on = (start <= 0) & (dr.abs(value) <= self._near * scale)
        before = (value < 0) | on
        doubt = self.backend.Float(dr.inf)
        if self.surface is None:
            crossed = [dr.abs(d) * (stop - start) * c for d, c in zip(rays.direction, self._per_cell)]
            count = dr.ceil(2 * dr.maximum(*crossed)) + 2
            low, high, found = first_crossing(self.backend, f, (start, stop), count, before)
        else:
            fall = self.surface.first_fall(rays, side > 0, (start, stop), before & (start < stop), on)
            low, high = fall.low, fall.high
            ahead = before & (low < high)
            # where f falls to the end of the ray, the meeting may lie beyond
            found = ahead & fall.resolved & ((high < stop) | (f(high)[0] >= 0))
            doubt = dr.select(ahead & ~fall.resolved, low, doubt)
        t = last_root(self.backend, f, (low, high), found, self._resolution)
        x, y, _ = rays.at(t)
        _, zx, zy = self.height(x, y)
        length = self._side * dr.rsqrt(1 + zx * zx + zy * zy)
        return Meeting(dr.select(found, t, dr.inf), (-zx * length, -zy * length, length), doubt)

    def covers(self, x: DrArray, y: DrArray) -> DrArray:
        """Return the mask of points whose plan lies in the domain."""
        inside = True
        for (a, b, _, e), row in zip(self._rows, self.domain):
            if row[2] == 0:
                inside = inside & (a * x + b * y + e >= 0)
        return inside

    def encloses(self, point: Jet) -> DrArray:
        """Return the mask of points on the glass's side, or on the face."""
        x, y, z = point
        height, zx, zy = self.height(x, y)
        return self._side * (z - height) <= self._near * self.backend.dr.sqrt(1 + zx * zx + zy * zy)

    def _interval(self, rays: DeviceRays) -> tuple[DrArray, DrArray]:
        """Return the path lengths, start > stop for none, between which the ray is in the domain."""
        dr, Float = self.backend.dr, self.backend.Float
        start, stop = Float(0), Float(dr.inf)
        (ox, oy, oz), (dx, dy, dz) = rays.origin, rays.direction
        for a, b, c, e in self._rows:
            here, rate = a * ox + b * oy + c * oz + e, a * dx + b * dy + c * dz
            t = -here / rate
            start = dr.select(rate > 0, dr.maximum(start, t), start)
            stop = dr.select(rate < 0, dr.minimum(stop, t), stop)
            stop = dr.select((rate == 0) & (here < 0), -1, stop)
        return start, stop

    def _opaque(self, value: float) -> DrArray:
        return self.backend.dr.opaque(self.backend.Float, float(value))


@dataclass(eq=False)
class WallFace:
    """The part of a plane that the graph faces enclose.

    The plane is s x = half_width (axis 0) or s y = half_width (axis 1), s = +-1.
    """

    backend: Backend
    axis: int
    sign: float
    half_width: float
    graphs: list[GraphFace]

    def __post_init__(self) -> None:
        self._sign, self._half = (
            self.backend.dr.opaque(self.backend.Float, float(a)) for a in (self.sign, self.half_width)
        )

    def meet(self, rays: DeviceRays) -> Meeting:
        """Return the Meeting of rays with the face."""
        dr, Float = self.backend.dr, self.backend.Float
        speed = self._sign * rays.direction[self.axis]
        t = (self._half - self._sign * rays.origin[self.axis]) / speed
        start = -START * self.half_width
        found = ((speed > 0) == rays.inside) & (speed != 0) & (t >= start)
        t = dr.maximum(t, 0)
        x, y, z = rays.at(t)
        if self.axis == 0:
            x = self._sign * self._half
        else:
            y = self._sign * self._half
        covered = False
        for face in self.graphs:
            above = face.covers(x, y)
            covered = above | covered
            found = found & (~above | face.encloses((x, y, z)))
        zero = Float(0)
        normal = (self._sign, zero, zero) if self.axis == 0 else (zero, self._sign, zero)
        return Meeting(dr.select(found & covered, t, dr.inf), normal, Float(dr.inf))


def lens_faces(backend: Backend, lens: Lens) -> list[GraphFace | WallFace]:
    """Return the front, the rear and the edges +x, -x, +y, -y."""
    size = max(*lens.front.half_width, *lens.rear.half_width, lens.thickness)
    surfaces = [PlacedSurface(backend, lens.front, 0.0), PlacedSurface(backend, lens.rear, lens.thickness)]
    rims = list(zip(lens.front.half_width, lens.rear.half_width))
    graphs = [_surface_face(backend, s, outward, size) for s, outward in zip(surfaces, (-1.0, 1.0))]
    sides = [(axis, sign) for axis in (0, 1) for sign in (1.0, -1.0)]
    slanted = [side for side in sides if abs(np.subtract(*rims[side[0]])) > WALL * size]
    graphs += [_edge_face(_Edge(surfaces, *side), size) for side in slanted]
    walls = [
        WallFace(backend, axis, sign, min(rims[axis]), graphs)
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
        numbers = (
            sign,
            *self.along,
            *self.across,
            self.along[1] - self.along[0],
            self.across[1] - self.across[0],
        )
        self._numbers = [backend.dr.opaque(backend.Float, float(n)) for n in numbers]

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

    def plan(self) -> list[list[float]]:
        """Return the rows of the domain that bound x and y."""
        (a_front, a_rear), (b_front, b_rear) = self.along, self.across
        grows, rate = np.sign(a_rear - a_front), (b_rear - b_front) / (a_rear - a_front)
        rows = [[grows, 0, -grows * a_front], [-grows, 0, grows * a_rear]]
        rows += [[rate, side, b_front - rate * a_front] for side in (1, -1)]
        return [[self.sign * a, b, 0, e] if self.axis == 0 else [b, self.sign * a, 0, e] for a, b, e in rows]


def _surface_face(backend: Backend, surface: PlacedSurface, outward: float, size: float) -> GraphFace:
    hx, hy = surface.half_width
    plan = [[1, 0, 0, hx], [-1, 0, 0, hx], [0, 1, 0, hy], [0, -1, 0, hy]]
    domain = _domain(plan, surface.low, surface.high, size)
    return GraphFace(backend, surface.jet, outward, domain, surface.cell, size, surface)


def _edge_face(edge: _Edge, size: float) -> GraphFace:
    step = edge.along[1] - edge.along[0]
    low, high = min(s.low for s in edge.surfaces), max(s.high for s in edge.surfaces)
    across = min(edge.across) * min(
        s.cell[1 - edge.axis] / s.half_width[1 - edge.axis] for s in edge.surfaces
    )
    cell = (abs(step) / 2, across) if edge.axis == 0 else (across, abs(step) / 2)
    # where the rear is wider, air lies before the edge, else behind it
    return GraphFace(
        edge.backend, edge.height, -float(np.sign(step)), _domain(edge.plan(), low, high, size), cell, size
    )


def _domain(plan: list[list[float]], low: float, high: float, size: float) -> Floats:
    """Return unit rows that bound the plan, widened by RIM, and z, with room to spare."""
    room = 1e-6 * size
    rows = np.array([*plan, [0, 0, 1, room - low], [0, 0, -1, high + room]], dtype=float)
    rows /= np.linalg.norm(rows[:, :3], axis=1, keepdims=True)
    rows[: len(plan), 3] += RIM * size
    return rows
