"""A picture like a photograph: the lens as glass, and its light on a screen in a dark room.

Rays of a camera go through the exact lens, with all refractions and reflections at its faces.  What they
meet behind it is an invented room; the light on the screen is the measured one.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from optics.base.runtime import Backend
from optics.light.tracing import seen_branches
from optics.reporting.view.photo_light import WARM, PhotoLight, interpolated
from optics.reporting.view.photo_room import LINES, PIXELS, WIDEST, PhotoRoom, photo_room
from optics.reporting.view.scene_layout import block_means
from optics.scene.photometry import encoded_srgb
from optics.scene.problem import Problem
from optics.scene.sources import Rays
from optics.scene.system import OpticalSystem
from thbcad.checks import Floats, Integers
from thbcad.lens import Lens

STRIP = 90  # lines at once: their rays take some 30 MB
GLOSS = 0.04, 0.5  # what the table reflects of light from above, and at most
MOST_PIXELS = 512  # of the picture on the screen, across: more are not seen
BRIGHTEST = 0.998  # quantile of the light that is shown white
MIRRORED = np.array([[1.0], [-1.0], [1.0]])
COMPRESSION = 6  # of 9


@dataclass(frozen=True, eq=False)
class LensSight:
    """What a camera sees through the lens, n rays and m branches of them that leave it.

    pixel, count : (n,), the first of the parts of a pixel that a ray stands for, and how many they are.
    weight : (n,), of its light there.  before : (2, 3, n), origin and direction of the rays.
    flux : (m,), of the branches of a ray of 1.  behind : (2, 3, m), origin and direction of the branches.
    ray : (m,), from which they come.
    """

    pixel: Integers
    count: NDArray[np.int8]
    weight: NDArray[np.float32]
    before: NDArray[np.float32]
    flux: NDArray[np.float32]
    behind: NDArray[np.float32]
    ray: Integers


def lens_sight(problem: Problem, lens: Lens, backend: Backend) -> LensSight:
    """Return what the camera of a photograph sees through the lens, also in the table's reflection.

    backend : of double precision
    """
    light = PhotoLight(photo_room(problem, lens), np.zeros((1, 1, 3)))
    found = []
    for pixel, count, weight, ray in _camera_rays(light):
        meets = _towards_lens(light, *ray)
        found.append((pixel[meets], count[meets], weight[meets], ray[:, :, meets]))
    pixel, count, weight, before = (np.concatenate(column, axis=-1) for column in zip(*found))
    rays = Rays(before[0], before[1], np.ones(pixel.size))
    solid = OpticalSystem(problem).solid(lens)
    out = seen_branches(backend, solid, rays, absorbing_wall=problem.optic.wall == "absorbing")
    behind = np.stack([out.origin, out.direction])
    short = np.float32  # a third of a pixel's grey level is 1e-3
    return LensSight(
        pixel=pixel,
        count=count,
        weight=weight.astype(short),
        before=before.astype(short),
        flux=out.flux.astype(short),
        behind=behind.astype(short),
        ray=out.ray,
    )


def photograph(problem: Problem, lens: Lens, irradiance: Floats, sight: LensSight) -> bytes:
    """Return a PNG of the lens before its light on a screen, in central projection.

    `photo_caption` says what is not drawn as it is.

    irradiance : (rows, columns), row 0 at +y.  sight : as `lens_sight`.
    """
    room = photo_room(problem, lens)
    light = PhotoLight(room, _shown(irradiance, problem, room))
    picture = np.zeros((LINES * PIXELS[0] * PIXELS[1], 3))
    for pixel, count, weight, ray in _camera_rays(light):
        _add(picture, pixel, count, weight[:, None] * light.along(*ray))
    through = light.along(*sight.behind.astype(np.float64)) * sight.flux[:, None]
    seen = np.stack([np.bincount(sight.ray, c, sight.pixel.size) for c in through.T], axis=1)
    change = sight.weight[:, None] * (seen - light.along(*sight.before.astype(np.float64)))
    reflected = sight.count == LINES
    for some in (~reflected, reflected):  # a part of a pixel can have one ray of each
        _add(picture, sight.pixel[some], sight.count[some], change[some])
    fine = np.clip(picture, 0.0, 1.0).reshape(PIXELS[1], LINES, PIXELS[0], 3)
    grey = np.rint(255 * encoded_srgb(fine.mean(axis=1))).astype(np.uint8)
    buffer = io.BytesIO()
    Image.fromarray(grey).save(buffer, "png", compress_level=COMPRESSION)
    return buffer.getvalue()


def _camera_rays(light: PhotoLight) -> Iterator[tuple[NDArray[Any], ...]]:
    """Yield (pixel, count, weight, ray) of the camera's rays, and of their reflections in the table.

    The first three are those of `LensSight`; ray : (2, 3, n), origin and direction.  Of the two parts
    of a pixel one has a reflection, which is dim.
    """
    room, columns = light.room, PIXELS[0]
    for start in range(0, LINES * PIXELS[1], STRIP):
        direction = room.directions(np.arange(start, start + STRIP))
        pixel = start * columns + np.arange(direction.shape[1])
        ray = np.stack([np.broadcast_to(room.eye[:, None], direction.shape), direction])
        yield pixel, np.ones_like(pixel), np.ones(pixel.size), ray
        first = np.flatnonzero((pixel // columns % LINES == 0) & (direction[1] < 0))
        eye, down = ray[:, :, first]
        path = light.table_path(eye, down)
        on = np.flatnonzero(np.isfinite(path))
        weight = GLOSS[1] * (GLOSS[0] + (1 - GLOSS[0]) * (1 + down[1, on]) ** 5)
        ray = np.stack([eye[:, on] + path[on] * down[:, on], down[:, on] * MIRRORED])
        yield first[on] + pixel[0], np.full(on.size, LINES), weight, ray


def _add(picture: Floats, pixel: Integers, count: Integers, colour: Floats) -> None:
    """Add colours (n, 3) to the parts of pixels that they stand for: one, or one and the one below."""
    picture[pixel] += colour
    both = count == LINES
    picture[pixel[both] + PIXELS[0]] += colour[both]


def _towards_lens(light: PhotoLight, origin: Floats, direction: Floats) -> Integers:
    """Return the numbers of the rays that meet the box around the lens before the screen."""
    low, high = light.room.lens.T[:, :, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        paths = np.stack([(low - origin) / direction, (high - origin) / direction])
    begin, end = np.nanmax(paths.min(axis=0), axis=0), np.nanmin(paths.max(axis=0), axis=0)
    return np.flatnonzero((begin < end) & (end > 0) & (begin < light.screen_path(origin, direction)))


def _shown(irradiance: Floats, problem: Problem, room: PhotoRoom) -> Floats:
    """Return the light on the screen as linear colours up to 1, (rows, columns, 3)."""
    shown = block_means(irradiance, -(-max(irradiance.shape) // MOST_PIXELS))
    if room.angular:
        (hx, hy) = problem.target.half_width
        rows, columns = shown.shape
        tangents = [np.tan(np.radians(min(h, WIDEST))) for h in (hx, hy)]
        u = np.degrees(np.arctan(np.linspace(-1, 1, columns) * tangents[0])) / hx
        v = np.degrees(np.arctan(np.linspace(1, -1, rows) * tangents[1])) / hy
        shown = interpolated(shown[..., None], *(a.ravel() for a in np.meshgrid(u, v))).reshape(rows, columns)
    top = float(np.quantile(shown, BRIGHTEST)) or float(shown.max()) or 1.0
    return np.maximum(shown / top, 0.0)[..., None] * WARM
