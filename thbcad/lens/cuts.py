"""Apertures and polygons to which a lens is cut, and planar mounting flanges: whether there is room for them,
and what volume is left.
"""

from dataclasses import dataclass

import numpy as np

from thbcad.certified import value_range
from thbcad.checks import require_number, require_type
from thbcad.lens.lens import Lens
from thbcad.lens.rims import SIDES, rim, rim_pieces, ruled_edges
from thbcad.outlines import LEAST_SIZE, RELATIVE, Outline, Polygon, rim_curve, walled_volume
from thbcad.splines import UNIT, BSplineSurface, gauss_rule

NODES = 16  # of the Gauss rule on every span; its error falls by a factor per node


def require_aperture(lens: Lens, semi_axes: tuple[float, float]) -> Outline:
    """Return the ellipse of an aperture within both surfaces: every outline holds those in its half-widths.

    Raises ValueError : no Lens, semi-axes that are not two positive numbers or exceed a half-width.
    """
    require_type("lens", lens, Lens)
    ellipse = Outline.ellipse(semi_axes)
    for name, surface in (("front", lens.front), ("rear", lens.rear)):
        if any(s > h for s, h in zip(ellipse.half_width, surface.half_width)):
            raise ValueError(
                f"semi_axes must be at most the {name}'s half-widths {surface.half_width} mm, got "
                f"{ellipse.half_width}"
            )
    return ellipse


def walls_of(lens: Lens, semi_axes: tuple[float, float] | None) -> Outline:
    """Return the outline of a lens that is cut by an aperture, or its own, that of its greater half-widths.

    Raises ValueError : as `require_aperture`.
    """
    if semi_axes is not None:
        return require_aperture(lens, semi_axes)
    outline = lens.rear.outline
    greatest = tuple(max(pair) for pair in zip(lens.front.half_width, outline.half_width))
    return outline if greatest == outline.half_width else outline.scaled(greatest)


def aperture_volume(lens: Lens, semi_axes: tuple[float, float]) -> float:
    """Return the volume of a lens that is cut by an elliptic cylinder, mm^3.

    It is exact for the splines but for rounding.

    Raises ValueError : as `require_aperture`.
    """
    return walled_volume(lens.graphs(), lens.thickness, require_aperture(lens, semi_axes))


def require_polygon(lens: Lens, corners: object) -> Polygon:
    """Return the polygon of an outline within both surfaces.

    Raises ValueError : no Lens, as `Polygon`, or a corner beside an outline.
    """
    require_type("lens", lens, Lens)
    polygon = Polygon(corners)  # type: ignore[arg-type]
    for name, surface in (("front", lens.front), ("rear", lens.rear)):
        outline = surface.outline
        beyond = [c for c in polygon.corners if not outline.contains(*c, slack=RELATIVE)]
        if beyond:
            within = "half-widths" if outline.is_rectangle else "outline of half-widths"
            raise ValueError(
                f"the polygon must lie within the {name}'s {within} {surface.half_width} mm, got the "
                f"corner {beyond[0]}"
            )
    return polygon


def polygon_volume(lens: Lens, corners: object) -> float:
    """Return the volume of a lens that is cut by a straight wall over a polygon, mm^3.

    It is exact for the splines but for rounding.

    Raises ValueError : as `require_polygon`.
    """
    return walled_volume(lens.graphs(), lens.thickness, require_polygon(lens, corners))


@dataclass(frozen=True)
class Flange:
    """A flange between the planes z = low and z = high that extends `width` beyond the lens on all sides.

    Its outline is that of the lens with half-widths, and semi-axes of the corners, that are `width` greater;
    of surfaces of different size the greater half-widths count.

    width, low, high : float, mm; z = 0 is the vertex of the front

    Raises ValueError : numbers that are not finite; a width or a thickness high - low below 1e-6 mm.
    """

    width: float
    low: float
    high: float

    def __post_init__(self) -> None:
        for name, least in (("width", LEAST_SIZE), ("low", -np.inf), ("high", -np.inf)):
            require_number(f"flange {name}", getattr(self, name), least=least, finite=True)
            object.__setattr__(self, name, float(getattr(self, name)))
        if self.high - self.low < LEAST_SIZE:
            raise ValueError(
                f"flange high must be at least {LEAST_SIZE:g} mm above flange low = {self.low:.9g} mm, got "
                f"{self.high:.9g} mm"
            )

    def around(self, shape: Outline) -> Outline:
        """Return the outline round that of a lens or of its aperture."""
        (a, b), (c, d), width = shape.half_width, shape.corners, self.width
        corners = (0.0, 0.0) if shape.is_rectangle else (c + width, d + width)
        return Outline((a + width, b + width), corners)


