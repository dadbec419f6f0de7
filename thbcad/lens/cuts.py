"""Apertures and polygons to which a lens is cut: whether it has room for them, and what volume is left."""

from __future__ import annotations

from thbcad.checks import require_type
from thbcad.lens.lens import Lens
from thbcad.outlines import RELATIVE, Outline, Polygon, walled_volume


def require_aperture(lens: Lens, semi_axes: tuple[float, float]) -> Outline:
    """Return the ellipse of an aperture within both surfaces: every outline holds those in its half-widths.

    Raises
    ------
    ValueError : no Lens, semi-axes that are not two positive numbers or exceed a half-width.
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

    Raises
    ------
    ValueError : as `require_aperture`.
    """
    if semi_axes is not None:
        return require_aperture(lens, semi_axes)
    outline = lens.rear.outline
    greatest = tuple(max(pair) for pair in zip(lens.front.half_width, outline.half_width))
    return outline if greatest == outline.half_width else outline.scaled(greatest)


def aperture_volume(lens: Lens, semi_axes: tuple[float, float]) -> float:
    """Return the volume of a lens that is cut by an elliptic cylinder, mm^3.

    It is exact for the splines but for rounding.

    Raises
    ------
    ValueError : as `require_aperture`.
    """
    return walled_volume(lens.graphs(), lens.thickness, require_aperture(lens, semi_axes))


def require_polygon(lens: Lens, corners: object) -> Polygon:
    """Return the polygon of an outline within both surfaces.

    Raises
    ------
    ValueError : no Lens, as `Polygon`, or a corner beside an outline.
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

    Raises
    ------
    ValueError : as `require_polygon`.
    """
    return walled_volume(lens.graphs(), lens.thickness, require_polygon(lens, corners))
