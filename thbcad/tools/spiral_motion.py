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

A centred spiral leaves a rectangle and comes back: on a circle of radius rho between the sides and the
corners the tool is over the lens near the corners alone.  Across each gap its height follows the polynomial
of degree 5 in the angle that has the height, the velocity and the acceleration of the tool where it leaves
the rectangle and where it comes back: the motion stays C^2.

The feed moves the tool by a hundredth of what the turning does, and is left out here.
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
SIDE = 1025  # points of contact on half a side; the acceleration is sampled, not proven
ANGLES = 33  # per gap
# rows: coefficients in s^0 .. s^5 of the polynomials with one of the values, first and second derivatives at
# s = 0 and s = 1 equal to one and the others to 0
HERMITE = np.array(
    [
        [1, 0, 0, -10, 15, -6],
        [0, 1, 0, -6, 8, -3],
        [0, 0, 0.5, -1.5, 1.5, -0.5],
        [0, 0, 0, 10, -15, 6],
        [0, 0, 0, -4, 7, -3],
        [0, 0, 0, 0.5, -1, 0.5],
    ]
)


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

    Raises ValueError : a position outside the graph.
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

    Raises ValueError : numbers that are not positive.
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


@dataclass(frozen=True, eq=False)
class Gaps:
    """The tool over the gaps, (gaps, n) each.

    x, y : mm, its lowest point.  t : mm, its height.  kernel : |t_theta_theta|, mm
    """

    x: Floats
    y: Floats
    t: Floats
    kernel: Floats

    def worst(self) -> tuple[float, float, float]:
        """Return (|t_theta_theta|, x, y) of the greatest acceleration met, mm."""
        at = np.unravel_index(int(np.argmax(self.kernel)), self.kernel.shape)
        return float(self.kernel[at]), float(self.x[at]), float(self.y[at])


def rim_gaps(graph: BSplineSurface, nose: float = 0.0) -> Gaps:
    """Return the motion of a nose over the gaps beside a graph's rectangle, whose middle is the axis.

    graph : scalar z(x, y).  nose : mm, one that fits.
    """
    hx, hy = graph.kv_u.stop, graph.kv_v.stop
    sides = []
    for middle, end, half in ((0.0, hx, hy), (90.0, hy, hx), (180.0, hx, hy), (270.0, hy, hx)):
        sides.append(_side(graph, nose, np.radians(middle), end, half))
    return Gaps(*(np.concatenate(parts) for parts in zip(*sides)))


def _side(
    graph: BSplineSurface, nose: float, middle: float, end: float, half: float
) -> tuple[Floats, Floats, Floats, Floats]:
    """Return (x, y, t, |t_theta_theta|) over the gaps beside one side; middle : angle of its normal."""
    along = np.linspace(0, half, SIDE)[1:]
    jets = (_jets(graph, nose, middle, end, sign * along) for sign in (-1.0, 1.0))
    out, back = (jet[:, np.argsort(jet[0])] for jet in jets)
    # of equal radius of the tool: both ends of a gap lie on one circle
    low, high = max(out[0].min(), back[0].min()), min(out[0].max(), back[0].max())
    rho = np.linspace(low, high, len(along))
    start, stop = (np.stack([np.interp(rho, jet[0], row) for row in jet[1:]]) for jet in (out, back))
    width = stop[0] - start[0]
    scale = np.stack([np.ones_like(width), width, width**2])
    ends = np.concatenate([start[1:] * scale, stop[1:] * scale])
    s = np.linspace(0, 1, ANGLES)
    powers = s[:, None] ** np.arange(6)
    bends = np.zeros_like(powers)
    bends[:, 2:] = np.arange(2, 6) * np.arange(1, 5) * powers[:, :4]
    t = ends.T @ (powers @ HERMITE.T).T
    kernel = abs(ends.T @ (bends @ HERMITE.T).T) / width[:, None] ** 2
    theta = middle + start[0][:, None] + width[:, None] * s
    return rho[:, None] * np.cos(theta), rho[:, None] * np.sin(theta), t, kernel


def _jets(graph: BSplineSurface, nose: float, middle: float, end: float, along: Floats) -> Floats:
    """Return rows (rho_t, theta - middle, t, t_theta, t_theta_theta) of contacts on a side, (5, n)."""
    normal, tangent = (np.cos(middle), np.sin(middle)), (-np.sin(middle), np.cos(middle))
    x, y = (np.round(n) * end + np.round(m) * along for n, m in zip(normal, tangent))
    at = round_axis(graph, x, y)
    rho, lift = at.nose(nose)
    gap = (1 + at.slope**2) ** 1.5 - nose * at.bend
    turn = at.turn + nose * at.mixed**2 / gap
    return np.stack([rho, np.arctan2(along, end), graph(x, y) + lift, at.rho * at.across, turn])
