"""Outlines to which a lens is cut: ellipses x^2 / a^2 + y^2 / b^2 = 1, and polygons.

Angles t of an ellipse run counter-clockwise from the longer semi-axis, as CAD kernels count them:

    (x, y) = (a cos t, b sin t) for a >= b, else (-a sin t, b cos t).

Between two crossings of knot lines a spline graph z(x, y) of degrees (p, q) is a trigonometric
polynomial of degree p + q in t there, and a polynomial of degree p + q along a straight side.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import NdBSpline

from thbcad.checks import Floats, Integers, floats, half_widths, require_type
from thbcad.lens.lens import Lens
from thbcad.splines import BSplineSurface, Primitive, gauss_rule

LEAST = 1e-6  # mm; CAD kernels take points within 1e-7 mm for one
MOST_CORNERS = 1000  # every pair of sides is looked at
FARTHEST = 1e6  # mm of a corner; rounding is then still far below LEAST


@dataclass(frozen=True)
class Ellipse:
    """The ellipse x^2 / a^2 + y^2 / b^2 = 1 in mm.

    semi_axes : (a, b) float, mm

    Raises
    ------
    ValueError : semi-axes that are not two positive numbers, or are below 1e-6 mm.
    """

    semi_axes: tuple[float, float]

    def __post_init__(self) -> None:
        try:
            object.__setattr__(self, "semi_axes", half_widths(self.semi_axes))
        except ValueError:
            raise ValueError(f"semi_axes must be two positive numbers, got {self.semi_axes}") from None
        if min(self.semi_axes) < LEAST:
            raise ValueError(f"semi_axes must be at least {LEAST:g} mm, got {self.semi_axes}")

    @property
    def area(self) -> float:
        """pi a b, mm^2."""
        return float(np.pi * self.semi_axes[0] * self.semi_axes[1])

    @property
    def upright(self) -> bool:
        """True where the longer semi-axis lies along y."""
        return self.semi_axes[1] > self.semi_axes[0]

    def __call__(self, t: ArrayLike) -> tuple[Floats, Floats]:
        """Return (x, y) at the angles t, (n,) each, mm."""
        (a, b), t = self.semi_axes, np.asarray(t, dtype=np.float64)
        return (-a * np.sin(t), b * np.cos(t)) if self.upright else (a * np.cos(t), b * np.sin(t))

    def crossings(self, x: ArrayLike, y: ArrayLike) -> tuple[Floats, Integers]:
        """Return the angles in [0, 2 pi) at which the ellipse crosses the lines x = x_i and y = y_j.

        Returns (angles, lines): (n,) float and (n,) int, lines i of x and len(x) + j of y; not sorted.
        """
        angles = []
        lines = []
        start = 0
        for d, row in enumerate((x, y)):
            relative = np.asarray(row, dtype=np.float64) / self.semi_axes[d]
            hit = np.flatnonzero(abs(relative) <= 1)
            # angles from the axis d, then from the longer semi-axis
            turn = (np.pi / 2 if d == 1 else 0.0) - (np.pi / 2 if self.upright else 0.0)
            for sign in (1, -1):
                angles.append((turn + sign * np.arccos(relative[hit])) % (2 * np.pi))
                lines.append(start + hit)
            start += len(relative)
        return np.concatenate(angles), np.concatenate(lines)


def require_aperture(lens: Lens, semi_axes: tuple[float, float]) -> Ellipse:
    """Return the ellipse of an aperture within both surfaces.

    Raises
    ------
    ValueError : no Lens, semi-axes that are not two positive numbers or exceed a half-width.
    """
    require_type("lens", lens, Lens)
    ellipse = Ellipse(semi_axes)
    for name, surface in (("front", lens.front), ("rear", lens.rear)):
        if any(s > h for s, h in zip(ellipse.semi_axes, surface.half_width)):
            raise ValueError(
                f"semi_axes must be at most the {name}'s half-widths {surface.half_width} mm, got "
                f"{ellipse.semi_axes}"
            )
    return ellipse


def aperture_volume(lens: Lens, semi_axes: tuple[float, float]) -> float:
    """Return the volume of a lens that is cut by an elliptic cylinder, mm^3.

    V = pi a b thickness + int_E rear - int_E front, by Green's theorem int_E z = closed integral of Z dy with
    dZ/dx = z.  The integrand is a trigonometric polynomial between the knot lines: Gauss quadrature
    on every piece leaves rounding errors.

    Raises
    ------
    ValueError : as `require_aperture`.
    """
    ellipse = require_aperture(lens, semi_axes)
    front, rear = lens.graphs()
    return ellipse.area * lens.thickness + ellipse_integral(rear, ellipse) - ellipse_integral(front, ellipse)


def ellipse_integral(graph: BSplineSurface, ellipse: Ellipse) -> float:
    """Return the integral of a scalar spline z(x, y) over the inside of an ellipse within its rectangle.

    A Gauss rule with n = p + q + 8 nodes on pieces of at most a quarter turn errs by less than 1e-14 of the
    size of each harmonic, of which the last is number p + q + 2.

    Source: P. Davis, P. Rabinowitz, Methods of Numerical Integration, 2.7 (remainder of the Gauss rule).
    """
    p, q = graph.kv_u.degree, graph.kv_v.degree
    along = graph.kv_u.integrals()[:, None] * graph.coefficients
    primitive = np.concatenate([np.zeros((1, along.shape[1])), np.cumsum(along, axis=0)])
    knots = np.r_[graph.kv_u.start, graph.kv_u.knots, graph.kv_u.stop]
    angles, _ = ellipse.crossings(graph.kv_u.breaks, graph.kv_v.breaks)
    breaks = np.unique(np.r_[angles, np.pi / 2 * np.arange(5)])
    t, weights = gauss_rule(breaks, p + q + 8)
    x, y = inside(graph, *ellipse(t))
    values = NdBSpline((knots, graph.kv_v.knots), primitive, (p + 1, q))(np.column_stack([x, y]))
    a, b = ellipse.semi_axes
    return float(weights @ (values * x * (b / a)))


def inside(graph: BSplineSurface, x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Return points of the rim, those that rounding put beside the rectangle of the graph moved onto it."""
    x, y = (np.clip(row, kv.start, kv.stop) for row, kv in ((x, graph.kv_u), (y, graph.kv_v)))
    return x, y


