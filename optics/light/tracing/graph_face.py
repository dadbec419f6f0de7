"""Faces that are graphs z = Z(x, y) over convex pieces of the plan, and where rays meet them.

A ray meets a face where it passes from its own side to the other (glass to air or air to glass); a crossing
the opposite direction does not count, so a ray may start on a face without meeting it again there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

from optics.base.runtime import Backend, DrArray
from optics.light.intersections import DeviceRays, PlacedSurface, chord, first_crossing, last_root
from thbcad.checks import Floats
from thbcad.outlines import Outline

Jet: TypeAlias = "tuple[DrArray, DrArray, DrArray]"  # Z, dZ/dx, dZ/dy, or a vector
Trim: TypeAlias = "Callable[[DeviceRays], tuple[DrArray, DrArray]]"

START = 1e-10  # of the lens's size: a ray that starts so near a face is on its own side of it


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
    domain : (m, 4) rows (a, b, c, e) with unit (a, b, c); two of them bound z.
    cell : lengths in x and y, mm, within which Z is smooth.
    surface : where the face is one, its first meetings are proven; else paths are sampled, twice a cell.
    outline : with rounded corners, which bounds the plan instead of rows.
    trim : rays -> path lengths, start > stop for none, between which their lines are in a convex region that
        bounds the face, too.
    """

    backend: Backend
    height: Callable[[DrArray, DrArray], Jet]
    outward: float
    domain: Floats
    cell: tuple[float, float]
    size: float
    surface: PlacedSurface | None = None
    outline: Outline | None = None
    trim: Trim | None = None

    def __post_init__(self) -> None:
        opaque = self.backend.opaque
        self._rows = [[*map(opaque, row)] for row in self.domain]
        self._side = opaque(self.outward)
        self._per_cell = [opaque(1 / c) for c in self.cell]
        self._near, self._resolution = opaque(START * self.size), opaque(2.0**-51 * self.size)

    def reach(self, rays: DeviceRays) -> DrArray:
        """Return the path at which rays come into the domain; inf where they do not."""
        dr = self.backend.dr
        start, stop = self._interval(rays)
        return dr.select(start <= stop, start, dr.inf)

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
        if self.outline is not None:
            enters, leaves = chord(self.backend, self.outline, (ox, oy), (dx, dy))
            start, stop = dr.maximum(start, enters), dr.minimum(stop, leaves)
        if self.trim is not None:
            enters, leaves = self.trim(rays)
            start, stop = dr.maximum(start, enters), dr.minimum(stop, leaves)
        return start, stop
