"""The light that rays of a camera meet in a photograph's room, without the lens.

Radiances are relative to the brightest light on the screen.  The room is invented, the light on the screen is
measured.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from optics.reporting.view.photo_room import PhotoRoom
from thbcad.checks import Floats, Integers

# the path to a thing, inf where it is not met, (n,), and the radiance of some of the rays that meet it
Meeting = tuple[Floats, Callable[[Integers], Floats]]

WARM, COOL = np.array([1.0, 0.96, 0.9]), np.array([0.78, 0.88, 1.0])
FRAME = 1.025  # of the screen's half-width
BLACK = 0.012 * COOL  # of the unlit screen
WOOD = np.array([0.026, 0.023, 0.021])  # of the table in the light of the room
METAL = np.array([0.05, 0.05, 0.055])
DOTS = 5  # bright spots of a lamp of parallel light, from its middle to its rim
LOBE = 0.02  # 1 - cosine: how far beside its direction a lamp of parallel light glows
SCREEN_GLOW = 0.25  # of the screen's mean light, on the table before it
POST = 0.06  # of the lens's half-width: radius of the post it stands on


@dataclass(frozen=True, eq=False)
class PhotoLight:
    """A room and the light on its screen, (rows, columns, 3), linear sRGB, row 0 at +y."""

    room: PhotoRoom
    picture: Floats

    @cached_property
    def size(self) -> float:
        """Half the width of the lens, mm."""
        return float(np.ptp(self.room.lens[:2], axis=1).max() / 2)

    @cached_property
    def mean(self) -> Floats:
        return self.picture.mean(axis=(0, 1))

    def along(self, origin: Floats, direction: Floats) -> Floats:
        """Return the radiance that rays (3, n) meet, (n, 3)."""
        # a dark room with a soft lamp above on the left
        up = np.clip(direction[1], -1, 1)
        soft = np.exp(-((direction[0] + 0.55) ** 2 + (up - 0.62) ** 2) / 0.05)
        grey = 0.002 + 0.05 * np.maximum(up, 0) + 0.9 * soft
        colour = grey[:, None] * COOL
        nearest = np.full(origin.shape[1], np.inf)
        for path, shade in (
            self._table(origin, direction),
            self._lamp(origin, direction),
            self._post(origin, direction),
            self._screen(origin, direction),
        ):
            first = np.flatnonzero(path < nearest)
            nearest[first] = path[first]
            colour[first] = shade(first)
        return colour

    def table_path(self, origin: Floats, direction: Floats) -> Floats:
        """Return the path to the table where it is met first, inf elsewhere, (n,)."""
        path = self._table(origin, direction)[0]
        for other in (self._screen, self._post, self._lamp):
            path[other(origin, direction)[0] < path] = np.inf
        return path

    def screen_path(self, origin: Floats, direction: Floats) -> Floats:
        """Return the path to the screen with its frame, inf where it is not met, (n,)."""
        return self._screen(origin, direction)[0]

    def _table(self, origin: Floats, direction: Floats) -> Meeting:
        with np.errstate(divide="ignore"):
            path = np.where(direction[1] < 0, (self.room.table - origin[1]) / direction[1], np.inf)
        path[path <= 0] = np.inf
        hx, hy, z = self.room.screen

        def shade(some: Integers) -> Floats:
            x, _, depth = origin[:, some] + path[some] * direction[:, some]
            wide = 2.5 * (hx + z)
            room = 1 / (1 + (x * x + (depth - z / 2) ** 2) / wide**2) ** 2
            beside = np.maximum(abs(x) - hx, 0) ** 2 + (depth - z) ** 2
            glow = SCREEN_GLOW / (1 + beside / hy**2) ** 1.5
            return WOOD * (room[:, None] + 14 * glow[:, None] * self.mean)

        return path, shade

    def _rectangle(self, origin: Floats, direction: Floats, z: float) -> tuple[Floats, Floats, Floats]:
        """Return the path to a plane z, inf where it is never met, and x and y there."""
        with np.errstate(divide="ignore", invalid="ignore"):
            path = (z - origin[2]) / direction[2]
        path[~(path > 1e-9 * self.size)] = np.inf
        reached = np.where(np.isfinite(path), path, 0.0)
        return path, origin[0] + reached * direction[0], origin[1] + reached * direction[1]

    def _lamp(self, origin: Floats, direction: Floats) -> Meeting:
        hx, hy, z = self.room.lamp
        path, x, y = self._rectangle(origin, direction, z)
        x, y = x / hx, y / hy
        outside = x * x + y * y > 1 if self.room.round_lamp else np.maximum(abs(x), abs(y)) > 1
        path[outside | (direction[2] >= 0)] = np.inf

        def shade(some: Integers) -> Floats:
            if not self.room.parallel:
                return np.broadcast_to(1.5 * WARM, (some.size, 3))
            dots = (np.cos(DOTS * np.pi * x[some]) * np.cos(DOTS * np.pi * y[some])) ** 8
            glow = 0.02 + 0.35 * dots + 1.2 * np.exp(-(1 + direction[2, some]) / LOBE)
            return glow[:, None] * WARM

        return path, shade

    def _post(self, origin: Floats, direction: Floats) -> Meeting:
        """The post below the lens: an upright cylinder."""
        (_, _), (bottom, _), depths = self.room.lens
        radius = POST * self.size
        ox, oz = origin[0], origin[2] - depths.mean()
        dx, dz = direction[0], direction[2]
        a, b = np.maximum(dx * dx + dz * dz, 1e-30), ox * dx + oz * dz
        root = b * b - a * (ox * ox + oz * oz - radius**2)
        path = np.where(root > 0, (-b - np.sqrt(np.maximum(root, 0))) / a, np.inf)
        reached = np.where(np.isfinite(path), path, 0.0)
        y = origin[1] + reached * direction[1]
        path[(path <= 0) | (y > bottom) | (y < self.room.table)] = np.inf

        def shade(some: Integers) -> Floats:
            normal = (ox[some] + path[some] * dx[some]) / radius
            depth = (oz[some] + path[some] * dz[some]) / radius
            lit = 0.3 + 0.9 * np.maximum(-0.8 * normal + 0.2 * depth, 0) ** 3
            return lit[:, None] * METAL + (0.2 * np.maximum(depth, 0))[:, None] * self.mean

        return path, shade

    def _screen(self, origin: Floats, direction: Floats) -> Meeting:
        hx, hy, z = self.room.screen
        path, x, y = self._rectangle(origin, direction, z)
        path[(abs(x) > FRAME * hx) | (abs(y) > FRAME * hy)] = np.inf

        def shade(some: Integers) -> Floats:
            u, v = x[some] / hx, y[some] / hy
            on = (abs(u) <= 1) & (abs(v) <= 1)
            colour = np.where(on[:, None], BLACK, 0.4 * METAL)
            colour[on] += interpolated(self.picture, u[on], v[on])
            return colour

        return path, shade


def interpolated(picture: Floats, u: Floats, v: Floats) -> Floats:
    """Return a picture between its pixels, linearly.  u, v : (n,) in [-1, 1], to the right and up."""
    rows, columns = picture.shape[:2]
    x = np.clip((u + 1) * columns / 2 - 0.5, 0, columns - 1)
    y = np.clip((1 - v) * rows / 2 - 0.5, 0, rows - 1)
    i, j = (
        np.minimum(y.astype(np.int64), max(rows - 2, 0)),
        np.minimum(x.astype(np.int64), max(columns - 2, 0)),
    )
    below, right = np.minimum(i + 1, rows - 1), np.minimum(j + 1, columns - 1)
    a, b = (x - j)[:, None], (y - i)[:, None]
    upper = (1 - a) * picture[i, j] + a * picture[i, right]
    lower = (1 - a) * picture[below, j] + a * picture[below, right]
    return (1 - b) * upper + b * lower
