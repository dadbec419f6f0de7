"""Faces as the independent tracer meets them: conics of revolution in closed form, splines by scipy, and the
curves round them."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import NdBSpline
from scipy.optimize.elementwise import find_root

from thbcad.checks import Bools, Floats, Integers
from thbcad.io import Brep, BrepEdge, BrepFace, edge_span
from thbcad.sags import PlacedConic
from thbcad.splines import BSplineSurface, KnotVector

Meetings = tuple[Floats, Floats, Bools]  # points, unit normals towards +z, met

MEETS = 1e-10  # of the face's width: a point so near the rim, or so little behind a ray's origin, lies on it
ROOM = 1e-3  # of the width, above and below the face
SAMPLES = 5  # along every ray, from where it enters the face's box to where it leaves it
HALVINGS = 15  # of steps in which a ray may fall through the face, before Newton's method
NEARBY = 33  # samples along a ray that falls nowhere, of which the nearest is where Newton's method begins
NEAR = 1e-5  # of the face's width: near enough for Newton's method to begin
STILL = 1e-12  # of a direction: components that count as zero
RIM_SAMPLES = 257  # of an edge of a rim
SURE = 0.99  # of the nearer of two samples: between them a rim bends by some 1e-5
RIM_STEPS = 6  # of Newton's from the nearest of them: more than double precision needs
UP = np.array([0.0, 0.0, 1.0])
TINY = 1e-300


class ConicFace:
    """The face c (x^2 + y^2 + (1 + K) z^2) = 2 z over a rectangle, c = 1 / R, z from the vertex.

    A conic that its file bounds by no rectangle has no rim.
    """

    def __init__(self, conic: PlacedConic) -> None:
        self._vertex = conic.vertex * UP
        self._curvature = 1 / conic.conic.radius
        self._scale = np.array([1.0, 1.0, 1 + conic.conic.constant])
        self._half = np.array(conic.half_width)
        self._bounded = bool(np.isfinite(self._half).all())
        self.width = float(2 * self._half.max()) if self._bounded else 1.0

    def intersect(self, points: Floats, directions: Floats) -> Meetings:
        """Return (points, unit normals towards +z, met) of rays on the face.

        Meetings behind the origin, on the far side of the face, and of rays that come in over its rim do not
        count.
        """
        here = points - self._vertex
        on_face, normals = here.copy(), np.tile(UP, (len(here), 1))
        travel = np.full(len(here), np.inf)
        with np.errstate(all="ignore"):  # rays that meet no such quadric give nan, which meets nothing
            for t in self._roots(here, directions):
                point = here + t[:, None] * directions
                normal = self._normals(point)
                ahead = (t >= -MEETS * self.width) & (t < travel)
                meets = (
                    ahead
                    & np.all(abs(point[:, :2]) <= self._half + MEETS * self.width, axis=1)
                    & (normal[:, 2] > 0)
                    & (dot(normal, directions) > 0)
                )
                travel[meets], on_face[meets], normals[meets] = t[meets], point[meets], normal[meets]
        met: Bools = np.asarray(np.isfinite(travel))
        if self._bounded:
            met = met & ~self._behind(here, directions)
        return on_face + self._vertex, normals, met

    def _roots(self, points: Floats, directions: Floats) -> list[Floats]:
        """Return both roots of a t^2 + 2 b t + e = 0, without cancellation and after a step of Newton's."""
        c, scaled = self._curvature, self._scale * directions
        a = c * dot(scaled, directions)
        b = c * dot(scaled, points) - directions[:, 2]
        e = self._excess(points)
        q = -(b + np.copysign(np.sqrt(b * b - a * e), b))
        roots = [e / q, q / a]
        return [t - self._excess(points + t[:, None] * directions) / (2 * (a * t + b)) for t in roots]

    def _excess(self, points: Floats) -> Floats:
        """Return c (x^2 + y^2 + (1 + K) z^2) - 2 z."""
        return self._curvature * dot(self._scale * points, points) - 2 * points[:, 2]

    def _normals(self, points: Floats) -> Floats:
        """Return unit normals; on the sheet through the vertex they point to +z."""
        normals = UP - self._curvature * self._scale * points
        return normals / np.linalg.norm(normals, axis=1, keepdims=True)

    def _heights(self, points: Floats) -> Floats:
        """Return the heights of the face at (x, y), (n, 2), of the rim where they lie beside it."""
        square = (np.clip(points, -self._half, self._half) ** 2).sum(axis=1)
        c = self._curvature
        return c * square / (1 + np.sqrt(1 - self._scale[2] * c * c * square))

    def _behind(self, points: Floats, directions: Floats) -> Bools:
        """Return which rays come into the face's box above the face: they pass its rim."""
        corner = float(self._heights(self._half[None, :])[0])
        room = ROOM * self.width
        low = np.array([*-self._half, min(0.0, corner) - room])
        high = np.array([*self._half, max(0.0, corner) + room])
        with np.errstate(all="ignore"):
            ends = np.stack([(low - points) / directions, (high - points) / directions])
        ends = np.where(directions == 0, [[[-np.inf]], [[np.inf]]], ends)
        enters = np.maximum(ends.min(axis=0).max(axis=1), 0.0)
        here = points + enters[:, None] * directions
        return here[:, 2] - self._heights(here[:, :2]) > MEETS * self.width


