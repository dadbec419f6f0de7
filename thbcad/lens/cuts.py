"""Apertures and polygons to which a lens is cut: whether it has room for them, and what volume is left."""

from __future__ import annotations

from thbcad.checks import require_type
from thbcad.lens.lens import Lens
from thbcad.outlines import Ellipse, Polygon, ellipse_integral, polygon_integral


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
