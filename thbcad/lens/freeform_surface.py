"""Freeform surfaces: conic + spline sag.

A surface is the graph z(x, y) = conic(x, y) + sag(x, y) over |x| <= half_width[0],
|y| <= half_width[1]; z = 0 is the vertex of the conic and positive radii open to +z.  Where its corners are
cut off (`Outline`), conic and spline go on over the whole rectangle.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from thbcad.checks import Floats, coordinates, floats, half_widths, inside, require_orders, require_type, row
from thbcad.hierarchy import space_rows
from thbcad.outlines import Outline
from thbcad.pictures import card, frame_size, interval_text, line_path, map_element, svg
from thbcad.sags import Conic, conic_graph
from thbcad.splines import BSplineSurface, KnotVector
from thbcad.surfaces import THBSurface, value_map

PLANE = Conic()
RIM = 1e-12  # of the half-width: rounding of positions on the rim
POINTS = 161  # of a picture without a sag, in x and y, and of its outline


@dataclass(frozen=True)
class FreeformSurface:
    """The graph z(x, y) = conic + sag on a rectangle.

    half_width : (hx, hy) float, mm
    conic : Conic
    sag : THBSurface or None, scalar coefficients in mm; its parameter domain is mapped
        linearly onto the rectangle
    corners : (cx, cy) float, mm, semi-axes of the quarter ellipses in the corners: (0, 0) of a rectangle,
        half_width of an ellipse, see `Outline`

    Raises ValueError : half-widths that are not positive, a sag that is not scalar or not clamped, a conic
        that ends within the rectangle, corners that the rectangle cannot hold.

    >>> kv = KnotVector.uniform(degree=3, spans=4)
    >>> sag = quasi_interpolate(THBSpace(kv, kv), lambda u, v: 0.1 * u)  # over [0, 1], whatever the size
    >>> round(float(FreeformSurface((6.0, 7.0), Conic(10.0), sag)(6.0, 0.0)), 12)
    2.1
    """

    half_width: tuple[float, float]
    conic: Conic
    sag: THBSurface | None
    corners: tuple[float, float]

    def __init__(
        self,
        half_width: ArrayLike,
        conic: Conic = PLANE,
        sag: THBSurface | None = None,
        corners: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        h = half_widths(half_width)
        require_type("conic", conic, Conic)
        require_type("sag", sag, THBSurface, type(None))
        if sag is not None and sag.coefficients.ndim != 1:
            raise ValueError("the sag must have scalar coefficients")
        if sag is not None and not (sag.space.kv_u.is_clamped and sag.space.kv_v.is_clamped):
            raise ValueError("the sag must have clamped knots")
        outline = Outline(h, corners)
        try:
            conic.require(h)
        except ValueError as error:
            beyond = (
                "" if outline.is_rectangle else ": surfaces go on over the whole rectangle round an outline"
            )
            raise ValueError(f"{error}{beyond}") from None
        vars(self).update(half_width=h, conic=conic, sag=sag, corners=outline.corners)

    def __repr__(self) -> str:
        conic = self.conic
        base = "plane" if conic.is_plane else f"radius {conic.radius:g} mm, K {conic.constant:g}"
        sag = "no sag" if self.sag is None else f"sag of {self.sag.space.dim} coefficients"
        return f"FreeformSurface({self.outline.text()}, {base}, {sag})"

    def _repr_html_(self) -> str:
        """Return a map of the sag and some numbers for notebooks."""
        return _card(self)

    @property
    def outline(self) -> Outline:
        """What the surface fills of its rectangle."""
        return Outline(self.half_width, self.corners)

    @property
    def is_plane(self) -> bool:
        """Whether it is the plane z = 0: without sag, over a plane conic."""
        return self.sag is None and self.conic.is_plane

    def __call__(self, x: ArrayLike, y: ArrayLike, derivative: tuple[int, int] = (0, 0)) -> Floats:
        """Return z or a partial derivative at points (x, y), of the shape to which x and y broadcast.

        Raises ValueError : points outside the rectangle or NaN, shapes that do not broadcast, an order that
            is not a non-negative integer.
        """
        (x, y), (a, b) = self._onto_rim(x, y), self.half_width
        x, y = coordinates(x=(x, (-a, a)), y=(y, (-b, b)))
        derivative = require_orders(derivative)
        z: Floats = self.conic.formula(x, y, derivative)
        if self.sag is not None:
            u, v = self.to_parameters(x, y)
            z = z + self.sag(u, v, derivative) * self._chain(derivative)
        return z

    def grid(self, x: ArrayLike, y: ArrayLike, derivative: tuple[int, int] = (0, 0)) -> Floats:
        """Return z or a partial derivative on the grid x x y, (len(x), len(y)).

        Raises ValueError : positions that are no row, outside the rectangle or NaN, an order that is not a
            non-negative integer.
        """
        x, y = (
            row(name, inside(name, a, (-h, h)))
            for name, a, h in zip("xy", self._onto_rim(x, y), self.half_width)
        )
        derivative = require_orders(derivative)
        z: Floats = self.conic.formula(x[:, None], y[None, :], derivative)
        if self.sag is not None:
            u, v = self.to_parameters(x, y)
            z = z + self.sag.grid(u, v, derivative) * self._chain(derivative)
        return z

    def with_sag(self, sag: THBSurface) -> FreeformSurface:
        """Return the surface with another sag on the same conic."""
        return replace(self, sag=sag)

    def _onto_rim(self, x: ArrayLike, y: ArrayLike) -> list[Floats]:
        """Return positions, those that rounding put beside the rim on it."""
        rows = zip((floats(x), floats(y)), self.half_width)
        return [np.where(abs(a) <= h * (1 + RIM), np.clip(a, -h, h), a) for a, h in rows]

    def to_parameters(self, x: Floats, y: Floats) -> tuple[Floats, Floats]:
        """Return the spline parameters (u, v) of positions (x, y).

        Raises ValueError : a surface without sag.
        """
        u, v = (
            np.clip(kv.start + (a + h) * s, kv.start, kv.stop)
            for a, h, s, kv in zip((x, y), self.half_width, self._scale(), self._knots())
        )
        return u, v

    def graph(self, degrees: tuple[int, int] = (3, 3)) -> BSplineSurface:
        """Return the surface as a scalar BSplineSurface z(x, y) on x, y in mm.

        degrees : in x and y, of a surface without sag; with one, the sag's degree and needed knots are used.
        A conic near its end, or far beyond its radius, gets degree 5 (`conic_graph`).
        Paraboloids, planes and sags are exact but for rounding, other conics are within a proven 1e-11 mm.
        """
        if self.sag is None:
            kv_x, kv_y = (KnotVector.uniform(p, 1, -h, h) for p, h in zip(degrees, self.half_width))
            return conic_graph(self.conic, kv_x, kv_y)
        sag = self.sag.to_bspline()
        kv_x, kv_y = (kv.rescale(-h, h) for kv, h in zip((sag.kv_u, sag.kv_v), self.half_width))
        return conic_graph(self.conic, kv_x, kv_y, sag.coefficients)

    def _knots(self) -> tuple[KnotVector, KnotVector]:
        if self.sag is None:
            raise ValueError("a surface without sag has no spline parameters")
        return self.sag.space.kv_u, self.sag.space.kv_v

    def _scale(self) -> tuple[float, float]:
        su, sv = ((kv.stop - kv.start) / (2 * h) for kv, h in zip(self._knots(), self.half_width))
        return su, sv

    def _chain(self, derivative: tuple[int, int]) -> float:
        su, sv = self._scale()
        return su ** derivative[0] * sv ** derivative[1]


def _card(surface: FreeformSurface) -> str:
    """Return a map of the sag, or without one of z, beside the numbers of a surface, as HTML of at most 40
    kB."""
    size = frame_size(*surface.half_width)
    rows: list[tuple[str, object]] = [
        ("size", surface.outline.text()),
        ("radius", "plane" if surface.conic.is_plane else f"{surface.conic.radius:.6g} mm"),
        ("conic constant", f"{surface.conic.constant:.6g}"),
    ]
    unit = surface.outline.scaled((1.0, 1.0))
    if surface.sag is None:
        x, y = (np.linspace(-h, h, POINTS) for h in surface.half_width)
        values = surface.grid(x, y)
        shown = values[surface.outline.contains(x[:, None], y)]
        picture = map_element(np.clip(values, shown.min(), shown.max()), *size)
        rows.append(_span("z", shown))
    else:
        picture, shown, drawn = value_map(surface.sag, size, unit.contains)
        rows += [_span("sag", shown), *space_rows(surface.sag.space, surface.sag.space.dim, drawn)[:4]]
    return card("FreeformSurface", svg(picture + _cover(unit, *size), *size), rows)


def _cover(unit: Outline, width: float, height: float) -> str:
    """Return what hides the corners of a picture that lie outside an outline of half-widths 1."""
    if unit.is_rectangle:
        return ""
    turn = np.linspace(0, 2 * np.pi, POINTS)
    ring = np.stack([np.cos(turn), np.sin(turn)])
    ring = (1 + ring / unit.gauge(*ring)) / 2
    corners = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
    lines = (line_path(points * [width, height]) for points in (corners, ring.T))
    return f'<path fill="#fff" fill-rule="evenodd" d="{"Z".join(lines)}Z"/>'


def _span(name: str, values: Floats) -> tuple[str, str]:
    return name, interval_text(values.min(), values.max(), "mm")
