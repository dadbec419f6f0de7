"""Certified bounds for a tool that cuts a graph z(x, y) on a spiral round the axis x = y = 0.

The tool is a nose of radius r in the plane through the axis.  With s = z_rho, w^2 = 1 + s^2 and
G = w^3 - r z_rho_rho at the point of contact, its height t(rho, theta) has (see `spiral_motion`)

    t_theta_theta = z_theta_theta + r z_rho_theta^2 / G,
    t_rho_theta = w^3 z_rho_theta / G,     t_rho_rho = w^3 z_rho_rho / G.

The acceleration of the tool axis over the square of the angular speed is, on a path rho' = +-q theta',

    z'' / omega^2 = t_theta_theta +- 2 q t_rho_theta + q^2 t_rho_rho.

On every cell this is put together from the ranges of the derivatives; branch and bound makes the cells small
where it matters.
"""

from dataclasses import replace
from functools import partial

import numpy as np

from thbcad.certified import Assessment, Cells, Enclosure, greatest, within
from thbcad.checks import require_number
from thbcad.outlines import Outline
from thbcad.splines import BSplineSurface
from thbcad.tools.polar_cells import SAFE, errors, held, polar_cells, ranges, values
from thbcad.tools.spiral_motion import RoundAxis, tool_acceleration

TOLERANCE = 1e-3  # relative, finer than noses are measured, and machines keep accelerations
# what is less is told no better, to TOLERANCE of this: radii of a kilometre, slopes of a milliradian, and
# 0.1 mm of |z''| / omega^2, of which the thousandth is 4e-4 m/s^2 at 600 revolutions for each minute
STRAIGHT, LEVEL, STILL = 1e-6, 1e-3, 0.1
SECOND_ORDER = 2  # times the first-order bound of an error of 1e-9 covers what is of higher order


def greatest_section_curvature(graph: BSplineSurface, outline: Outline | None = None) -> Enclosure:
    """Return certified bounds of the greatest curvature of sections through the axis, z_rho_rho / w^3, 1/mm.

    A nose of radius r cuts a spiral without cutting into the graph exactly where r z_rho_rho / w^3 <= 1
    everywhere.  Curvatures below 0 count as 0.

    outline : Outline or None, only points inside count

    Raises ValueError : a graph that is not scalar, degree 1, derivatives above 1e40.
    """
    degrees = graph.kv_u.degree, graph.kv_v.degree
    if min(degrees) < 2:
        raise ValueError(f"curvature needs degree 2 or more in x and y, got degrees {degrees}")
    return _not_below_zero(greatest(within(polar_cells(graph), outline), _section_curvature, TOLERANCE))


def greatest_slope_along_cut(graph: BSplineSurface, outline: Outline | None = None) -> Enclosure:
    """Return certified bounds of the greatest slope along circles round the axis, |z_theta| / rho.

    outline : Outline or None, only points inside count

    Raises ValueError : a graph that is not scalar, derivatives above 1e40.
    """
    return _not_below_zero(greatest(within(polar_cells(graph), outline), _slope_along_cut, TOLERANCE))


def greatest_acceleration(
    graph: BSplineSurface,
    nose: float = 0.0,
    advance: float = 0.0,
    tolerance: float = TOLERANCE,
    outline: Outline | None = None,
) -> Enclosure:
    """Return certified bounds of the greatest |z''| / omega^2 of the tool over the graph, mm.

    nose : radius of the tool's nose, mm.  advance : q, the way along rho for each radian, mm: the feed for
    each revolution over 2 pi.  Both senses of feed and of rotation count.  outline : as above

    Raises ValueError : a graph that is not scalar, degree 1, a nose that is not proven to fit, numbers below
        0.
    """
    require_number("nose", nose, least=0, finite=True)
    require_number("advance", advance, least=0, finite=True)
    fit = greatest_section_curvature(graph, outline=outline)
    if nose * fit.upper >= 1:
        raise ValueError(
            f"a nose of {nose:g} mm is not proven to fit: the least concave radius of sections through the "
            f"axis is {1 / fit.upper:.6g} mm; take a smaller nose"
        )
    assess = partial(acceleration, nose=nose, advance=advance, free=1 - nose * fit.upper)
    return _not_below_zero(greatest(within(polar_cells(graph), outline), assess, tolerance))


def _section_curvature(cells: Cells, best: float) -> Assessment:
    within, at = ranges(cells), values(cells)
    met = held(cells, np.maximum(at.bend, 0) / (1 + at.slope**2) ** 1.5)
    upper = np.maximum(within.bend, 0) / (1 + within.flat**2) ** 1.5 * SAFE
    # the derivative by the slope is at most 3/2 |z_rho_rho|
    of = errors(cells)
    error = of["bend"] + 2 * float(abs(at.bend).max()) * of["slope"]
    return Assessment(met, SECOND_ORDER * error, upper, max(best, float(met.max()), STRAIGHT))


def _slope_along_cut(cells: Cells, best: float) -> Assessment:
    met = held(cells, abs(values(cells).across))
    return Assessment(met, errors(cells)["across"], ranges(cells).across, max(best, float(met.max()), LEVEL))


def acceleration(cells: Cells, best: float, nose: float, advance: float, free: float) -> Assessment:
    """Assess |z''| / omega^2.  free : a bound of 1 - r z_rho_rho / w^3 from below, over the whole graph."""
    within, at = ranges(cells), values(cells)
    met = held(cells, tool_acceleration(at, nose, advance))
    least, most = ((1 + s**2) ** 1.5 for s in (within.flat, within.steep))
    gap = np.maximum(least - nose * within.bend, free * least) / SAFE
    # w^3 / G = 1 / (1 - r z_rho_rho / w^3)
    ratio = np.minimum(most / gap, 1 / free) * SAFE
    high = within.high + nose * within.mixed**2 / gap * SAFE
    low = within.low + nose * within.mixed_low**2 / (most - nose * within.bend_low) / SAFE
    bend = np.maximum(abs(within.bend), abs(within.bend_low))
    along = np.maximum(high, -low) + (2 * advance * within.mixed + advance**2 * bend) * ratio
    error = SECOND_ORDER * _error(at, errors(cells), nose, advance, free)
    return Assessment(met, error, along * SAFE, max(best, float(met.max()), STILL))


def _error(at: RoundAxis, of: dict[str, float], nose: float, advance: float, free: float) -> float:
    """Return the error that the rounding of the derivatives makes in `tool_acceleration`, to first order."""
    ratio = 1 / free
    mixed, bend = float(abs(at.mixed).max()), float(abs(at.bend).max())
    # the logarithms of w^3 / G and of 1 / G change at most by this
    change = ratio * (3 * of["slope"] * (1 + nose * bend) + nose * of["bend"])
    turned = nose * (2 * mixed * of["mixed"] + mixed**2 * change) * ratio
    fed = 2 * advance * (of["mixed"] + mixed * change) + advance**2 * (of["bend"] + bend * change)
    return of["turn"] + turned + ratio * fed


def _not_below_zero(found: Enclosure) -> Enclosure:
    return replace(found, lower=max(found.lower, 0.0))