@dataclass(frozen=True)
class Polygon:
    """A polygon in the plane z = 0, convex or not, that does not touch itself.

    corners : at least three (x, y) float, mm; they are stored counter-clockwise

    Raises
    ------
    ValueError : corners that are no numbers up to 1e6 mm, fewer than 3 or more than 1000; sides that cross or
        come within 1e-6 mm of each other.
    """

    corners: tuple[tuple[float, float], ...]

    def __post_init__(self) -> None:
        rows = _corners(self.corners)
        _require_simple(rows)
        if _shoelace(rows) < 0:
            rows = rows[::-1]
        object.__setattr__(self, "corners", tuple((float(x), float(y)) for x, y in rows))

    @property
    def area(self) -> float:
        """The area within, mm^2."""
        return _shoelace(np.array(self.corners))

    @property
    def sides(self) -> Floats:
        """The first and the last corner of every side, (n, 2, 2), counter-clockwise, mm."""
        corners = np.array(self.corners)
        return np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)


def _corners(values: object) -> Floats:
    """Return corners as (n, 2) float; raise ValueError for anything else."""
    wanted = f"a polygon must have 3 to {MOST_CORNERS} corners (x, y) of finite numbers up to {FARTHEST:g} mm"
    try:
        rows = floats(values)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        raise ValueError(f"{wanted}, got {str(values)[:60]}") from None
    if rows.ndim != 2 or rows.shape[1] != 2 or not 3 <= len(rows) <= MOST_CORNERS:
        raise ValueError(f"{wanted}, got an array of shape {rows.shape}")
    within = (abs(rows) <= FARTHEST).all(axis=1)
    if not within.all():
        raise ValueError(f"{wanted}, got {rows[~within][0].tolist()}")
    return rows