def require_clear(lens: Lens, flange: Flange, semi_axes: tuple[float, float] | None = None) -> None:
    """Refuse a flange that meets front or rear: the front's rim must lie below it, the rear's rim above it.

    The heights of the rims are certified on the rectangle; round an aperture, those of the rim's splines are
    (`fitted_curve`).

    Raises ValueError : no Flange; no Lens; as `require_aperture`; a rim less than 1e-6 mm away from the
        flange.
    """
    require_type("flange", flange, Flange)
    top, bottom = rim_gap(lens, semi_axes)
    if flange.low < top + LEAST_SIZE:
        raise ValueError(
            f"flange low must lie above the front's rim, which reaches up to z = {top:.9g} mm, got "
            f"{flange.low:.9g} mm; a mount may be flush with a flat face (seat)"
        )
    if flange.high > bottom - LEAST_SIZE:
        raise ValueError(
            f"flange high must lie below the rear's rim, which reaches down to z = {bottom:.9g} mm, got "
            f"{flange.high:.9g} mm"
        )


def rim_gap(lens: Lens, semi_axes: tuple[float, float] | None = None) -> tuple[float, float]:
    """Return up to which z the front's rim reaches, and down to which the rear's does, mm, certified.

    Raises ValueError : no Lens; as `require_aperture`.
    """
    require_type("lens", lens, Lens)
    top = max(value_range(curve)[1].upper for curve in rim_heights(lens, 0, semi_axes))
    bottom = lens.thickness + min(value_range(curve)[0].lower for curve in rim_heights(lens, 1, semi_axes))
    return top, bottom


def rim_heights(lens: Lens, k: int, semi_axes: tuple[float, float] | None = None) -> list[BSplineSurface]:
    """Return the heights of the rim of front (0) or rear (1), curve by curve, as graphs that are constant in
    their second parameter."""
    graph = lens.graphs()[k]
    if lens.rear.outline.is_rectangle and semi_axes is None:
        curves = [rim(graph, side) for side in SIDES]
    else:
        pieces = rim_pieces(lens)[k] if semi_axes is None else require_aperture(lens, semi_axes).pieces
        curves = [(kv, poles[:, 2]) for kv, poles in (rim_curve(graph, piece) for piece in pieces)]
    return [BSplineSurface(kv, UNIT, np.stack([z, z], axis=1)) for kv, z in curves]


def flanged_volume(lens: Lens, flange: Flange, semi_axes: tuple[float, float] | None = None) -> float:
    """Return the volume of a lens with a flange, mm^3.

    V = V_lens + (high - low) A_outline - V_inside, V_inside the part of the lens between the planes.

    semi_axes : of an elliptic aperture, mm; None is the whole lens.

    Raises ValueError : as `require_clear`.
    """
    require_clear(lens, flange, semi_axes)
    depth = flange.high - flange.low
    shape = walls_of(lens, semi_axes)
    around = depth * flange.around(shape).area
    if semi_axes is not None:
        return aperture_volume(lens, semi_axes) + around - depth * shape.area
    return lens.volume() + around - _inside(lens, flange)


def _inside(lens: Lens, flange: Flange) -> float:
    """Return the volume of a lens between two planes that meet only its edges.

    By Stokes' theorem it is the integral of (x dy - y dx) dz / 2 over the edges (s, v) between the planes.
    """
    total = 0.0
    edges = ruled_edges(lens)
    signs = (
        [-1 if side.clockwise else 1 for side in SIDES]
        if lens.rear.outline.is_rectangle
        else [1] * len(edges)
    )
    for sign, edge in zip(signs, edges):
        s, weights = gauss_rule(edge.kv_u.breaks, NODES)
        (front, rear), (slope, other) = (np.moveaxis(edge.grid(s, [0.0, 1.0], (d, 0)), 1, 0) for d in (0, 1))
        low, high = ((z - front[:, 2]) / (rear - front)[:, 2] for z in (flange.low, flange.high))
        for fraction, weight in zip(*gauss_rule(np.array([0.0, 1.0]), 2)):
            v = (low + fraction * (high - low))[:, None]
            point = front + v * (rear - front)
            along = slope + v * (other - slope)
            up = rear - front
            x, y, _ = point.T
            form = (x * along[:, 1] - y * along[:, 0]) * up[:, 2] - (x * up[:, 1] - y * up[:, 0]) * along[
                :, 2
            ]
            total += sign * weight * float((weights * (high - low)) @ form) / 2
    return total
