"""The motion of a nose that cuts a graph z(x, y) on a spiral round the axis x = y = 0 (slow tool servo).

The nose is a circle of radius r in the plane through the axis.  It touches the graph at rho, where s = z_rho,
w^2 = 1 + s^2, and its lowest point, which a machine is given, is then at

    rho_t = rho - r s / w,     t = z + r / w - r.

The tool never changes its angle: t(rho_t, theta) is the maximum of z(rho_t + d, theta) + sqrt(r^2 - d^2) - r
over d.  With G = w^3 - r z_rho_rho

    t_theta = z_theta,                                   t_rho = z_rho,
    t_theta_theta = z_theta_theta + r z_rho_theta^2 / G,
    t_rho_theta = w^3 z_rho_theta / G,                   t_rho_rho = w^3 z_rho_rho / G,
    z'' = omega^2 t_theta_theta + 2 omega rho' t_rho_theta + rho'^2 t_rho_rho,   rho' = +-q omega.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot, pi, sqrt

import numpy as np

from thbcad.checks import Floats, require_number
from thbcad.splines import BSplineSurface

DERIVATIVES = ((1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
RIM = 1001  # points of a corner, by which its farthest one is known
SECONDS = 60.0  # of a minute
MINUTES = 60.0  # of an hour


@dataclass(frozen=True, eq=False)
class RoundAxis:
    """Derivatives of a graph round the axis at positions, (...) each.

    rho, theta : mm and radians.  slope : z_rho.  across : z_theta / rho.  turn : z_theta_theta
    mixed : z_rho_theta.  bend : z_rho_rho
    """

    rho: Floats
    theta: Floats
    slope: Floats
    across: Floats
    turn: Floats
    mixed: Floats
    bend: Floats

    @classmethod
    def of(cls, x: Floats, y: Floats, derivatives: Floats) -> RoundAxis:
        """Return them for z_x, z_y, z_xx, z_xy, z_yy, (5, ...); at x = y = 0 in the direction of x."""
        z_x, z_y, z_xx, z_xy, z_yy = derivatives
        rho, theta = np.hypot(x, y), np.arctan2(y, x)
        c, s = np.cos(theta), np.sin(theta)
        slope, across = c * z_x + s * z_y, c * z_y - s * z_x
        return cls(
            rho=rho,
            theta=theta,
            slope=slope,
            across=across,
            turn=rho**2 * (s * s * z_xx - 2 * c * s * z_xy + c * c * z_yy) - rho * slope,
            mixed=rho * (c * s * (z_yy - z_xx) + (c * c - s * s) * z_xy) + across,
            bend=c * c * z_xx + 2 * c * s * z_xy + s * s * z_yy,
        )

    def nose(self, radius: float) -> tuple[Floats, Floats]:
        """Return (rho_t, t - z) of the lowest point of a nose that touches here, mm."""
        w = np.sqrt(1 + self.slope**2)
        return self.rho - radius * self.slope / w, radius / w - radius


def round_axis(graph: BSplineSurface, x: Floats, y: Floats) -> RoundAxis:
    """Return the derivatives of a scalar graph z(x, y) round the axis x = y = 0 at positions, (n,) each.

    Raises
    ------
    ValueError : a position outside the graph.
    """
    return RoundAxis.of(x, y, np.stack([graph(x, y, orders) for orders in DERIVATIVES]))


def tool_acceleration(at: RoundAxis, nose: float, advance: float) -> Floats:
    """Return |z''| / omega^2 at points of contact, mm, the greater of both senses of the feed.

    nose : r, mm.  advance : q, mm for each radian.
    """
    cube = (1 + at.slope**2) ** 1.5
    gap = cube - nose * at.bend
    along = at.turn + nose * at.mixed**2 / gap + advance**2 * cube * at.bend / gap
    return np.asarray(abs(along) + 2 * advance * cube * abs(at.mixed) / gap)


@dataclass(frozen=True)
class SpiralCut:
    """A spiral from the rim of an outline or from outside to the axis.

    feed : mm for each revolution.  radius : mm, where the spiral begins.

    Raises
    ------
    ValueError : numbers that are not positive.
    """

    feed: float
    radius: float

    def __post_init__(self) -> None:
        for name in ("feed", "radius"):
            require_number(name, getattr(self, name), above=0, finite=True)

    @classmethod
    def over(
        cls, half_width: tuple[float, float], feed: float, corners: tuple[float, float] = (0.0, 0.0)
    ) -> SpiralCut:
        """Return the spiral that covers a rectangle, or an outline with these corners, up to the farthest
        point of its rim."""
        if not any(corners):
            return cls(feed, hypot(*half_width))
        turn = np.linspace(0, pi / 2, RIM)
        x, y = (h - c + c * f(turn) for h, c, f in zip(half_width, corners, (np.cos, np.sin)))
        return cls(feed, float(np.hypot(x, y).max()))

    @property
    def advance(self) -> float:
        """The way along rho for each radian, mm."""
        return self.feed / (2 * pi)

    @property
    def turns(self) -> float:
        """Revolutions."""
        return self.radius / self.feed

    @property
    def length(self) -> float:
        """The way of the tool over the turning lens, m: pi radius^2 / feed."""
        return pi * self.radius**2 / self.feed / 1e3

    def hours(self, rpm: float) -> float:
        """Return the time of one pass at constant revolutions for each minute."""
        return self.turns / rpm / MINUTES


def highest_rpm(limit: float, kernel: float) -> float:
    """Return the revolutions for each minute at which the acceleration reaches a limit.

    limit : m/s^2.  kernel : |z''| / omega^2, mm.  Infinite where the tool does not move.
    """
    return SECONDS / (2 * pi) * sqrt(1e3 * limit / kernel) if kernel > 0 else float("inf")


def acceleration_at(rpm: float, kernel: float) -> float:
    """Return the acceleration in m/s^2.  kernel : |z''| / omega^2, mm."""
    return (2 * pi * rpm / SECONDS) ** 2 * kernel / 1e3
