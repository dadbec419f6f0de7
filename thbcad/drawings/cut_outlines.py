"""The outline to which a lens is cut, as drawings need it: in the plan, in sections, along lines of sight.

Seen along an axis, an ellipse is one strip over the angle t, v = b sin t, with u from -a cos t to a cos t.
A rectangle with elliptic corners has such strips below and above the straight sides, and one between.  A
polygon has a strip between each two corners that follow each other in v, with intervals of u between its
sides there.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from thbcad.checks import Floats
from thbcad.lens import Flange, Lens, require_clear, require_polygon, walls_of
from thbcad.outlines import UPRIGHT, Arc, Outline, Polygon

Shape = Outline | Polygon
THINNEST = 1e-9  # mm; corners that lie nearer in v are at one


@dataclass(frozen=True, eq=False)
class CutLens:
    """A lens that is cut by upright walls, with a flange or without.

    shape : Outline or Polygon of the walls; of slanted ones that of the greater half-widths
    flange : Flange or None.  around : the outline of the flange, else None
    slanted : whether the walls run between outlines of two sizes, those of front and rear
    """

    lens: Lens
    shape: Shape
    flange: Flange | None = None
    around: Shape | None = None
    slanted: bool = False

    @property
    def shapes(self) -> tuple[Shape, Shape]:
        """The outlines of front and rear."""
        lens = self.lens
        return (lens.front.outline, lens.rear.outline) if self.slanted else (self.shape, self.shape)

    @property
    def planes(self) -> tuple[float, float]:
        """The x and y of the sections, mm: 0, or about the middle of an outline that lies beside it."""
        x, y = (_plane(a, b) for a, b in zip(*(corner.tolist() for corner in box_of(self.shape))))
        return x, y

    @property
    def texts(self) -> tuple[str, str]:
        """The sizes of the outlines of front and rear in words."""
        front, rear = (_text(shape) for shape in self.shapes)
        return front, rear


def cut_lens(
    lens: Lens, aperture: tuple[float, float] | None, flange: Flange | None, corners: object
) -> CutLens | None:
    """Return the CutLens of an elliptic aperture, a flange or a polygon, None where there is none."""
    if corners is not None:
        if aperture is not None or flange is not None:
            raise ValueError("a polygon is an outline by itself: leave out aperture and flange")
        return CutLens(lens, require_polygon(lens, corners))
    if flange is not None:
        require_clear(lens, flange, aperture)
    shape = walls_of(lens, aperture)
    if flange is None and shape.is_rectangle:
        return None
    slanted = aperture is None and lens.taper != UPRIGHT
    if slanted and flange is not None:
        raise ValueError(
            "a flange is drawn where front and rear have one size; cut both by an aperture, or export step"
        )
    around = None if flange is None else _drawn(flange.around(shape))
    return CutLens(lens, _drawn(shape), flange, around, slanted)


def _text(shape: Shape) -> str:
    if isinstance(shape, Outline):
        return shape.text(digits=7)
    low, high = box_of(shape)
    a, b = (f"{size:.7g}" for size in (high - low).tolist())
    return f"polygon of {len(shape.corners)} corners within {a} x {b} mm"


def _plane(low: float, high: float) -> float:
    """Return 0 where it lies between two numbers, else their middle, with four digits where these do."""
    if low < 0 < high:
        return 0.0
    middle = float(f"{(low + high) / 2:.4g}")
    return middle if low < middle < high else (low + high) / 2


def _drawn(outline: Outline) -> Shape:
    """Return a rectangle as a polygon, whose upright edges are seen."""
    a, b = outline.half_width
    return Polygon(((-a, -b), (a, -b), (a, b), (-a, b))) if outline.is_rectangle else outline


def is_circle(shape: Shape) -> bool:
    """Return whether an outline is a circle."""
    return isinstance(shape, Outline) and shape.is_circle


def box_of(shape: Shape) -> tuple[Floats, Floats]:
    """Return the least and the greatest (x, y), (2,) each, mm."""
    points = np.array(shape.corners if isinstance(shape, Polygon) else [shape.half_width])
    return points.min(axis=0) if isinstance(shape, Polygon) else -points[0], points.max(axis=0)


def ring_of(shape: Shape, chord: float) -> tuple[Floats, float]:
    """Return the outline as a closed line (n, 2), mm, and its error: a chord over the angle d of an ellipse
    lies within max(a, b) d^2 / 8 of it."""
    parts, error = [], 0.0
    for piece in shape.pieces:
        count = 1
        if isinstance(piece, Arc):
            longer = max(piece.semi_axes)
            count = int(np.ceil(np.ptp(piece.ends) / np.sqrt(8 * chord / longer)))
            error = max(error, longer * (np.ptp(piece.ends) / count) ** 2 / 8)
        parts.append(np.column_stack(piece(np.linspace(*piece.ends, count + 1)[:-1])))
    return np.concatenate([*parts, parts[0][:1]]), error


def intervals(shape: Shape, across: int, at: float) -> list[tuple[float, float]]:
    """Return the parts of the line x = at (across 0) or y = at (across 1) within an outline, mm."""
    if isinstance(shape, Outline):
        (h, own), (c, corner) = (
            (pair[across], pair[1 - across]) for pair in (shape.half_width, shape.corners)
        )
        share = max(abs(at) - (h - c), 0.0) / c
        half = own - corner + corner * float(np.sqrt(1 - min(share, 1.0) ** 2))
        return [(-half, half)]
    start, stop = shape.sides[:, 0], shape.sides[:, 1]
    cut = (start[:, across] <= at) != (stop[:, across] <= at)
    a, b = start[cut], stop[cut]
    share = (at - a[:, across]) / (b[:, across] - a[:, across])
    ends = np.sort(a[:, 1 - across] + share * (b[:, 1 - across] - a[:, 1 - across])).tolist()
    return list(zip(ends[::2], ends[1::2]))


@dataclass(frozen=True, eq=False)
class Strip:
    """What of an outline lies at some v, seen along u.

    ends : the first and the last parameter t; v grows with it
    at : function of t (n,) that returns v (n,) and the ends of the intervals of u (n, m, 2), mm
    speeds : bounds of |u'|, |u''|, |v'| and |v''| along the sides and between them
    """

    ends: tuple[float, float]
    at: Callable[[Floats], tuple[Floats, Floats]]
    speeds: tuple[float, float, float, float]


def strips_of(shape: Shape, along: int) -> list[Strip]:
    """Return the strips of an outline that is seen along x (0) or y (1), in the order of v."""
    if isinstance(shape, Outline):
        (h, v), (c, d) = (
            np.array(pair)[[along, 1 - along]].tolist() for pair in (shape.half_width, shape.corners)
        )
        if d == v:
            return [_rounded(h - c, 0.0, (c, d), (-np.pi / 2, np.pi / 2))]
        low, high = (
            _rounded(h - c, side * (v - d), (c, d), sorted((0.0, side * np.pi / 2))) for side in (-1, 1)
        )
        return [low, _between(np.array([[(u, d - v), (u, v - d)] for u in (-h, h)]), d - v, v - d), high]
    sides = shape.sides[..., [along, 1 - along]]
    levels = np.unique(sides[..., 1])
    levels = levels[np.insert(np.diff(levels) > THINNEST, 0, True)]
    return [_between(sides, low, high) for low, high in zip(levels[:-1].tolist(), levels[1:].tolist())]


def _rounded(reach: float, middle: float, corner: tuple[float, float], ends: Sequence[float]) -> Strip:
    """Return the strip between pieces of ellipses round u = -reach and u = reach at v = middle."""
    a, b = corner

    def of_corners(t: Floats) -> tuple[Floats, Floats]:
        return middle + b * np.sin(t), np.multiply.outer(reach + a * np.cos(t), [-1.0, 1.0])[:, None]

    return Strip((float(ends[0]), float(ends[1])), of_corners, (reach + a, a, b, b))


def _between(sides: Floats, low: float, high: float) -> Strip:
    """Return the strip of a polygon between two levels of v; sides : (n, 2, 2), ends (u, v)."""
    v = np.sort(sides[..., 1], axis=1)
    own = sides[(v[:, 0] <= low + THINNEST) & (v[:, 1] >= high - THINNEST)]
    slopes = (own[:, 1, 0] - own[:, 0, 0]) / (own[:, 1, 1] - own[:, 0, 1])
    ends = own[:, 0, 0] + slopes * (np.array([[low], [high]]) - own[:, 0, 1])
    ends = ends[:, np.argsort(ends.sum(axis=0), kind="stable")].reshape(2, -1, 2)

    def of_sides(t: Floats) -> tuple[Floats, Floats]:
        share = ((t - low) / (high - low))[:, None, None]
        return t, (1 - share) * ends[0] + share * ends[1]

    return Strip((low, high), of_sides, (float(np.abs(slopes).max()), 0.0, 1.0, 0.0))
