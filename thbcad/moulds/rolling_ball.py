"""Rounded edges: the surface under a ball that rolls along a wall and a front or rear, touching both.

At each parameter t of the outline the ball touches the wall at W and the front or rear at P, where the
outward unit normals are m and n.  Its centre is C = W - r m = P - r n, and its arc from W to P is the
rational parabola with the poles W, Q, P and the weights 1, w, 1:

    Q = C + r (m + n) / (1 + m.n),    w = sqrt((1 + m.n) / 2).

Source: L. Piegl, W. Tiller, The NURBS Book, 7.3 (circular arcs).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from thbcad.checks import Floats
from thbcad.lens import FreeformSurface, Lens
from thbcad.moulds.drafted_walls import DraftedWall
from thbcad.moulds.wall_rims import NODES, SAMPLES, FittedPiece, Foot, Lines, crossings, knot_lines
from thbcad.outlines import DEGREE, fitted_curve, merged_breaks
from thbcad.splines import KnotVector, NURBSSurface, gauss_rule

STEPS = 40  # of Newton's method, which doubles its digits near the end
FOUND = 1e-12  # mm, relative to the size of the wall
ARC = KnotVector.uniform(2, 1)
ARC_NODES = 20  # of the Gauss rule across an arc of less than half a turn: rounding errors
ROUGH = 1025  # samples of a piece at which the ball must roll on, and from which it starts elsewhere


@dataclass(frozen=True, eq=False)
class RoundedPiece:
    """The rounded edge along one piece of an outline, t, from the front or rear to the wall.

    kv : of t
    on_surface, on_wall : (n, 3), mm, poles of the curves along which the ball touches
    middle, weights : (n, 3), mm, and (n,), poles and weights of the row between them
    """

    kv: KnotVector
    on_surface: Floats
    middle: Floats
    weights: Floats
    on_wall: Floats

    @cached_property
    def surface(self) -> NURBSSurface:
        """The rational surface (t, v), v from 0 on the front or rear to 1 on the wall."""
        poles = np.stack([self.on_surface, self.middle, self.on_wall], axis=1)
        one = np.ones(len(poles))
        return NURBSSurface(self.kv, ARC, poles, np.stack([one, self.weights, one], axis=1))

    def volume_above(self, level: float) -> float:
        """Return the integral of z - level over its plan, mm^3, by Gauss rules."""
        (t, along), (v, across) = gauss_rule(self.kv.breaks, NODES), gauss_rule(ARC.breaks, ARC_NODES)
        point, by_t, by_v = (self.surface.grid(t, v, orders) for orders in ((0, 0), (1, 0), (0, 1)))
        plan = by_v[..., 0] * by_t[..., 1] - by_v[..., 1] * by_t[..., 0]
        return float(along @ ((point[..., 2] - level) * plan) @ across)


@dataclass(frozen=True, eq=False)
class RoundedEdge:
    """The rounded edge between a wall and the front (0) or the rear (1), by the pieces of the outline."""

    number: int
    pieces: Sequence[RoundedPiece]

    @property
    def surfaces(self) -> list[NURBSSurface]:
        """The surface of every piece, whose second parameter rises with z."""
        return [_turned(piece.surface) if self.number else piece.surface for piece in self.pieces]

    def volume_above(self, level: float) -> float:
        """Return the integral of z - level over its plan, mm^3."""
        return sum(piece.volume_above(level) for piece in self.pieces)

    @property
    def on_surface(self) -> Foot:
        """Where the front or rear ends."""
        return Foot(tuple(FittedPiece(piece.kv, piece.on_surface) for piece in self.pieces), None)

    @property
    def on_wall(self) -> Foot:
        """Where the wall ends."""
        return Foot(tuple(FittedPiece(piece.kv, piece.on_wall) for piece in self.pieces), None)


def rounded_edge(wall: DraftedWall, lens: Lens, number: int, radius: float) -> RoundedEdge:
    """Return the edge between a wall and the front (0) or the rear (1) of a lens, rounded by a ball, within
    1e-9 mm at eight points of every span.

    radius : mm

    Raises ValueError : no ball of this radius touches both everywhere, or it does not roll on steadily.
    """
    surface, vertex = (lens.front, lens.rear)[number], number * lens.thickness
    lines = knot_lines(surface)
    count = len(wall.outline.pieces)
    pieces = [_Ball(wall, surface, vertex, k, radius).piece(lines) for k in range(count)]
    return RoundedEdge(number, pieces)


@dataclass(frozen=True, eq=False)
class _Ball:
    """A ball that rolls along piece k of a wall and a front or rear at z = vertex."""

    wall: DraftedWall
    surface: FreeformSurface
    vertex: float
    k: int
    radius: float

    def piece(self, lines: Lines) -> RoundedPiece:
        """Return the rounded edge; lines : of the front or rear, across which it is less smooth."""
        ends = self.wall.outline.pieces[self.k].ends
        size = max(self.wall.outline.half_width)  # so that weights are met as well as points

        def rows(t: Floats) -> Floats:
            on_surface, n, on_wall, m = self.contacts(t)
            turn = 1 + (m * n).sum(axis=1, keepdims=True)
            weight = np.sqrt(turn / 2)
            middle = on_wall - self.radius * m + self.radius * (m + n) / turn
            return np.hstack([on_surface, on_wall, weight * middle, size * weight])

        self._require_steady(np.linspace(*ends, ROUGH))
        places, counts = crossings(lambda t: self.contacts(t)[0], np.linspace(*ends, SAMPLES), lines)
        # normals have one derivative less than the surface
        breaks, needed = merged_breaks(places, np.minimum(counts + 1, DEGREE), *ends)
        kv, poles = fitted_curve(rows, breaks, needed)
        weights = poles[:, 9] / size
        return RoundedPiece(kv, poles[:, :3], poles[:, 6:9] / weights[:, None], weights, poles[:, 3:6])

    def contacts(self, t: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Return where the ball touches front or rear and the outward unit normal there, and the same of the
        wall, (n, 3) each."""
        start = np.array([np.interp(t, self._samples[0], row) for row in self._samples[1:]])
        return self._found(t, start)

    @cached_property
    def _samples(self) -> Floats:
        """Rows t, x, y of contacts with front or rear, and z of those with the wall, (4, n)."""
        t = np.linspace(*self.wall.outline.pieces[self.k].ends, ROUGH)
        z = self.wall.heights(self.k, t, self.surface, self.vertex)
        x, y, _, _ = self.wall.points(self.k, t, z)
        inward = self.radius * self._wall_normal(t)[:, :2].T
        x, y = x - inward[0], y - inward[1]
        z = self.vertex + self.surface(*self._within(x, y)) - self.wall.side * self.radius
        on_surface, _, on_wall, _ = self._found(t, np.array([x, y, z]))
        return np.array([t, *on_surface[:, :2].T, on_wall[:, 2]])

    def _found(self, t: Floats, start: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Return the `contacts` by Newton's method from x and y on front or rear and z on the wall, (3, n).

        Raises ValueError : it does not end.
        """
        wall, m = self.wall, self._wall_normal(t)
        slope = wall.slope * wall.side
        limit = FOUND * (abs(wall.level) + sum(self.surface.half_width))
        x, y, z = start
        for _ in range(STEPS):
            point, n, by_x, by_y = self._jet(x, y)
            foot_x, foot_y, u, v = wall.points(self.k, t, z)
            foot = np.column_stack([foot_x, foot_y, z])
            rest = point - self.radius * n - foot + self.radius * m
            if not (abs(rest) > limit).any():
                return point, n, foot, m
            columns = [by_x, by_y, -np.column_stack([slope * u, slope * v, np.ones_like(z)])]
            step = _solved(np.stack(columns, axis=-1), rest)
            x, y, z = x - step[:, 0], y - step[:, 1], z - step[:, 2]
        raise ValueError("no ball of this radius touches wall and surface")

    def _wall_normal(self, t: Floats) -> Floats:
        """Return outward unit normals of the wall, (n, 3)."""
        dx, dy = self.wall.outline.pieces[self.k](t, 1)
        draft = np.radians(self.wall.draft)
        outward = np.cos(draft) * np.array([dy, -dx]) / np.hypot(dx, dy)
        return np.column_stack([*outward, np.full(len(t), self.wall.side * np.sin(draft))])

    def _jet(self, x: Floats, y: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Return points of front or rear, outward unit normals, and the derivatives of the ball's centre with
        respect to x and y, (n, 3) each."""
        surface, (a, b) = self.surface, self._within(x, y)
        zx, zy = surface(a, b, (1, 0)), surface(a, b, (0, 1))
        zxx, zxy, zyy = (surface(a, b, orders) for orders in ((2, 0), (1, 1), (0, 2)))
        one, none = np.ones_like(x), np.zeros_like(x)
        z = self.vertex + surface(a, b) + zx * (x - a) + zy * (y - b)
        up = np.column_stack([-zx, -zy, one])
        length = np.linalg.norm(up, axis=1)[:, None]

        def moved(step: Floats, dx: Floats, dy: Floats) -> Floats:
            turned = np.column_stack([-dx, -dy, none]) / length
            turned -= up * (zx * dx + zy * dy)[:, None] / length**3
            return np.asarray(step - self.radius * self.wall.side * turned)

        by_x = moved(np.column_stack([one, none, zx]), zxx, zxy)
        by_y = moved(np.column_stack([none, one, zy]), zxy, zyy)
        return np.column_stack([x, y, z]), self.wall.side * up / length, by_x, by_y

    def _within(self, x: Floats, y: Floats) -> tuple[Floats, Floats]:
        """Return points moved into the rectangle of front or rear, where Newton's method may leave it."""
        hx, hy = self.surface.half_width
        return np.clip(x, -hx, hx), np.clip(y, -hy, hy)

    def _require_steady(self, t: Floats) -> None:
        """Raise ValueError unless the ball and both contacts move on, and front or rear bend away from the
        ball where it touches them: 1 - radius x curvature is positive in both directions."""
        on_surface, n, on_wall, _ = self.contacts(t)
        dx, dy = self.wall.outline.pieces[self.k]((t[1:] + t[:-1]) / 2, 1)
        for line in (on_surface, on_wall, on_surface - self.radius * n):
            step = np.diff(line, axis=0)
            if not (step[:, 0] * dx + step[:, 1] * dy > 0).all():
                raise ValueError("a ball of this radius is too large for a corner of the wall")
        x, y, _ = on_surface.T
        sharp = replace(self, radius=0.0)
        points, centres = (ball._jet(x, y)[2:] for ball in (sharp, self))
        ratio = np.linalg.solve(_products(points, points), _products(points, centres))
        if not ((np.linalg.det(ratio) > 0) & (np.trace(ratio, axis1=1, axis2=2) > 0)).all():
            raise ValueError("a ball of this radius is too large for a bend of the surface")


def _turned(surface: NURBSSurface) -> NURBSSurface:
    """Return a surface over [0, 1] in v with v turned round."""
    return NURBSSurface(surface.kv_u, surface.kv_v, surface.coefficients[:, ::-1], surface.weights[:, ::-1])


def _solved(matrices: Floats, right: Floats) -> Floats:
    """Return the solutions of linear systems (n, 3, 3); raise ValueError where there is none."""
    try:
        return np.asarray(np.linalg.solve(matrices, right[..., None])[..., 0], dtype=np.float64)
    except np.linalg.LinAlgError:
        raise ValueError("no ball of this radius touches wall and surface") from None


def _products(rows: Sequence[Floats], columns: Sequence[Floats]) -> Floats:
    """Return the inner products of vectors (n, 3) as matrices, (n, 2, 2)."""
    products: Floats = np.einsum("ink,jnk->nij", np.stack(rows), np.stack(columns))
    return products
