"""The light that rays of a camera meet in a photograph's room, without its elements.

Radiances are relative to the brightest light on the screen.  The room is invented, the light on the screen is
measured.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from optics.reporting.view.photo_room import PhotoRoom, screen_points
from optics.reporting.view.scene_layout import DrawnSource, box_of
from thbcad.checks import Floats, Integers

# the path to a thing, inf where it is not met, (n,), and the radiance of some of the rays that meet it
Meeting = tuple[Floats, Callable[[Integers], Floats]]

WARM, COOL = np.array([1.0, 0.96, 0.9]), np.array([0.78, 0.88, 1.0])
FRAME = 1.025  # of the screen's half-width
BLACK = 0.012 * COOL  # of the unlit screen
WOOD = np.array([0.026, 0.023, 0.021])  # of the table in the light of the room
METAL = np.array([0.05, 0.05, 0.055])
FAINT = 0.05  # glow of a lamp of parallel light, seen from aside
LOBE = 0.02  # 1 - cosine: how far beside its direction a lamp of parallel light glows
SCREEN_GLOW = 0.25  # of the screen's mean light, on the table before it
LEAST = 1e-9  # of the room's size: a path as short has not begun


@dataclass(frozen=True, eq=False)
class PhotoLight:
    """A room and the light on its screen, (rows, columns, 3), linear sRGB, row 0 at +y."""

    room: PhotoRoom
    picture: Floats

    @cached_property
    def size(self) -> float:
        """Half the width of the first element, mm."""
        first = next(iter(self.room.elements.values()))
        return float(np.ptp(first[:2], axis=1).max() / 2)

    @cached_property
    def _box(self) -> tuple[Floats, Floats]:
        """The middle of the screen, and how far it goes to all sides, (3,), mm."""
        box = box_of(screen_points(self.room.screen, self.room.half_width))
        return box.mean(axis=1), np.ptp(box, axis=1) / 2

    @cached_property
    def mean(self) -> Floats:
        return self.picture.mean(axis=(0, 1))

    def along(self, origin: Floats, direction: Floats) -> Floats:
        """Return the radiance that rays (3, n) meet, (n, 3)."""
        things = [self._table(origin, direction), *self._upright(origin, direction)]
        nearest, first = np.full(origin.shape[1], np.inf), np.full(origin.shape[1], -1)
        for k, (path, _) in enumerate(things):
            first[path < nearest] = k
            np.minimum(path, nearest, out=nearest)
        colour = np.empty((origin.shape[1], 3))
        colour[first < 0] = self._dark_room(direction[:, first < 0])
        for k, (_, shade) in enumerate(things):
            met = np.flatnonzero(first == k)
            colour[met] = shade(met)
        return colour

    def _dark_room(self, direction: Floats) -> Floats:
        """Return the radiance of a dark room with a soft lamp above on the left, (n, 3)."""
        up = np.clip(direction[1], -1, 1)
        soft = np.exp(-((direction[0] + 0.55) ** 2 + (up - 0.62) ** 2) / 0.05)
        grey = 0.002 + 0.05 * self.room.lit * np.maximum(up, 0) + 0.9 * soft
        return np.asarray(grey[:, None] * COOL)

    def table_path(self, origin: Floats, direction: Floats) -> Floats:
        """Return the path to the table where it is met first, inf elsewhere, (n,)."""
        path = self._table(origin, direction)[0]
        for other, _ in self._upright(origin, direction):
            path[other < path] = np.inf
        return path

    def screen_path(self, origin: Floats, direction: Floats) -> Floats:
        """Return the path to the screen with its frame, inf where it is not met, (n,)."""
        return self._screen(origin, direction)[0]

    def _upright(self, origin: Floats, direction: Floats) -> list[Meeting]:
        """Return what is met of all that stands on the table."""
        posts = [self._post(post, origin, direction) for post in self.room.posts]
        lamps = [self._lamp(lamp, origin, direction) for lamp in self.room.lamps]
        return [*lamps, *posts, self._screen(origin, direction)]

    def _table(self, origin: Floats, direction: Floats) -> Meeting:
        with np.errstate(divide="ignore"):
            path = np.where(direction[1] < 0, (self.room.table - origin[1]) / direction[1], np.inf)
        path[path <= 0] = np.inf
        middle, (hx, hy, hz) = self._box
        cx, _, cz = middle

        def shade(some: Integers) -> Floats:
            x, _, depth = origin[:, some] + path[some] * direction[:, some]
            wide = 2.5 * (hx + np.linalg.norm(middle))
            room = 1 / (1 + ((x - cx / 2) ** 2 + (depth - cz / 2) ** 2) / wide**2) ** 2
            beside = np.maximum(abs(x - cx) - hx, 0) ** 2 + np.maximum(abs(depth - cz) - hz, 0) ** 2
            glow = SCREEN_GLOW / (1 + beside / max(hy, hz) ** 2) ** 1.5
            return WOOD * (self.room.lit * room[:, None] + 14 * glow[:, None] * self.mean)

        return path, shade

    def _lamp(self, lamp: DrawnSource, origin: Floats, direction: Floats) -> Meeting:
        to_lamp, (hx, hy) = lamp.pose.inverse(), lamp.half_width
        origin, direction = np.asarray(to_lamp.points(origin)), np.asarray(to_lamp.directions(direction))
        with np.errstate(divide="ignore", invalid="ignore"):
            path = -origin[2] / direction[2]
        path[~(path > LEAST * self.size)] = np.inf
        reached = np.where(np.isfinite(path), path, 0.0)
        x, y = (origin[:2] + reached * direction[:2]) / np.array([[hx], [hy]])
        outside = x * x + y * y > 1 if lamp.round else np.maximum(abs(x), abs(y)) > 1
        path[outside] = np.inf

        def shade(some: Integers) -> Floats:
            behind = direction[2, some, None] > 0
            if not self.room.parallel:
                return np.where(behind, METAL, 1.5 * WARM)
            glow = FAINT + 1.2 * np.exp(-(1 + direction[2, some]) / LOBE)
            return np.where(behind, METAL, glow[:, None] * WARM)

        return path, shade

    def _post(self, post: tuple[float, ...], origin: Floats, direction: Floats) -> Meeting:
        """A post below an element: an upright cylinder."""
        middle, top, depth, radius = post
        ox, oz = origin[0] - middle, origin[2] - depth
        dx, dz = direction[0], direction[2]
        a, b = np.maximum(dx * dx + dz * dz, 1e-30), ox * dx + oz * dz
        root = b * b - a * (ox * ox + oz * oz - radius**2)
        path = np.where(root > 0, (-b - np.sqrt(np.maximum(root, 0))) / a, np.inf)
        reached = np.where(np.isfinite(path), path, 0.0)
        y = origin[1] + reached * direction[1]
        path[(path <= 0) | (y > top) | (y < self.room.table)] = np.inf

        def shade(some: Integers) -> Floats:
            normal = (ox[some] + path[some] * dx[some]) / radius
            depth = (oz[some] + path[some] * dz[some]) / radius
            lit = 0.3 + 0.9 * np.maximum(-0.8 * normal + 0.2 * depth, 0) ** 3
            return lit[:, None] * METAL + (0.2 * np.maximum(depth, 0))[:, None] * self.mean

        return path, shade

    def _screen(self, origin: Floats, direction: Floats) -> Meeting:
        path, x, y = np.full(origin.shape[1], np.inf), *np.zeros((2, origin.shape[1]))
        for sign in (1.0, -1.0):  # from before it, and from behind
            landed = self.room.screen.land(origin, sign * direction)
            seen = landed.met & (sign * landed.length > LEAST * self.size)
            path[seen], x[seen], y[seen] = (a[seen] for a in (sign * landed.length, landed.u, landed.v))
        x, y = x / self.room.half_width[0], y / self.room.half_width[1]
        path[(abs(x) > FRAME) | (abs(y) > FRAME)] = np.inf

        def shade(some: Integers) -> Floats:
            u, v = x[some], y[some]
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
