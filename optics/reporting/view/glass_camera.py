"""A picture like a photograph: lenses as glass, mirrors, and their light on a screen in a dark room.

Rays of a camera go through the exact elements, with all refractions and reflections at their faces.  What
they meet behind these is an invented room; the light on the screen is the measured one.
"""

import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from optics.base.runtime import Backend
from optics.light.tracing import Branches, ShadingBody, seen_branches
from optics.reporting.view.photo_light import WARM, PhotoLight, interpolated
from optics.reporting.view.photo_room import LINES, PIXELS, WHOLE, WIDEST, PhotoRoom, photo_room
from optics.reporting.view.scene_layout import block_means, corners
from optics.scene.paths import Body
from optics.scene.photometry import encoded_srgb
from optics.scene.problem import MirrorElement, Optic
from optics.scene.sources import Rays
from optics.scene.system import MadePart, System, scene_parts
from thbcad.checks import Floats, Integers
from thbcad.moulds import Made, Plate, lens_of
from thbcad.poses import Pose

STRIP = 90  # lines at once: their rays take some 30 MB
GLOSS = 0.04, 0.5  # what the table reflects of light from above, and at most
MOST_PIXELS = 512  # of the picture on the screen, across: more are not seen
BRIGHTEST = 0.998  # quantile of the light that is shown white
MIRRORED = np.array([[1.0], [-1.0], [1.0]])
COMPRESSION = 6  # of 9
MEETINGS = 4  # elements in a row that a ray of the camera meets: what comes then is as good as black
DARK = 3.0  # index of the blank of a mirror, of which a quarter of the light comes back


@dataclass(frozen=True, eq=False)
class Sight:
    """What a camera sees in the elements, n rays and m branches of them that leave these.

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


@dataclass(frozen=True, eq=False)
class _Seen:
    """An element as a camera sees it.

    backend : of double precision.  solid, pose : and where it lies.  box : around it, (3, 2).
    how : of `seen_branches`.
    """

    backend: Backend
    solid: Made
    pose: Pose
    box: Floats
    how: dict[str, Any]

    @cached_property
    def body(self) -> ShadingBody:
        """It on the device, made once."""
        assert not isinstance(self.solid, Plate)  # it is the one element
        return ShadingBody(self.backend, Body(self.solid, self.pose))

    def branches(self, rays: Rays) -> Branches:
        """Return what `seen_branches` does of rays in the frame of the scene, in that frame."""
        out = seen_branches(self.backend, self.solid, rays.posed(self.pose.inverse()), **self.how)
        return replace(
            out, origin=self.pose.points(out.origin), direction=self.pose.directions(out.direction)
        )


def elements_sight(system: System, backend: Backend) -> Sight:
    """Return what the camera of a photograph sees in the elements, also in the table's reflection.

    backend : of double precision
    """
    light = PhotoLight(photo_room(system), np.zeros((1, 1, 3)))
    parts = zip(scene_parts(system), system.problem.optics)
    elements = [
        _seen(backend, part, optic, light.room.elements[part.name])
        for part, optic in parts
        if part.name in light.room.elements
    ]
    boxes = [corners(box) for box in light.room.elements.values()]
    mirrored = [np.array([[0], [2 * light.room.table], [0]]) + MIRRORED * box for box in boxes]
    found = []
    for pixel, count, weight, ray in _camera_rays(light, np.concatenate(boxes + mirrored, axis=1)):
        meets = np.any([_towards(light, box, *ray) for box in light.room.elements.values()], axis=0)
        found.append((pixel[meets], count[meets], weight[meets], ray[:, :, meets]))
    pixel, count, weight, before = (np.concatenate(column, axis=-1) for column in zip(*found))
    out = _followed(light, elements, Rays(before[0], before[1], np.ones(pixel.size)))
    behind = np.stack([out.origin, out.direction])
    short = np.float32  # a third of a pixel's grey level is 1e-3
    return Sight(
        pixel=pixel,
        count=count,
        weight=weight.astype(short),
        before=before.astype(short),
        flux=out.flux.astype(short),
        behind=behind.astype(short),
        ray=out.ray,
    )


def _seen(backend: Backend, part: MadePart, optic: Optic, box: Floats) -> _Seen:
    """Return an element as it is seen.  A mirror's blank is dark and polished beside its face."""
    if not isinstance(optic, MirrorElement):
        how = {"black_wall": optic.wall == "absorbing", "coats": optic.coats}
        return _Seen(backend, part.made, part.pose, box, how)
    blank = replace(lens_of(part.made), index=DARK)
    return _Seen(backend, blank, part.pose, box, {"bounces": 0, "coats": (1 - optic.share, None)})


