"""The light of lamps on a road: what a point receives, what a driver sees of it, and what dazzles the driver.

A lamp at the height h above the road, whose intensity towards a point at the distance d is I, makes there

    E = I h / d^3,    L = I r(beta, tan gamma) / h^2,    both times the maintenance factor.

The lamps up to 5 h before and behind a point count, and for L up to 12 h beyond it.  In the eye, in a
plane across the line of sight, E = I cos(theta) / d^2, where theta is the angle in degrees between lamp
and line of sight.  It veils as the luminance

    Lv = E (10 / theta^3 + 5 / theta^2 (1 + (A / 62.5)^4)) for 0.1 < theta <= 1.5,
    Lv = 9.86 E / theta^2 (1 + (A / 66.4)^4)               for 1.5 < theta <= 60,

summed over the lamps up to 500 m ahead that the roof of the car does not hide, by initial light and for
the age A = 23 years.  With the initial mean luminance the threshold increment is fTI = 65 Lv / L^0.8, and
95 Lv / L^1.05 above 5 cd/m^2, in per cent.

Source: EN 13201-3:2015.  `road_classes` says what was compared with what.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

import numpy as np

from optics.light.roads.installation import Installation
from optics.light.roads.reflection import RoadSurface
from optics.scene.luminaires import Luminaire
from thbcad.checks import Bools, Floats

NEAR, BEYOND = 5.0, 12.0  # heights of lamps along the road; beyond a point as the driver sees it
EYE, BEFORE = 1.5, 60.0  # m: height of the eye, and how far before the field
DOWN, ROOF = np.radians(1.0), np.tan(np.radians(20.0))  # the line of sight; what the roof hides
FIRST = 2.75  # heights above the eye at which the roof lets go of a lamp
AHEAD = 500.0  # m
AGE = 23.0  # years
ANGLES = 0.1, 1.5, 60.0  # degrees from the line of sight
BRIGHT = 5.0  # cd/m^2


@dataclass(frozen=True, eq=False)
class LitRoad:
    """A road under lamps of an intensity in candela.

    lamp : of one lens; its +z hangs down.
    """

    road: Installation
    lamp: Luminaire

    def illuminance(self, points: Floats) -> Floats:
        """Return the maintained illuminance at points, (n,) lx.  points : (2, n) m."""
        height = self.road.height
        way, candela = self._from_lamps(points, 0.0, (-NEAR * height, NEAR * height))
        return self.road.maintenance * (candela * height / np.linalg.norm(way, axis=0) ** 3).sum(axis=1)

    def luminance(self, points: Floats, y: float, surface: RoadSurface) -> Floats:
        """Return the maintained luminance of points of the field, (n,) cd/m^2, for an eye at y."""
        height = self.road.height
        (dx, dy, _), candela = self._from_lamps(points, 0.0, (-NEAR * height, BEYOND * height))
        u, v = points[0, :, None] + BEFORE, points[1, :, None] - y
        cross, along = u * dy - v * dx, -(u * dx + v * dy)
        beta = np.degrees(np.arctan2(np.abs(cross), along))
        r = surface.at(beta, np.hypot(dx, dy) / height)
        return self.road.maintenance * (candela * r).sum(axis=1) / height**2

    def veiling(self, y: float) -> float:
        """Return the greatest initial veiling luminance for a driver along y, cd/m^2."""
        road = self.road
        x = road.columns - road.columns[0] - FIRST * (road.height - EYE)
        eyes = np.stack([x, np.full(len(x), y)])
        way, candela = self._from_lamps(eyes, EYE, (0.0, AHEAD))
        dx, _, dz = -way
        distance = np.linalg.norm(way, axis=0)
        cosine = (dx * np.cos(DOWN) - dz * np.sin(DOWN)) / distance
        theta = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
        least, close, most = ANGLES
        seen: Bools = (theta > least) & (theta <= most) & (dz <= dx * ROOF)
        theta = np.where(seen, theta, inf)
        veil = np.where(
            theta <= close,
            10 / theta**3 + 5 / theta**2 * (1 + (AGE / 62.5) ** 4),
            9.86 / theta**2 * (1 + (AGE / 66.4) ** 4),
        )
        return float((veil * candela * cosine / distance**2).sum(axis=1).max())

    def threshold_increment(self, y: float, luminance: float) -> float:
        """Return fTI for a driver along y, per cent.  luminance : the maintained mean, cd/m^2."""
        initial = luminance / self.road.maintenance
        scale = 65 / initial**0.8 if initial <= BRIGHT else 95 / initial**1.05
        return scale * self.veiling(y)

    def edge_ratio(self) -> float:
        """Return REI: mean illuminance of a strip as wide as a lane just outside over one just inside.

        That of the edge where it is less.
        """
        wide, edge = self.road.lane_width, self.road.width
        strips = [(-wide, 0.0), (0.0, wide), (edge, edge + wide), (edge - wide, edge)]
        outside, inside, beyond, within = (self.illuminance(self.road.strip(*s)).mean() for s in strips)
        return float(min(outside / inside, beyond / within)) if inside and within else 0.0

    def _from_lamps(self, points: Floats, z: float, reach: tuple[float, float]) -> tuple[Floats, Floats]:
        """Return the ways from all lamps that count to points, (3, n, m) m, and the intensities, (n, m) cd.

        points : (2, n).  z : m.  reach : of lamps along x, from each point; those beyond it have no light.
        """
        road, (low, high) = self.road, reach
        x, y, side = road.lamps(points[0].min() + low, points[0].max() + high)
        dx, dy = points[0, :, None] - x, points[1, :, None] - y
        dz = np.full(dx.shape, z - road.height)
        cosine, sine = np.cos(np.radians(road.tilt)), np.sin(np.radians(road.tilt))
        own = side * dx, -(side * cosine * dy + sine * dz), side * sine * dy - cosine * dz
        candela = self.lamp.intensity(np.stack([a.ravel() for a in own])).reshape(dx.shape)
        counts = (-dx >= low) & (-dx <= high)
        return np.stack([dx, dy, dz]), np.where(counts, road.lenses * candela, 0.0)