def _shoelace(corners: Floats) -> float:
    """Return the area within corners, negative where they run clockwise."""
    x, y = (corners - corners[0]).T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def _require_simple(corners: Floats) -> None:
    """Raise ValueError unless every corner lies at least 1e-6 mm from all sides that do not end there, and no
    sides cross."""
    count = len(corners)
    starts, steps = corners, np.roll(corners, -1, axis=0) - corners
    short = np.flatnonzero(np.hypot(*steps.T) < LEAST)
    if len(short):
        k = int(short[0])
        raise ValueError(f"corners {k + 1} and {(k + 1) % count + 1} of the polygon must lie apart")
    along = np.einsum("ijk,jk->ij", corners[:, None] - starts, steps) / (steps**2).sum(axis=1)
    feet = starts + np.clip(along, 0, 1)[..., None] * steps
    apart = np.linalg.norm(corners[:, None] - feet, axis=2)
    index = np.arange(count)
    apart[index, index] = apart[(index + 1) % count, index] = np.inf
    crossed = np.argwhere((apart < LEAST) | _crossing(starts, steps))
    if len(crossed):
        first, second = (int(k) for k in crossed[0])
        raise ValueError(
            f"the polygon must not touch or cross itself, but its sides from corner {first + 1} and from "
            f"corner {second + 1} do"
        )


def _crossing(starts: Floats, steps: Floats) -> NDArray[np.bool_]:
    """Return which pairs of sides have their ends on both sides of each other, (n, n)."""
    to_start = starts[:, None] - starts
    before = _cross(steps, to_start)
    after = _cross(steps, to_start + steps[:, None])
    apart: NDArray[np.bool_] = before * after < 0
    return apart & apart.T


def _cross(a: Floats, b: Floats) -> Floats:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def require_polygon(lens: Lens, corners: object) -> Polygon:
    """Return the polygon of an outline within both surfaces.

    Raises
    ------
    ValueError : no Lens, as `Polygon`, or a corner beyond a half-width.
    """
    require_type("lens", lens, Lens)
    polygon = Polygon(corners)  # type: ignore[arg-type]
    for name, surface in (("front", lens.front), ("rear", lens.rear)):
        beyond = [c for c in polygon.corners if any(abs(a) > h for a, h in zip(c, surface.half_width))]
        if beyond:
            raise ValueError(
                f"the polygon must lie within the {name}'s half-widths {surface.half_width} mm, got the "
                f"corner {beyond[0]}"
            )
    return polygon


def polygon_volume(lens: Lens, corners: object) -> float:
    """Return the volume of a lens that is cut by a straight wall over a polygon, mm^3.

    V = area thickness + int rear - int front, by Green's theorem; exact for the splines but for rounding.

    Raises
    ------
    ValueError : as `require_polygon`.
    """
    polygon = require_polygon(lens, corners)
    front, rear = lens.graphs()
    return polygon.area * lens.thickness + polygon_integral(rear, polygon) - polygon_integral(front, polygon)


def polygon_integral(graph: BSplineSurface, polygon: Polygon) -> float:
    """Return the integral of a scalar spline z(x, y) over the inside of a polygon within its rectangle."""
    p, q = graph.kv_u.degree, graph.kv_v.degree
    lines = graph.kv_u.breaks, graph.kv_v.breaks
    primitive = Primitive(graph, *lines, (p // 2 + 1, q + 1))
    total = 0.0
    for start, stop in polygon.sides:
        places, _ = side_crossings(start, stop, *lines)
        # Z has degree p + 1 in x and q in y
        t, weights = gauss_rule(np.unique(np.r_[0.0, places, 1.0]), (p + q + 1) // 2 + 1)
        x, y = inside(graph, *(start + t[:, None] * (stop - start)).T)
        total += float(weights @ primitive(x, y)) * (stop[1] - start[1])
    return total


def side_crossings(start: Floats, stop: Floats, x: Floats, y: Floats) -> tuple[Floats, Integers]:
    """Return where the straight line from start (0) to stop (1) crosses the lines x = x_i and y = y_j.

    Returns (places, lines): (n,) float within (0, 1) and (n,) int, lines i of x and len(x) + j of y; not
    sorted.
    """
    places = []
    lines = []
    first = 0
    for row, origin, step in zip((x, y), start, stop - start):
        place = (row - origin) / step if step else np.full(len(row), np.inf)
        hit = np.flatnonzero((place > 0) & (place < 1))
        places.append(place[hit])
        lines.append(first + hit)
        first += len(row)
    return np.concatenate(places), np.concatenate(lines)