def _followed(light: PhotoLight, elements: Sequence[_Seen], rays: Rays) -> Branches:
    """Return the branches of rays that leave the elements for the room, of up to MEETINGS elements in a row.

    No element shows itself from outside.
    """
    branches, last, gone = Branches.start(rays), np.full(rays.flux.size, -1), []
    for _ in range(MEETINGS):
        first = _first(light, elements, branches, last)
        gone.append(branches[first < 0])
        leaving, last = [], first[:0]
        for k in np.unique(first[first >= 0]):
            mine = branches[first == k]
            out = elements[k].branches(Rays(mine.origin, mine.direction, mine.flux))
            leaving.append(replace(out, ray=mine.ray[out.ray]))
            last = np.append(last, np.full(out.ray.size, k))
        if not last.size:
            break
        branches = sum(leaving[1:], start=leaving[0])
    return sum(gone[1:], start=gone[0])


def _first(light: PhotoLight, elements: Sequence[_Seen], branches: Branches, last: Integers) -> Integers:
    """Return the numbers of the elements that branches meet before all others and the room, (m,); -1 is none.

    last : of those that they have left.
    """
    nearest, first = np.full(last.size, np.inf), np.full(last.size, -1)
    for k, element in enumerate(elements):
        origin, direction = branches.origin, branches.direction
        may = np.flatnonzero((last != k) & _towards(light, element.box, origin, direction))
        length = np.zeros(may.size)
        if len(elements) > 1 and may.size:
            length = element.body.lengths(element.pose, origin[:, may], direction[:, may])[1]
        some = length < nearest[may]
        nearest[may[some]], first[may[some]] = length[some], k
    return first


def photograph(system: System, irradiance: Floats, sight: Sight) -> bytes:
    """Return a PNG of the elements before their light on a screen, in central projection.

    `photo_caption` says what is not drawn as it is.

    irradiance : (rows, columns), row 0 at +y.  sight : as `elements_sight`.
    """
    room = photo_room(system)
    light = PhotoLight(room, _shown(irradiance, system.target.settings.half_width, room))
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


def _camera_rays(light: PhotoLight, points: Floats | None = None) -> Iterator[tuple[NDArray[Any], ...]]:
    """Yield (pixel, count, weight, ray) of the camera's rays, and of their reflections in the table.

    The first three are those of `Sight`; ray : (2, 3, n), origin and direction.  Of the two parts
    of a pixel one has a reflection, which is dim.
    points : (3, n), between which all that is looked for is seen; None is the whole picture.
    """
    room = light.room
    lines, columns = map(np.arange, WHOLE) if points is None else room.showing(points)
    for start in range(0, len(lines), STRIP):
        strip = lines[start : start + STRIP]
        direction = room.directions(strip, columns)
        pixel = np.add.outer(strip * PIXELS[0], columns).ravel()
        ray = np.stack([np.broadcast_to(room.eye[:, None], direction.shape), direction])
        yield pixel, np.ones_like(pixel), np.ones(pixel.size), ray
        first = np.flatnonzero((pixel // PIXELS[0] % LINES == 0) & (direction[1] < 0))
        eye, down = ray[:, :, first]
        path = light.table_path(eye, down)
        on = np.flatnonzero(np.isfinite(path))
        weight = GLOSS[1] * (GLOSS[0] + (1 - GLOSS[0]) * (1 + down[1, on]) ** 5)
        ray = np.stack([eye[:, on] + path[on] * down[:, on], down[:, on] * MIRRORED])
        yield pixel[first[on]], np.full(on.size, LINES), weight, ray


def _add(picture: Floats, pixel: Integers, count: Integers, colour: Floats) -> None:
    """Add colours (n, 3) to the parts of pixels that they stand for: one, or one and the one below."""
    picture[pixel] += colour
    both = count == LINES
    picture[pixel[both] + PIXELS[0]] += colour[both]


def _towards(light: PhotoLight, box: Floats, origin: Floats, direction: Floats) -> NDArray[np.bool_]:
    """Return the mask of rays that meet a box around an element before the screen."""
    low, high = box.T[:, :, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        paths = np.stack([(low - origin) / direction, (high - origin) / direction])
    begin, end = np.nanmax(paths.min(axis=0), axis=0), np.nanmin(paths.max(axis=0), axis=0)
    meets = (begin < end) & (end > 0)
    meets[meets] = begin[meets] < light.screen_path(origin[:, meets], direction[:, meets])
    return meets


def _shown(irradiance: Floats, half_width: tuple[float, float], room: PhotoRoom) -> Floats:
    """Return the light on the screen as linear colours up to 1, (rows, columns, 3)."""
    shown = block_means(irradiance, -(-max(irradiance.shape) // MOST_PIXELS))
    if room.angular:
        (hx, hy), (rows, columns) = half_width, shown.shape
        tangents = [np.tan(np.radians(min(h, WIDEST))) for h in (hx, hy)]
        u = np.degrees(np.arctan(np.linspace(-1, 1, columns) * tangents[0])) / hx
        v = np.degrees(np.arctan(np.linspace(1, -1, rows) * tangents[1])) / hy
        shown = interpolated(shown[..., None], *(a.ravel() for a in np.meshgrid(u, v))).reshape(rows, columns)
    top = float(np.quantile(shown, BRIGHTEST)) or float(shown.max()) or 1.0
    return np.maximum(shown / top, 0.0)[..., None] * WARM
