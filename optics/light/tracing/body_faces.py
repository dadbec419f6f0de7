"""The faces of a body for a mould, and where rays meet them: trimmed front and rear, drafted walls, the land;
and those of a plate of lenses.

At the height z a wall encloses its outline, inset by k (z - level), k = +-tan(draft).  With the middles m of
the corners and their semi-axes c, and p = (|x| - mx, |y| - my) / c, that is

    |x| <= hx - k (z - level),    |y| <= hy - k (z - level),    |p| <= 1 - k (z - level) / c  beyond both m,

a convex region: a line o + t d lies in it from one t to another, in closed form.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Protocol

import numpy as np

from optics.base.runtime import Backend, DrArray
from optics.light.intersections import DeviceRays, PlacedSurface
from optics.light.tracing.graph_face import START, GraphFace, Jet, Meeting
from optics.light.tracing.lens_faces import RIM, PlaneFace, lens_faces, surface_face
from thbcad.checks import Bools, Floats
from thbcad.lens import FreeformSurface, Lens
from thbcad.moulds import DraftedWall, MouldedBody, Plate

FAR = 1e3  # of an outline, and so far beyond: where lines that leave it nowhere are looked at


class Face(Protocol):
    """A face of a closed body."""

    def reach(self, rays: DeviceRays) -> DrArray:
        """Return the path, mm, before which no ray meets the face; inf where it misses it for certain."""
        ...

    def meet(self, rays: DeviceRays) -> Meeting:
        """Return the Meeting of rays with the face."""
        ...


class WalledRegion:
    """What a wall encloses, endless along z, wider by `reach`, mm."""

    def __init__(self, backend: Backend, wall: DraftedWall, reach: float = 0.0) -> None:
        self.backend, self._rounded = backend, not wall.outline.is_rectangle
        opaque = backend.opaque
        corners = [c + reach if self._rounded else 1.0 for c in wall.outline.corners]
        half = [h + reach for h in wall.outline.half_width]
        self._half, self._corners = [opaque(h) for h in half], [opaque(c) for c in corners]
        self._middles = [opaque(h - c * self._rounded) for h, c in zip(half, corners)]
        slope = wall.slope * wall.side
        self._level, self._slope = opaque(wall.level), opaque(slope)
        self._rate, self._far = opaque(slope / corners[0]), opaque(FAR * max(half))

    def interval(self, rays: DeviceRays) -> tuple[DrArray, DrArray]:
        """Return the path lengths, start > stop for none, between which lines of rays are inside."""
        dr, Float = self.backend.dr, self.backend.Float
        (ox, oy, oz), (dx, dy, dz) = rays.origin, rays.direction
        start, stop = Float(-dr.inf), Float(dr.inf)
        for h, o, d in zip(self._half, (ox, oy), (dx, dy)):
            for sign in (1.0, -1.0):
                room, rate = h - sign * o - self._slope * (oz - self._level), sign * d + self._slope * dz
                start = dr.select(rate < 0, dr.maximum(start, room / rate), start)
                stop = dr.select(rate > 0, dr.minimum(stop, room / rate), stop)
                stop = dr.select((rate == 0) & (room < 0), -dr.inf, stop)
        if not self._rounded:
            return start, stop
        met, far = start <= stop, self._far + dr.sqrt(ox * ox + oy * oy + oz * oz)
        (first, misses), (last, passes) = (
            self._at_corner(rays, end, dr.clip(end, -far, far), side)
            for end, side in ((start, -1), (stop, 1))
        )
        met &= ~misses & ~passes
        return dr.select(met, first, 1), dr.select(met, last, 0)

    def _at_corner(self, rays: DeviceRays, end: DrArray, near: DrArray, side: int) -> tuple[DrArray, DrArray]:
        """Return where lines enter (side -1) or leave (+1) the whole cone of the corner in which they end,
        and which miss it.  near : the end, or a place of lines without one.

        |p + t q|^2 = (rho - t k dz / c)^2 is A t^2 + 2 B t + C = 0.
        """
        dr = self.backend.dr
        at_corner, p, q = True, [], []
        for o, d, m, c in zip(rays.origin, rays.direction, self._middles, self._corners):
            a = o + near * d
            at_corner = at_corner & (dr.abs(a) > m)
            p.append((o - dr.copysign(m, a)) / c)
            q.append(d / c)
        rho, fall = 1 - self._rate * (rays.origin[2] - self._level), self._rate * rays.direction[2]
        a = q[0] * q[0] + q[1] * q[1] - fall * fall
        b = p[0] * q[0] + p[1] * q[1] + rho * fall
        c = p[0] * p[0] + p[1] * p[1] - rho * rho
        square = b * b - a * c
        root = dr.sqrt(dr.maximum(square, 0))
        # the form in which nothing cancels
        other = side * b >= 0
        t = dr.select(other, c, side * root - b) / dr.select(other, -side * root - b, a)
        # steeper than the cone a line ends on one side alone; upright ones stay where they are
        endless = ~dr.isfinite(end) & (a <= 0)
        t = dr.select(at_corner & ~endless, t, end)
        return t, at_corner & dr.select(endless, (fall == 0) & (c > 0), square < 0)

    def holds(self, point: Jet) -> DrArray:
        """Return the mask of points inside."""
        dr = self.backend.dr
        (x, y, z), inset = point, self._slope * (point[2] - self._level)
        inside = (dr.abs(x) <= self._half[0] - inset) & (dr.abs(y) <= self._half[1] - inset)
        if not self._rounded:
            return inside
        p = [dr.maximum(dr.abs(a) - m, 0) / c for a, m, c in zip((x, y), self._middles, self._corners)]
        rho = 1 - self._rate * (z - self._level)
        return inside & ((p[0] == 0) | (p[1] == 0) | (p[0] * p[0] + p[1] * p[1] <= rho * rho))

    def normal(self, point: Jet) -> Jet:
        """Return outward unit normals at points of the wall."""
        dr = self.backend.dr
        over = [dr.abs(a) - h for a, h in zip(point, self._half)]
        on_x = over[0] > over[1]
        plan = dr.select(on_x, self.backend.Float(1), 0), dr.select(on_x, self.backend.Float(0), 1)
        if self._rounded:
            beyond = [dr.abs(a) - m for a, m in zip(point, self._middles)]
            at_corner = (beyond[0] > 0) & (beyond[1] > 0)
            u, v = (a / (c * c) for a, c in zip(beyond, self._corners))
            per = dr.rsqrt(u * u + v * v)
            plan = dr.select(at_corner, per * u, plan[0]), dr.select(at_corner, per * v, plan[1])
        length = dr.rsqrt(1 + self._slope * self._slope)
        nx, ny = (dr.copysign(length * n, a) for n, a in zip(plan, point))
        return nx, ny, length * self._slope


@dataclass(eq=False)
class DraftedFace:
    """The part of a wall on one side of its level, as far as a surface, or a land, ends it.

    side : +1 above the level.  within : whether glass is what the wall encloses.
    graph : the surface; towards : +1 where the face lies below it, else -1.  None where a land ends the face.
    """

    region: WalledRegion
    wall: DraftedWall
    within: bool
    size: float
    graph: GraphFace | None = None
    land: float | None = None

    def __post_init__(self) -> None:
        opaque = self.region.backend.opaque
        self._near, self._level = opaque(START * self.size), opaque(self.wall.level)
        self._side, self._sign = opaque(self.wall.side), opaque(1.0 if self.within else -1.0)
        self._end = None if self.land is None else opaque(self.land)

    def reach(self, rays: DeviceRays) -> DrArray:
        """Return the path at which rays meet the endless wall; inf where they do not."""
        dr = self.region.backend.dr
        start, stop = self.region.interval(rays)
        t = dr.select(rays.inside == self.within, stop, start)
        found = (start <= stop) & (t >= -self._near) & dr.isfinite(t)
        return dr.select(found, dr.maximum(t, 0), dr.inf)

    def meet(self, rays: DeviceRays) -> Meeting:
        """Return the Meeting of rays with the face."""
        dr, Float = self.region.backend.dr, self.region.backend.Float
        reach = self.reach(rays)
        found = dr.isfinite(reach)
        t = dr.select(found, reach, 0)
        x, y, z = rays.at(t)
        found &= self._side * (z - self._level) >= -self._near
        end = self._end
        if self.graph is not None:
            end = self.graph.height(x, y)[0]
        if end is not None:
            found &= self._side * (end - z) >= -self._near
        nx, ny, nz = (self._sign * n for n in self.region.normal((x, y, z)))
        return Meeting(dr.select(found, t, dr.inf), (nx, ny, nz), Float(dr.inf))


def body_faces(backend: Backend, body: MouldedBody) -> list[Face]:
    """Return front, rear, the outer wall below and above the parting line, the land and the step."""
    lens, small, inner = body.lens, body.small, body.inner
    size = max(*lens.front.half_width, *lens.rear.half_width, lens.thickness)
    surfaces = [PlacedSurface(backend, lens.front, 0.0), PlacedSurface(backend, lens.rear, lens.thickness)]
    regions = [WalledRegion(backend, wall) for wall in body.walls]
    trims = [WalledRegion(backend, body.wall(k), RIM * size) for k in (0, 1)]
    graphs = [
        surface_face(backend, s, shape.outline, outward, size, trim.interval)
        for s, shape, outward, trim in zip(surfaces, (lens.front, lens.rear), (-1.0, 1.0), trims)
    ]
    faces: list[Face] = [*graphs]
    for k, (wall, region) in enumerate(zip(body.walls, regions)):
        if inner is None or small != k:
            faces.append(DraftedFace(region, wall, True, size, graphs[k]))
        elif inner.level != wall.level:
            faces.append(DraftedFace(region, wall, True, size, land=inner.level))
    if inner is not None and small is not None:
        outward = (-1.0, 1.0)[small]
        outer, hole = WalledRegion(backend, body.walls[small], RIM * size), WalledRegion(backend, inner)

        def on_land(point: Jet) -> DrArray:
            return outer.holds(point) & ~hole.holds(point)

        faces.append(PlaneFace(backend, 2, outward, outward * inner.level, size, on_land))
        if body.stepped:
            faces.append(DraftedFace(hole, inner, inner.side == outward, size, graphs[small]))
    return faces


@dataclass(frozen=True, eq=False)
class PlateFaces:
    """Faces of one lens of a plate or of its land, and where that lies.

    shift : (3,), mm, from its own frame to that of the plate.
    box : (2, 3), mm, least and greatest corner of what holds the faces, in the own frame.
    """

    faces: Sequence[Face]
    shift: Floats
    box: Floats

    def reached(self, origin: Floats, direction: Floats) -> Bools:
        """Return which rays (3, n) meet the box."""
        start = origin - self.shift[:, None]
        with np.errstate(divide="ignore", invalid="ignore"):  # within a plane of the box, nan is neither
            t = (self.box[:, :, None] - start) / direction
        near, far = np.nanmin(t, axis=0).max(axis=0), np.nanmax(t, axis=0).min(axis=0)
        return (near <= far) & (far >= 0)


def plate_faces(backend: Backend, plate: Plate) -> list[PlateFaces]:
    """Return the faces of every lens, without those parts of its walls that lie in the land, and the land's,
    without what the lenses fill."""
    lens, (mx, my) = plate.lens, plate.middle
    front, rear, *walls = lens_faces(backend, lens)
    size = max(*lens.front.half_width, *lens.rear.half_width, lens.thickness)
    low, high = map(backend.opaque, (plate.low, plate.high))
    faces: list[Face] = [front, rear]

    def beside_land(wall: PlaneFace, point: Jet) -> DrArray:
        return wall.holds(point) & ((point[2] <= low) | (point[2] >= high))

    for wall in walls:
        if isinstance(wall, GraphFace):  # which rays may meet again beyond the land
            ends = [0, 0, -1, plate.low + RIM * size], [0, 0, 1, RIM * size - plate.high]
            faces += [replace(wall, domain=np.vstack([wall.domain, end])) for end in ends]
        elif isinstance(wall, PlaneFace):
            faces.append(replace(wall, holds=partial(beside_land, wall)))
    flat, thick = FreeformSurface(plate.outline.half_width), plate.high - plate.low
    _, _, *sides = lens_faces(backend, Lens(flat, flat, thick, plate.index))
    between = _between_lenses(backend, plate, [w for w in walls if isinstance(w, GraphFace)], RIM * size)
    planes = (PlaneFace(backend, 2, *plane, size, between) for plane in ((-1.0, 0.0), (1.0, thick)))
    land = [*planes, *sides]
    heights = np.concatenate([g.coefficients.ravel() + z for g, z in zip(lens.graphs(), (0, lens.thickness))])
    half, more = np.max([lens.front.half_width, lens.rear.half_width], axis=0), 1e-6 * size
    box = np.array([[*-half, heights.min()], [*half, heights.max()]])
    box += [[-more], [more]]
    top = np.array([*flat.half_width, plate.high - plate.low])
    wide = np.array([top * (-1, -1, 0) - more, top + more])
    return [
        *(PlateFaces(faces, np.array([x, y, 0.0]), box) for x, y in plate.places),
        PlateFaces(land, np.array([mx, my, plate.low]), wide),
    ]


def _between_lenses(
    backend: Backend, plate: Plate, slanted: Sequence[GraphFace], more: float
) -> Callable[[Jet], DrArray]:
    """Return the mask of points of the land, in its own frame, that no lens fills.

    slanted : walls of one.  more : mm, by which the land reaches over its rim.
    """
    dr, opaque = backend.dr, backend.opaque
    lens, level = plate.lens, opaque(plate.low)
    half = [opaque(max(pair)) for pair in zip(lens.front.half_width, lens.rear.half_width)]
    wide = [opaque(h + more) for h in plate.outline.half_width]
    pitch, last = [opaque(p) for p in plate.pitch], [opaque(n - 1.0) for n in plate.counts]

    def between(point: Jet) -> DrArray:
        own = []
        for a, step, most in zip(point, pitch, last):
            number = dr.clip(dr.round(a / step + most / 2), 0, most)  # of the nearest lens
            own.append(a - step * (number - most / 2))
        x, y, z = *own, point[2] + level
        filled = (dr.abs(x) <= half[0]) & (dr.abs(y) <= half[1])
        for wall in slanted:
            filled &= ~wall.covers(x, y) | wall.encloses((x, y, z))
        return (dr.abs(point[0]) <= wide[0]) & (dr.abs(point[1]) <= wide[1]) & ~filled

    return between
