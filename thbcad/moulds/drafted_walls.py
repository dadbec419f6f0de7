"""Walls that taper from a level outline by the same angle everywhere, and where they meet a surface."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from thbcad.checks import Floats
from thbcad.lens import FreeformSurface, Lens, optical_forms
from thbcad.moulds.wall_rims import NODES, SAMPLES, FittedPiece, Foot, Lines, crossings, knot_lines
from thbcad.outlines import (
    RELATIVE,
    Arc,
    Line,
    Outline,
    RimPiece,
    cross,
    fitted_curve,
    integral_within,
    merged_breaks,
)
from thbcad.sags import PlacedConic

STEPS = 60  # of Newton's method, which doubles its digits; slopes near its limit cost more
FOUND = 1e-13  # mm, relative to the size of the wall
ROUGH = 257  # samples of a piece of a rim whose heights are wanted about
TINY = 1e-300


@dataclass(frozen=True)
class DraftedWall:
    """The wall through an outline at z = level, from there inward by tan(draft) a millimetre of height.

    sides : +1 for the half above the level, -1 for that below.  draft : degrees
    """

    outline: Outline
    level: float
    draft: float
    side: int

    @property
    def slope(self) -> float:
        """Millimetres inward for one of height."""
        return float(np.tan(np.radians(self.draft)))

    def inset(self, z: float) -> float:
        """Return how far the wall lies within its outline at a height, mm."""
        return self.slope * self.side * (z - self.level)

    def at(self, z: float) -> Outline:
        """Return the outline at a height.

        Raises ValueError : as `Outline.inset`.
        """
        inset = self.inset(z)
        return self.outline.inset(inset) if inset else self.outline

    def beside(self, x: Floats, y: Floats, z: Floats) -> Floats:
        """Return how far points lie outside of the wall, mm: negative within.

        With the distance d(x, y) from the outline it is (d + inset(z)) cos(draft).
        """
        (hx, hy), (cx, cy) = self.outline.half_width, self.outline.corners
        u, v = abs(x) - (hx - cx), abs(y) - (hy - cy)
        round_ = np.hypot(u, v) - cx if abs(cx - cy) <= RELATIVE * hx else _from_ellipse(u, v, cx, cy)
        apart = np.where((u > 0) & (v > 0), round_, np.maximum(u - cx, v - cy))
        inset = self.slope * self.side * (z - self.level)
        distance: Floats = (apart + inset) * np.cos(np.radians(self.draft))
        return distance

    @cached_property
    def _pair(self) -> tuple[tuple[RimPiece, ...], tuple[RimPiece, ...], float]:
        """The pieces at the level and at a depth, mm, between which they are linear; upright ones stay."""
        if not self.slope:
            return self.outline.pieces, self.outline.pieces, 1.0
        depth = min(a for a in (*self.outline.half_width, *self.outline.corners) if a) / 2
        return self.outline.pieces, self.outline.inset(depth).pieces, depth

    def points(self, k: int, t: Floats, z: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Return x and y of piece k at parameters and heights, and their derivatives by the inset, (n,)."""
        outer, inner, depth = self._pair
        (x, y), (u, v) = outer[k](t), inner[k](t)
        u, v = (u - x) / depth, (v - y) / depth
        inset = self.slope * self.side * (z - self.level)
        return x + inset * u, y + inset * v, u, v

    def heights(self, k: int, t: Floats, surface: FreeformSurface, vertex: float) -> Floats:
        """Return z, (n,), where piece k meets a surface at z = vertex, by Newton's method.

        The z of the surface at the wall's foot of height z, less z, falls where the surface's slope is below
        1 / tan(draft): it has one zero.

        Raises ValueError : Newton's method does not end.
        """
        hx, hy = surface.half_width

        def foot(z: Floats) -> tuple[Floats, ...]:
            x, y, u, v = self.points(k, t, z)
            return np.clip(x, -hx, hx), np.clip(y, -hy, hy), u, v

        z = np.full(len(t), self.level)
        size = FOUND * (abs(self.level) + hx + hy)
        for _ in range(STEPS):
            x, y, u, v = foot(z)
            rest = surface(x, y) + vertex - z
            if not (abs(rest) > size).any():
                return np.asarray(z + rest)
            by_inset = u * surface(x, y, (1, 0)) + v * surface(x, y, (0, 1))
            z = z - rest / (self.slope * self.side * by_inset - 1)
        raise ValueError("the wall and the surface are too nearly parallel for their rim to be found")

    def _rim(self, k: int, surface: FreeformSurface, vertex: float, lines: Lines) -> FittedPiece:
        """Return where piece k meets a surface, within 1e-9 mm at eight points of every span."""
        ends = self._pair[0][k].ends

        def curve(t: Floats) -> Floats:
            z = self.heights(k, t, surface, vertex)
            x, y, _, _ = self.points(k, t, z)
            return np.column_stack([x, y, z])

        places, counts = crossings(curve, np.linspace(*ends, SAMPLES), lines)
        return FittedPiece(*fitted_curve(curve, *merged_breaks(places, counts, *ends)))

    def rough_heights(self, lens: Lens, number: int) -> tuple[float, float]:
        """Return the least and the greatest z of samples of the rim on front (0) or rear (1), mm."""
        surface, vertex = (lens.front, lens.rear)[number], number * lens.thickness
        z = [
            self.heights(k, np.linspace(*piece.ends, ROUGH), surface, vertex)
            for k, piece in enumerate(self.outline.pieces)
        ]
        return float(np.min(z)), float(np.max(z))

    def foot(self, lens: Lens, number: int) -> Foot:
        """Return where the wall meets the front (0) or the rear (1) of a lens.

        Raises ValueError : as `heights` and `fitted_curve`.
        """
        level = self.level_rim(lens, number)
        if level is not None:
            return Foot(self.at(level).pieces, level)
        surface, vertex = (lens.front, lens.rear)[number], number * lens.thickness
        lines = knot_lines(surface)
        return Foot(tuple(self._rim(k, surface, vertex, lines) for k in range(len(self._pair[0]))), None)

    def level_rim(self, lens: Lens, number: int) -> float | None:
        """Return the z of a rim that is level: on a plane, and round the axis of a conic; None of others."""
        form = optical_forms(lens)[number]
        if not isinstance(form, PlacedConic):
            return None
        if form.kind == "PLANE":
            return form.vertex
        if not self.outline.is_circle:
            return None
        surface, vertex = (lens.front, lens.rear)[number], number * lens.thickness
        return float(self.heights(0, np.zeros(1), surface, vertex)[0])

    def volume(self, lens: Lens, number: int, rim: Foot, foot: Foot) -> float:
        """Return the volume between the level and the front (0) or the rear (1) of a lens, within the wall,
        mm^3; that below the level counts as negative.  Left out is what lies under a rounding between both.

        rim : where the front or rear ends.  foot : where the wall ends, the same without a rounding.

        Within the rim it is the integral of z - level.  Round it, with the inset s up to S and
        J = x_t y_s - y_t x_s = a + b s, the wall adds the integral of (a S^2 / 2 + b S^3 / 3) / slope dt.
        """
        graph, vertex = lens.graphs()[number], number * lens.thickness
        over = integral_within(graph, rim.pieces) + (vertex - self.level) * rim.area
        if not self.slope:
            return over
        outer, inner, depth = self._pair
        round_ = 0.0
        for first, second, piece in zip(outer, inner, foot.pieces):
            t, weights = piece.rule(graph.kv_u.breaks, graph.kv_v.breaks, NODES)
            z = np.full(len(t), foot.level) if isinstance(piece, Line | Arc) else piece.height(t)
            most = self.slope * abs(z - self.level)
            inward = np.subtract(second(t), first(t)) / depth
            turned = np.subtract(second(t, 1), first(t, 1)) / depth
            a, b = cross(np.array(first(t, 1)), inward), cross(turned, inward)
            round_ += float(weights @ (a * most**2 / 2 + b * most**3 / 3)) / self.slope
        return over + self.side * round_


def _from_ellipse(x: Floats, y: Floats, a: float, b: float) -> Floats:
    """Return how far points of the first quarter lie outside of an ellipse: Newton's method finds the angle
    at which the vector from the ellipse is normal to it."""
    t = np.arctan2(y * a, x * b)
    for _ in range(STEPS):
        sine, cosine = np.sin(t), np.cos(t)
        u, v = a * cosine - x, b * sine - y
        rate = np.maximum(a * sine * a * sine + b * cosine * b * cosine - a * cosine * u - b * sine * v, TINY)
        t = np.clip(t - (b * cosine * v - a * sine * u) / rate, 0, np.pi / 2)
    apart = np.hypot(a * np.cos(t) - x, b * np.sin(t) - y)
    signed: Floats = np.copysign(apart, np.hypot(x / a, y / b) - 1)
    return signed
