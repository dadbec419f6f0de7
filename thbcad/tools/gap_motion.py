"""What a tool does outside a rectangle, where a centred spiral leaves it and comes back.

On a circle of radius rho between the sides and the corners the tool is over the lens near the corners alone.
Across each gap its height follows the polynomial of degree 5 in the angle that has the height, the velocity
and the acceleration of the tool where it leaves the rectangle and where it comes back: the motion stays C^2.

The feed moves the tool by a hundredth of what the turning does, and is left out here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from thbcad.checks import Floats
from thbcad.splines import BSplineSurface
from thbcad.tools.spiral_motion import round_axis

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
