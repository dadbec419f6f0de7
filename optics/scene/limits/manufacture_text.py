"""The metrics for manufacturing as rows of text and as plain data."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any

from thbcad.certified import Enclosure
from thbcad.lens import HeightRange, Manufacturability, SurfaceMetrics

Row = tuple[str, float, str, str]


@dataclass(frozen=True)
class LitPart:
    """The least radii of curvature of a surface, mm, over the part that light meets.

    half_width : of that part, which has the shape of the outline, mm.
    """

    half_width: tuple[float, float]
    concave: Enclosure
    convex: Enclosure


def manufacture_rows(
    metrics: Manufacturability,
    wavelength: float,
    names: Sequence[str] = ("front", "rear"),
    lit: Mapping[str, LitPart] | None = None,
) -> list[Row]:
    """Return rows (name, value, unit, position); a radius that occurs nowhere is infinite.

    wavelength : nm, with which the features are compared.  names : of the faces, in words.
    lit : the parts of "front" and "rear" that light meets.
    """
    rows = [
        ("centre thickness", metrics.centre_thickness.value, "mm", position(metrics.centre_thickness)),
        ("edge thickness", metrics.edge_thickness.value, "mm", position(metrics.edge_thickness)),
        ("least thickness", metrics.thickness.value, "mm", position(metrics.thickness)),
        ("greatest thickness", metrics.greatest_thickness.value, "mm", position(metrics.greatest_thickness)),
    ]
    for name, (side, surface) in zip(names, metrics.surfaces.items()):
        rows += _surface_rows(name, surface, wavelength, (lit or {}).get(side))
    rows.append(("volume", metrics.volume, "mm^3", ""))
    if metrics.mass is not None:
        rows.append(("mass", metrics.mass, "g", ""))
    return rows


def as_data(metrics: Manufacturability, lit: Mapping[str, LitPart] | None = None) -> dict[str, Any]:
    """Return the metrics as plain data for JSON; an infinite number is None.  lit : as of the rows."""
    thicknesses = {
        name: bound_data(getattr(metrics, name))
        for name in ("thickness", "centre_thickness", "edge_thickness", "greatest_thickness")
    }
    return {
        **{f"{name}_mm": data for name, data in thicknesses.items()},
        **{
            name: _surface_data(surface) | {"lit_part": _lit_data((lit or {}).get(name))}
            for name, surface in metrics.surfaces.items()
        },
        "volume_mm3": metrics.volume,
        "density_g_cm3": metrics.density,
        "mass_g": metrics.mass,
    }


def position(extreme: Enclosure) -> str:
    """Return where an extreme lies."""
    return f"at x = {_length(extreme.u)}, y = {_length(extreme.v)} mm"


def positions(heights: HeightRange) -> str:
    """Return where the least and the greatest height lie."""
    low, high = ((_length(at.u), _length(at.v)) for at in (heights.least, heights.greatest))
    return f"between x = {low[0]}, y = {low[1]} and x = {high[0]}, y = {high[1]} mm"


def _length(value: float) -> str:
    """Return a length in mm as text, rounding left out: 0 for 1e-15."""
    return f"{round(value, 9) + 0.0:.4g}"


def _surface_rows(
    name: str, surface: SurfaceMetrics, wavelength: float, lit: LitPart | None
) -> Iterator[Row]:
    yield f"greatest slope of the {name}", surface.slope.value, "degrees", position(surface.slope)
    for side in ("concave", "convex"):
        radius = getattr(surface, side)
        yield _radius_row(f"least {side} radius of the {name}", side, radius)
        if lit is not None:
            yield _radius_row(
                f"least {side} radius of the {name} where light meets it", side, getattr(lit, side)
            )
    yield f"range of heights of the {name}", surface.heights.value, "mm", positions(surface.heights)
    if surface.departure is not None:
        yield f"range of the sag of the {name}", surface.departure.value, "mm", positions(surface.departure)
    if surface.feature is not None:
        level = f"on level {surface.feature.level}"
        for axis, size in zip("xy", surface.feature.size):
            yield f"smallest feature of the {name} in {axis}", size, "mm", level
        yield f"smallest feature of the {name}", surface.feature.wavelengths(wavelength), "wavelengths", level
    yield f"area of the {name}", surface.area, "mm^2", ""


def _radius_row(name: str, side: str, radius: Enclosure) -> Row:
    return name, radius.value, "mm", position(radius) if isfinite(radius.value) else f"nowhere {side}"


def _lit_data(lit: LitPart | None) -> dict[str, Any] | None:
    if lit is None:
        return None
    return {
        "half_width_mm": list(lit.half_width),
        "concave_radius_mm": bound_data(lit.concave),
        "convex_radius_mm": bound_data(lit.convex),
    }


def _surface_data(surface: SurfaceMetrics) -> dict[str, Any]:
    feature = surface.feature
    return {
        "slope_degrees": bound_data(surface.slope),
        "concave_radius_mm": bound_data(surface.concave),
        "convex_radius_mm": bound_data(surface.convex),
        "heights_mm": _range_data(surface.heights),
        "sag_mm": None if surface.departure is None else _range_data(surface.departure),
        "feature": None
        if feature is None
        else {"level": feature.level, "span_mm": list(feature.span), "size_mm": list(feature.size)},
        "area_mm2": surface.area,
        "area_error_mm2": surface.area_error,
    }


def bound_data(extreme: Enclosure) -> dict[str, float | None]:
    """Return an extreme value, its bounds and its place as plain data; None is infinite, and nowhere."""
    numbers = {name: getattr(extreme, name) for name in ("value", "lower", "upper")}
    somewhere = isfinite(extreme.value)
    return {name: number if isfinite(number) else None for name, number in numbers.items()} | {
        "x": extreme.u if somewhere else None,
        "y": extreme.v if somewhere else None,
    }


def _range_data(heights: HeightRange) -> dict[str, Any]:
    numbers = {name: getattr(heights, name) for name in ("value", "lower", "upper")}
    return numbers | {"least": bound_data(heights.least), "greatest": bound_data(heights.greatest)}
