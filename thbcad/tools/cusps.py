"""Cusps that a round tool leaves between two passes: their height, and what they do to the slopes.

To second order a pass that touches the graph leaves the height q d^2 / 2 above it, at the distance d from the
pass in x and y.  Half-way to the next pass, at s / 2, stands a cusp of height q s^2 / 8 between the slopes
+-q s / 2: slopes range over q s.

Ball of radius R, rows of contacts a step s apart: with the Hessian A of z, that of the ball at the same slope
N = W (I + g g^T) / R, M = N - A, and the directions e along the row and n across it,

    q = M_nn - M_en^2 / M_ee        (1 / q is the effective radius: 1 / R - curvature where z_en = 0).

Nose of radius r on a spiral: with s = z_rho, w^2 = 1 + s^2, G = w^3 - r z_rho_rho,

    q = G / r,     contacts are feed * w^3 / G apart,     so that slopes range over feed * w^3 / r.

Source: Faux and Pratt, Computational Geometry for Design and Manufacture.
"""

from dataclasses import dataclass

import numpy as np

from thbcad.checks import Floats, require_number, shown
from thbcad.splines import BSplineSurface
from thbcad.tools.spiral_motion import DERIVATIVES, round_axis


@dataclass(frozen=True, eq=False)
class Cusps:
    """Cusps at n positions; NaN where the tool does not fit.

    slopes : (2, n), the whole range of the slope that a pass adds, as a vector in x and y
    height : (n,) mm, in z.  pitch : (n,) mm, between contacts of neighbouring passes, in x and y
    """

    slopes: Floats
    height: Floats
    pitch: Floats


def ball_cusps(graph: BSplineSurface, x: Floats, y: Floats, ball: float, step: float, rows: str) -> Cusps:
    """Return the cusps of rows along "x" or "y", whose contacts are a step apart, at positions (n,).

    graph : scalar, with air above it.  ball, step : mm

    Raises ValueError : other rows, numbers that are not positive, positions outside the graph.
    """
    if rows not in ("x", "y"):
        raise ValueError(f'rows must run along "x" or "y", got {shown(rows)}')
    for name, number in (("ball", ball), ("step", step)):
        require_number(name, number, above=0, finite=True)
    z_x, z_y, z_xx, z_xy, z_yy = (graph(x, y, orders) for orders in DERIVATIVES)
    w = np.sqrt(1 + z_x**2 + z_y**2) / ball
    m_xx, m_xy, m_yy = w * (1 + z_x**2) - z_xx, w * z_x * z_y - z_xy, w * (1 + z_y**2) - z_yy
    along, across = (m_xx, m_yy) if rows == "x" else (m_yy, m_xx)
    fits = (along > 0) & (along * across > m_xy**2)
    q = np.where(fits, across - m_xy**2 / np.where(fits, along, 1.0), np.nan)
    width = q * step
    slopes = np.stack([0 * width, width] if rows == "x" else [width, 0 * width])
    return Cusps(slopes, q * step**2 / 8, np.full_like(q, step))


def nose_cusps(graph: BSplineSurface, x: Floats, y: Floats, nose: float, feed: float) -> Cusps:
    """Return the cusps of a spiral round x = y = 0 at positions (n,).

    graph : scalar, with air above it.  nose : mm.  feed : of the tool, mm for each revolution

    Raises ValueError : numbers that are not positive, positions outside the graph.
    """
    for name, number in (("nose", nose), ("feed", feed)):
        require_number(name, number, above=0, finite=True)
    at = round_axis(graph, x, y)
    cube = (1 + at.slope**2) ** 1.5
    gap = cube - nose * at.bend
    gap = np.where(gap > 0, gap, np.nan)
    pitch = feed * cube / gap
    width = feed * np.where(gap > 0, cube, np.nan) / nose
    return Cusps(width * np.stack([np.cos(at.theta), np.sin(at.theta)]), gap / nose * pitch**2 / 8, pitch)