class FaceRim:
    """The outer loop of a face in the text of a STEP file, which goes round the axis once.

    The direction from the axis to a point (x, y) meets it where x Y(t) - y X(t) = 0.
    """

    @staticmethod
    def edges(solid: Brep, face: BrepFace) -> list[BrepEdge]:
        """Return the edges of the loop."""
        numbers = {number for number, _ in face.loops[0]}
        return [edge for edge in solid.edges if edge.number in numbers]

    def __init__(self, solid: Brep, face: BrepFace) -> None:
        edges = self.edges(solid, face)
        self._edges = [(edge, span) for edge in edges if (span := edge_span(edge)) is not None]
        spans = [np.linspace(*span, RIM_SAMPLES) for _, span in self._edges]
        points = np.concatenate([edge.points(t)[:, :2] for (edge, _), t in zip(self._edges, spans)])
        angles = np.arctan2(points[:, 1], points[:, 0])
        order = np.argsort(angles)
        self._angles, self._t = angles[order], np.concatenate(spans)[order]
        self._radii = np.hypot(*points[order].T)
        self._owner = np.repeat(np.arange(len(spans)), RIM_SAMPLES)[order]
        self._slack = MEETS * float(np.ptp(points[:, 0]))

    def holds(self, points: Floats) -> Bools:
        """Return which points, (n, 2), lie within the curve or on it, those near it by Newton's method."""
        at = np.searchsorted(self._angles, np.arctan2(points[:, 1], points[:, 0])) % len(self._angles)
        radii = np.hypot(*points.T)
        inside: Bools = radii < SURE * np.minimum(self._radii[at], self._radii[at - 1])
        inside[~inside] = radii[~inside] <= self._reach(points[~inside], at[~inside]) + self._slack
        return inside

    def _reach(self, points: Floats, at: Integers) -> Floats:
        """Return how far the curve lies from the axis in the direction of points between samples, (n,)."""
        reach = np.zeros(len(points))
        for number, (edge, span) in enumerate(self._edges):
            for near in (at, at - 1):  # on either side of a corner another edge may be the one that is met
                own = self._owner[near] == number
                t, (x, y) = self._t[near[own]], points[own].T
                for _ in range(RIM_STEPS):
                    (a, b), (c, d) = edge.points(t)[:, :2].T, edge.points(t, 1)[:, :2].T
                    rate = x * d - y * c
                    t = np.clip(t - (x * b - y * a) / np.where(rate == 0, np.inf, rate), min(span), max(span))
                a, b = edge.points(t)[:, :2].T
                r = np.maximum(np.hypot(x, y), TINY)
                meets = abs(x * b - y * a) <= self._slack * r  # not where Newton's method is held at an end
                reach[own] = np.maximum(reach[own], np.where(meets, (a * x + b * y) / r, 0.0))
        return reach


def dot(a: Floats, b: Floats) -> Floats:
    """Return the products of rows, (n,)."""
    return np.einsum("ij,ij->i", a, b)


