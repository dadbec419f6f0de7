"""What of its rectangle a surface fills: a rectangle whose corners are quarters of ellipses.

With half-widths h and semi-axes c of the corners, 0 <= c <= h, the points inside have

    |x| <= hx, |y| <= hy,    sx^2 + sy^2 <= 1,    s = max(0, |x| - (hx - cx)) / cx, and likewise in y.

c = 0 is the rectangle, c = h the ellipse.  The gauge of a point, its Minkowski functional, is the factor by
which the outline grows until it passes through the point: at most 1 inside, and linear along rays from the
middle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from thbcad.checks import Bools, Floats, floats, half_widths
from thbcad.outlines.pieces import LEAST_SIZE, Arc, Line, RimPiece

RELATIVE = 1e-12  # of the half-width: corners that differ by less are alike
ROUND = 1e-12  # relative: semi-axes that differ by less are those of a circle
TINY = 1e-300  # what is divided by where it is zero


@dataclass(frozen=True)
class Outline:
    """A rectangle |x| <= hx, |y| <= hy with corners that are quarters of ellipses.

    half_width : (hx, hy) float, mm
    corners : (cx, cy) float, mm, their semi-axes: (0, 0) of a rectangle, half_width of an ellipse

    Raises ValueError : half-widths that are not positive; corners that are negative or wider than these, or
        of which one alone is zero.

    >>> disk = Outline((20.0, 20.0), (20.0, 20.0))
    >>> disk.is_ellipse, float(disk.gauge(3.0, 4.0)), disk.contains([14.0, 15.0], 14.2).tolist()
    (True, 0.25, [True, False])
    >>> round(Outline((10.0, 5.0), (2.0, 2.0)).area, 9)  # 20 x 10 less four corners (1 - pi / 4) 2^2
    196.566370614
    """

    half_width: tuple[float, float]
    corners: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        h, c = half_widths(self.half_width), floats(self.corners)
        if c.shape != (2,) or not (np.isfinite(c).all() and (c >= 0).all()):
            raise ValueError(f"corners must be two numbers of at least 0 mm, got {self.corners}")
        if (c > np.array(h) * (1 + RELATIVE)).any() or (c > 0).sum() == 1:
            raise ValueError(
                f"corners must be both 0 or both above it, up to the half-widths {h}, got {tuple(c)}"
            )
        object.__setattr__(self, "half_width", h)
        object.__setattr__(self, "corners", tuple(float(min(a, b)) for a, b in zip(c, h)))

    @classmethod
    def ellipse(cls, semi_axes: tuple[float, float]) -> Outline:
        """Return the outline x^2 / a^2 + y^2 / b^2 = 1, mm.

        Raises ValueError : semi-axes that are not two positive numbers, or are below 1e-6 mm.
        """
        try:
            axes = half_widths(semi_axes)
        except ValueError:
            raise ValueError(f"semi_axes must be two positive numbers, got {semi_axes}") from None
        if min(axes) < LEAST_SIZE:
            raise ValueError(f"semi_axes must be at least {LEAST_SIZE:g} mm, got {axes}")
        return cls(axes, axes)

    @property
    def is_rectangle(self) -> bool:
        """Whether the corners are sharp."""
        return self.corners == (0.0, 0.0)

    @property
    def is_ellipse(self) -> bool:
        """Whether no side is straight."""
        return self.corners == self.half_width

    @property
    def is_circle(self) -> bool:
        """Whether it is an ellipse of equal semi-axes, but for rounding."""
        return self.is_ellipse and abs(self.half_width[0] / self.half_width[1] - 1) < ROUND

    @property
    def relative_corners(self) -> tuple[float, float]:
        """Semi-axes of the corners, of the half-widths."""
        (a, b), (c, d) = self.half_width, self.corners
        return c / a, d / b

    @property
    def area(self) -> float:
        """The area within, mm^2: 4 hx hy - (4 - pi) cx cy."""
        return float(4 * np.prod(self.half_width) - (4 - np.pi) * np.prod(self.corners))

    def text(self, digits: int = 6) -> str:
        """Return its size in words, mm."""
        (a, b), (c, d) = [
            [f"{size:.{digits}g}" for size in pair]
            for pair in ((2 * h for h in self.half_width), self.corners)
        ]
        if self.is_ellipse:
            return f"diameter {a} mm" if self.is_circle else f"ellipse {a} x {b} mm"
        corners = "" if self.is_rectangle else f", corners {f'R {c}' if c == d else f'{c} x {d}'} mm"
        return f"{a} x {b} mm{corners}"

    @property
    def pieces(self) -> tuple[RimPiece, ...]:
        """The outline as lines and arcs, counter-clockwise: the sides from that at -y on, each with the
        corner that follows; an ellipse in two halves from its longer semi-axis on.

        Raises ValueError : a side or a corner below 1e-6 mm, which CAD files do not hold.
        """
        (hx, hy), (cx, cy) = self.half_width, self.corners
        if self.is_ellipse:
            return tuple(Arc((hx, hy), (k * np.pi, (k + 1) * np.pi), hy > hx) for k in (0, 1))
        sizes = [a for pair in zip(self.half_width, self.corners) for a in (pair[1], 2 * (pair[0] - pair[1]))]
        if any(0 < size < LEAST_SIZE for size in sizes):
            raise ValueError(
                f"sides and corners of an outline must be at least {LEAST_SIZE:g} mm wide, got the "
                f"half-widths {self.half_width} with corners of {self.corners} mm"
            )
        x, y = hx - cx, hy - cy
        out: list[RimPiece] = []
        ends = (((-x, -hy), (x, -hy)), ((hx, -y), (hx, y)), ((x, hy), (-x, hy)), ((-hx, y), (-hx, -y)))
        for k, (start, stop) in enumerate(ends):
            if start != stop:
                out.append(Line(start, stop))
            if cx:
                # quarter k begins below the x axis, and upright angles lie a quarter turn behind
                first = (k - 1 - (cy > cx)) % 4
                turn = (first * np.pi / 2, (first + 1) * np.pi / 2)
                out.append(Arc((cx, cy), turn, cy > cx, (x if k in (0, 1) else -x, y if k in (1, 2) else -y)))
        return tuple(out)

    def gauge(self, x: ArrayLike, y: ArrayLike) -> Floats:
        """Return the factor by which the outline grows until it passes through points, of their shape."""
        (hx, hy), (rx, ry) = self.half_width, self.relative_corners
        u, v = abs(floats(x)) / hx, abs(floats(y)) / hy
        if self.is_ellipse:
            return np.asarray(np.hypot(u, v))
        straight: Floats = np.maximum(u, v)
        if self.is_rectangle:
            return straight
        # (a - k p)^2 + (b - k q)^2 = k^2 of the corner that has grown by k
        a, b, p, q = u / rx, v / ry, (1 - rx) / rx, (1 - ry) / ry
        half, squares = a * p + b * q, a * a + b * b
        root = np.sqrt(np.maximum(half * half - (p * p + q * q - 1) * squares, 0.0))
        at_corner = (v > u * (1 - ry)) & (u > v * (1 - rx))
        return np.where(at_corner, squares / np.maximum(half + root, TINY), straight)

    def contains(self, x: ArrayLike, y: ArrayLike, slack: float = 0.0) -> Bools:
        """Return which points lie inside, of their shape.  slack : relative, by which they may lie beside."""
        return np.asarray(self.gauge(x, y) <= 1 + slack)

    def shares(self, low: tuple[Floats, Floats], high: tuple[Floats, Floats], fine: int = 8) -> Floats:
        """Return the share of rectangles that lies inside, 0 to 1, of their shape.

        low, high : x and y of their corners, mm, which broadcast.
        fine : points each way, of those that the rim may cross.
        """
        x0, y0, x1, y1 = np.broadcast_arrays(*low, *high)
        pairs = (x0, x1), (y0, y1)
        far_x, far_y = (np.maximum(abs(a), abs(b)) for a, b in pairs)
        near_x, near_y = (np.where(a * b <= 0, 0.0, np.minimum(abs(a), abs(b))) for a, b in pairs)
        # the outline is convex and symmetric
        out: Floats = self.contains(far_x, far_y).astype(float)
        some = np.nonzero((out == 0) & self.contains(near_x, near_y))
        middles = (np.arange(fine) + 0.5) / fine
        x, y = (a[some][:, None] + (b - a)[some][:, None] * middles for a, b in pairs)
        out[some] = self.contains(x[:, :, None], y[:, None, :]).mean(axis=(1, 2))
        return out

    def support(self, directions: Floats) -> Floats:
        """Return how far the outline reaches in unit directions (u, v), (2, n), mm: its support function

        |u| (hx - cx) + |v| (hy - cy) + |(u cx, v cy)|.
        """
        (hx, hy), (cx, cy), (u, v) = self.half_width, self.corners, directions
        reach: Floats = np.abs(u) * (hx - cx) + np.abs(v) * (hy - cy) + np.hypot(u * cx, v * cy)
        return reach

    def circumscribed(self, sides: int) -> Floats:
        """Return the corners of a convex polygon around the outline, counter-clockwise, (sides, 2) mm.

        Every side touches the outline.  Side k faces the angle 2 pi k / sides where the outline is scaled to
        half-widths of 1.  Of an ellipse its area is tan(pi / sides) sides / pi times the outline's.

        sides : int, at least 3; for a multiple of 4 the polygon lies within the rectangle

        >>> Outline((2.0, 1.0), (2.0, 1.0)).circumscribed(4).round(9).tolist()
        [[2.0, 1.0], [-2.0, 1.0], [-2.0, -1.0], [2.0, -1.0]]
        """
        step = 2 * np.pi / sides
        angles = step * np.arange(sides)
        u, v = np.cos(angles), np.sin(angles)
        reach = self.scaled((1.0, 1.0)).support(np.stack([u, v]))
        along = (np.roll(reach, -1) - np.cos(step) * reach) / np.sin(step)  # from the touching side's middle
        return np.stack([reach * u - along * v, reach * v + along * u], axis=1) * self.half_width

    def filled(self, x: ArrayLike, y: ArrayLike) -> tuple[Floats, Floats]:
        """Return points of the rectangle moved along rays from the middle, its rim onto that of the outline,
        mm."""
        x, y = np.broadcast_arrays(floats(x), floats(y))
        gauge, (hx, hy) = self.gauge(x, y), self.half_width
        factor = np.maximum(abs(x) / hx, abs(y) / hy) / np.where(gauge > 0, gauge, 1.0)
        return factor * x, factor * y

    def inset(self, depth: float) -> Outline:
        """Return the outline at a distance inside, mm.

        Raises ValueError : corners that are no quarter circles, which no outline follows; a depth that leaves
            less than 1e-6 mm of a half-width or of the corners.
        """
        (hx, hy), (cx, cy) = self.half_width, self.corners
        if abs(cx - cy) > RELATIVE * min(hx, hy):
            raise ValueError(
                f"walls with draft need a rectangle, a circle or round corners, got corners of {cx:.6g} x "
                f"{cy:.6g} mm; make them round or draft 0"
            )
        left = min(hx, hy, cx or hx, cy or hy) - depth
        if left < LEAST_SIZE:
            raise ValueError(
                f"an outline of half-widths {self.half_width} mm with corners of {cx:.6g} mm has nothing "
                f"left {depth:.6g} mm inside; make draft smaller or the corners larger"
            )
        corners = (cx - depth, cy - depth) if cx else (0.0, 0.0)
        return Outline((hx - depth, hy - depth), corners)

    def chord(self, origin: Floats, direction: Floats) -> tuple[Floats, Floats]:
        """Return between which t lines o + t d lie inside, (n,) each; start >= stop for none.

        Where the line meets the rectangle in a corner, its meeting with the whole ellipse of the corner takes
        that place: with its middle m, p = (o - m) / c and q = d / c,

            t = (-p q -+ sqrt(q^2 - (p x q)^2)) / q^2.

        origin, direction : o and d, (2, n) each, mm.
        """
        with np.errstate(divide="ignore"):
            slabs = [
                np.sort([(s * h - o) / d for s in (-1, 1)], axis=0)
                for h, o, d in zip(self.half_width, origin, direction)
            ]
        start, stop = np.maximum(slabs[0][0], slabs[1][0]), np.minimum(slabs[0][1], slabs[1][1])
        if self.is_rectangle:
            return start, stop
        moves = (direction[0] != 0) | (direction[1] != 0)
        met, ends = (start < stop) & (moves | self.contains(*origin)), []
        for end, side in ((start, -1.0), (stop, 1.0)):
            place = np.where(np.isfinite(end), end, 0.0)
            points = [o + place * d for o, d in zip(origin, direction)]
            straight = [h - c for h, c in zip(self.half_width, self.corners)]
            at_corner = (abs(points[0]) > straight[0]) & (abs(points[1]) > straight[1])
            p = [(o - np.copysign(s, a)) / c for o, s, a, c in zip(origin, straight, points, self.corners)]
            q = [d / c for d, c in zip(direction, self.corners)]
            square = np.maximum(q[0] ** 2 + q[1] ** 2, TINY)
            room = square - (p[0] * q[1] - p[1] * q[0]) ** 2
            at_corner &= moves
            met &= ~at_corner | (room >= 0)
            root = (side * np.sqrt(np.maximum(room, 0.0)) - p[0] * q[0] - p[1] * q[1]) / square
            ends.append(np.where(at_corner, root, end))
        return np.where(met, ends[0], 1.0), np.where(met, ends[1], 0.0)

    def scaled(self, half_width: ArrayLike) -> Outline:
        """Return the outline stretched to other half-widths, mm."""
        (hx, hy), (rx, ry) = half_widths(half_width), self.relative_corners
        return Outline((hx, hy), (rx * hx, ry * hy))