class ParametricFace:
    """S(u, v) with poles (n_u, n_v, 3), evaluated by scipy."""

    def __init__(self, surface: BSplineSurface) -> None:
        knots = surface.kv_u.knots, surface.kv_v.knots
        degrees = surface.kv_u.degree, surface.kv_v.degree
        self._spline = NdBSpline(knots, surface.coefficients, degrees)
        self._height = NdBSpline(knots, surface.coefficients[..., 2], degrees)
        self.low = np.array([knots[0][0], knots[1][0]])
        self.high = np.array([knots[0][-1], knots[1][-1]])
        poles = surface.coefficients.reshape(-1, 3)
        self.width = float(np.ptp(poles[:, 0]))
        room = [0.0, 0.0, ROOM * self.width]
        self._box = poles.min(axis=0) - room, poles.max(axis=0) + room
        heights = surface.coefficients[..., 2]
        steepest = [_steepest(kv, z) for kv, z in ((surface.kv_u, heights), (surface.kv_v, heights.T))]
        self._steepest = np.array(steepest) * (self.high - self.low) / (self._box[1] - self._box[0])[:2]

    def start(self, points: Floats, directions: Floats) -> Floats:
        """Return parameters where rays first fall through the face, to a step's width.

        x and y are taken as linear in the parameters: a guess that Newton's method corrects.
        Rays parallel to z need no search, and those steeper than the face fall through it once.

        points, directions : (n, 3).
        """
        uv, aside = self._below(points[:, :2]), np.abs(directions[:, :2])
        left: Bools = np.asarray((aside >= STILL).any(axis=1))
        steep = np.flatnonzero(left & (aside @ self._steepest < directions[:, 2]))
        if steep.size:
            falls, at = self._crossing(points[steep], directions[steep])
            uv[steep[falls]], left[steep[falls]] = at, False
        if left.any():
            uv[left] = self._search(points[left], directions[left])
        return uv

    def _below(self, points: Floats) -> Floats:
        """Return the parameters at (x, y), (..., 2), of the rim where they lie beside the face."""
        fraction = np.clip((points - self._box[0][:2]) / (self._box[1] - self._box[0])[:2], 0, 1)
        return self.low + fraction * (self.high - self.low)

    def _above(self, points: Floats) -> Floats:
        """Return how far the face lies above points (..., 3), mm."""
        heights: Floats = self._height(self._below(points[..., :2])) - points[..., 2]
        return heights

    def _crossing(self, points: Floats, directions: Floats) -> tuple[Bools, Floats]:
        """Return which rays, steeper than the face, fall through it, and the parameters where they do."""

        def above(t: Floats, *ray: Floats) -> Floats:
            return self._above(np.stack([a + t * d for a, d in zip(ray[:3], ray[3:])], axis=-1))

        first, last = self._within_box(points, directions)
        rays = (*points.T, *directions.T)
        falls = (above(first, *rays) > 0) & (above(last, *rays) <= 0)
        ends, own = (first[falls], last[falls]), tuple(a[falls] for a in rays)
        t = find_root(above, ends, args=own, tolerances={"xatol": NEAR * self.width}).x
        return falls, self._below(points[falls, :2] + t[:, None] * directions[falls, :2])

    def _search(self, points: Floats, directions: Floats) -> Floats:
        """Return the parameters where slanted rays first fall through the face, to a step's width.

        Steps are halved where f = height of the face - height of the ray may reach zero: where it changes its
        sign, or is less at both ends together than the length times the greatest slope.
        """
        first, last = self._within_box(points, directions)
        steepest = np.abs(directions[:, :2]) @ self._steepest + np.abs(directions[:, 2])

        def above(ray: Integers, t: Floats) -> Floats:
            return self._above(points[ray] + t[:, None] * directions[ray])

        def sampled(ray: Integers, count: int) -> tuple[Floats, Floats]:
            share = np.linspace(0.0, 1.0, count)
            t = first[ray, None] + (last - first)[ray, None] * share
            return t, above(np.repeat(ray, count), t.ravel()).reshape(t.shape)

        t, f = sampled(np.arange(len(points)), SAMPLES)
        ray = np.repeat(np.arange(len(points)), SAMPLES - 1)
        steps = np.stack([a[:, w].ravel() for a in (t, f) for w in (np.s_[:-1], np.s_[1:])])
        for halvings in range(HALVINGS + 1):
            low, high, f_low, f_high = steps
            falls = (f_low > 0) & (f_high <= 0)
            fall = np.full(len(points), np.inf)
            np.minimum.at(fall, ray[falls], low[falls])
            unsafe = (f_low > 0) & (f_low + f_high <= steepest[ray] * (high - low))
            chosen = (falls | unsafe) & (low <= fall[ray])
            ray, steps = ray[chosen], steps[:, chosen]
            if halvings < HALVINGS:
                low, high, f_low, f_high = steps
                middle = (low + high) / 2
                f_middle = above(ray, middle)
                steps = np.concatenate(
                    [[low, middle, f_low, f_middle], [middle, high, f_middle, f_high]], axis=1
                )
                ray = np.concatenate([ray, ray])
        best, falls = np.full(len(points), np.nan), steps[3] <= 0
        best[ray[falls]] = (steps[0] + steps[1])[falls] / 2
        if (beside := np.flatnonzero(np.isnan(best))).size:
            t, f = sampled(beside, NEARBY)
            nearest = np.arange(len(beside)), np.abs(f[:, :-1]).argmin(axis=1)
            best[beside] = ((t[:, :-1] + t[:, 1:]) / 2)[nearest]
        return self._below((points + best[:, None] * directions)[:, :2])

    def behind(self, points: Floats, directions: Floats) -> Bools:
        """Return which rays come into the face's box above the face: they pass its rim."""
        here = points + self._within_box(points, directions)[0][:, None] * directions
        return self._above(here) < -MEETS * self.width

    def _within_box(self, points: Floats, directions: Floats) -> tuple[Floats, Floats]:
        """Return the ray parameters at which rays enter and leave the face's box."""
        still = np.abs(directions) < STILL
        speed = np.where(still, 1.0, directions)
        low, high = self._box
        ends = np.stack(
            [
                np.where(still, -np.inf, (low - points) / speed),
                np.where(still, np.inf, (high - points) / speed),
            ]
        )
        return np.maximum(ends.min(axis=0).max(axis=1), 0.0), ends.max(axis=0).min(axis=1)

    def jet(self, uv: Floats) -> list[Floats]:
        """Return S, S_u, S_v at (n, 2) parameters, each (n, 3)."""
        return [self._spline(uv, nu=nu) for nu in ((0, 0), (1, 0), (0, 1))]


def _steepest(kv: KnotVector, heights: Floats) -> float:
    """Return a bound of the derivative by the first parameter, from differences of the poles' heights."""
    widths = kv.knots[kv.degree + 1 : -1] - kv.knots[1 : -kv.degree - 1]
    return float(np.max(kv.degree * np.abs(np.diff(heights, axis=0)) / widths[:, None]))
