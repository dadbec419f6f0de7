"""A photograph's room: where camera, lens, lamp, screen and table stand, and which rays make its pixels."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import sqrt

import numpy as np

from optics.reporting.view.scene_layout import (
    BENDS,
    FACTORS,
    LONG,
    SHORT,
    DrawnElement,
    DrawnSource,
    Scene,
    box_of,
    corners,
    drawn_elements,
    placed,
)
from optics.scene.problem import MirrorElement
from optics.scene.receivers import Plane, Receiver
from optics.scene.system import System
from thbcad.checks import Floats, Integers
from thbcad.poses import Pose

PIXELS = (960, 540)  # columns and rows
COARSE = 61  # samples across a face, for the box around it
ROUNDING = 1e-9  # of a factor
LINES = 2  # of rays in a row of pixels: one ray above on the left, one below on the right
WHOLE = LINES * PIXELS[1], PIXELS[0]  # lines and columns of the picture
BACK = 1.6  # of throw and half-width of the screen together: from the screen back to the camera
ABOVE = 0.12  # of the camera's distance from the lens: its height over the axis
CLEAR = 1.08  # of what lens and screen take: the space between them in the picture
SIDEWAYS = 1.6  # of the camera's distance from the screen: most that it stands beside the axis
LIT = 5.0  # times brighter is a room that mirrors show
AWAY = 4.0  # half-diagonals of all that is seen from beside: the camera's distance
MARGIN, BELOW = 0.06, 0.16  # of the picture: free on all sides, and for the table
LARGEST = 2.5  # half-widths of the lens: those of the screen; larger ones are drawn smaller and nearer
FAR = 5.0  # half-widths of the lens to a far field's screen, at most
WIDEST = 45.0  # degrees on it
BESIDE = 0.04  # of the lens's half-width: half the width that a point of light is given
TALLER = 1.06  # half-heights of the screen from its middle down to the table
STANDING = 1.3  # half-heights of the lens from its axis down to the table, at least
LIFTED = 0.1  # half-widths of the lens: the least height of all things over the table
POST = 0.06  # of an element's half-width: radius of the post it stands on
MIRRORED = "the picture reads right from the lens's side, and is mirrored here"


@dataclass(frozen=True, eq=False)
class _Stand:
    """Where the screen of a photograph stands, and the camera.  Lengths in mm, in the frame of the scene.

    screen : a receiver of lengths.  half_width : of it.
    eye : (3,), the camera.  turn : (3, 3), rows right, up and towards the camera.
    lit : how many times brighter the room is than before a screen alone.
    smaller : how many times screen and throw are drawn smaller.  stretch : the throw again, longer (above 1).
    """

    screen: Receiver
    half_width: tuple[float, float]
    eye: Floats
    turn: Floats
    lit: float
    smaller: float
    stretch: float


@dataclass(frozen=True, eq=False)
class PhotoRoom(_Stand):
    """All that stands in the room of a photograph.

    elements : by name, least and greatest corner of the box around each, (3, 2).
    posts : (x, y, z, radius) each, of the tops of posts.
    lamps : the sources, a point as wide as can be seen.  parallel : whether their light is.
    angular : the screen shows directions of a far field.  table : y of its top.
    window : left, right, bottom and top of the picture, in tangents.
    """

    elements: dict[str, Floats]
    posts: tuple[tuple[float, float, float, float], ...]
    lamps: tuple[DrawnSource, ...]
    parallel: bool
    angular: bool
    table: float
    window: tuple[float, float, float, float]

    def directions(self, lines: Integers, columns: Integers) -> Floats:
        """Return the unit directions of the rays of some lines, line by line, (3, n)."""
        left, right, bottom, top = self.window
        beside = np.where(lines % LINES, 0.75, 0.25)[:, None]
        x = left + (right - left) * (columns + beside) / PIXELS[0]
        y = top - (top - bottom) * (lines + 0.5) / (LINES * PIXELS[1])
        across, up, back = self.turn[:, :, None, None]
        rays = across * x - back
        rays += up * y[:, None]
        return (rays / np.sqrt((rays * rays).sum(axis=0))).reshape(3, -1)

    def showing(self, points: Floats) -> tuple[Integers, Integers]:
        """Return the lines and columns between which points (3, n) are seen; all where one is not before the
        camera."""
        across, up, back = self.turn @ (points - self.eye[:, None])
        if back.max() >= 0:
            return np.arange(WHOLE[0]), np.arange(WHOLE[1])
        left, right, bottom, top = self.window
        down, along = (top + up / back) / (top - bottom), (-across / back - left) / (right - left)
        return _between(down, WHOLE[0]), _between(along, WHOLE[1])


def _between(shares: Floats, count: int) -> Integers:
    """Return the numbers out of a count between which shares of it lie."""
    low, high = np.clip([shares.min(), shares.max()], 0, 1) * count
    return np.arange(max(int(low) - 1, 0), min(int(high) + 2, count))


def photo_room(system: System) -> PhotoRoom:
    """Return the room of the elements of a system.

    A lens on the axis is seen from behind a screen across it, all else from where `placed` sees the scene.
    """
    drawn = drawn_elements(system, COARSE, COARSE)
    scene = placed(system, drawn)
    stand = (_from_behind if system.axial else _from_beside)(system, scene)
    boxes, size = {element.name: box_of(element.box) for element in drawn}, _size(scene.lens)
    least = BESIDE * size / sqrt(len(scene.sources))
    screen = screen_points(stand.screen, stand.half_width)
    things = np.concatenate([*(corners(box) for box in boxes.values()), screen], axis=1)
    if system.axial:
        table = -max(TALLER * stand.half_width[1], STANDING * size, -scene.lens[1, 0] + LIFTED * size)
    else:
        things = np.concatenate([things, scene.source], axis=1)
        table = float(things[1].min()) - LIFTED * size
    return PhotoRoom(
        elements=boxes,
        posts=_posts(drawn, [*boxes.values(), box_of(screen)]),
        lamps=tuple(
            replace(source, half_width=(max(source.half_width[0], least), max(source.half_width[1], least)))
            for source in scene.sources
        ),
        parallel=system.source.from_afar,
        angular=system.target.far_field,
        table=table,
        window=_window(stand, things),
        **vars(stand),
    )


def screen_points(screen: Receiver, half_width: tuple[float, float]) -> Floats:
    """Return points of a screen, its corners among them, (3, n)."""
    bends = 2 if isinstance(screen, Plane) else BENDS
    grid = np.meshgrid(*(h * np.linspace(-1, 1, bends) for h in half_width))
    return np.stack(np.broadcast_arrays(*screen.points(*grid))).reshape(3, -1)


def _size(box: Floats) -> float:
    """Return half the width of what a box (3, 2) holds."""
    return float(np.ptp(box[:2], axis=1).max() / 2)


def _from_behind(system: System, scene: Scene) -> _Stand:
    size, top = _size(scene.lens), float(scene.lens[2, 1])
    hx, hy, throw, smaller = _screen(system, size, top)
    stretch = np.clip(throw, SHORT * (hx + size), LONG * (hx + size)) / throw
    throw *= stretch
    back = BACK * (throw + max(hx, hy))
    sideways = min(CLEAR * (size * back + hx * (back + throw)) / throw, SIDEWAYS * back)
    eye = np.array([-sideways, ABOVE * (back + throw), top + throw + back])
    screen = Plane(Pose.at((0.0, 0.0, top + throw)))
    seen = np.concatenate([corners(scene.lens), screen_points(screen, (hx, hy))], axis=1) - eye[:, None]
    angles = np.arctan2(-seen[0], -seen[2])
    middle = (angles.min() + angles.max()) / 2
    x, z = np.sin(middle), np.cos(middle)
    turn = np.array([[z, 0.0, -x], [0.0, 1.0, 0.0], [x, 0.0, z]])
    return _Stand(screen, (hx, hy), eye, turn, 1.0, smaller, float(stretch))


def _from_beside(system: System, scene: Scene) -> _Stand:
    half_width, (start, end) = system.target.settings.half_width, scene.gap
    smaller = squeeze = 1.0
    screen: Receiver
    if system.target.far_field:
        hx, hy, throw, _ = _screen(system, _size(scene.lens), start)
        middle = scene.bodies[-1].mean(axis=1)
        middle = middle + (start + throw - scene.along @ middle) * scene.along
        screen, half_width = Plane(Pose(system.target.receiver.pose.rotation, middle)), (hx, hy)
    else:
        screen = system.target.receiver
        if isinstance(screen, Plane):
            smaller = _smaller(half_width, max(_size(box_of(body)) for body in scene.bodies))
        if smaller > 1:  # seen from the last element it stays where it is
            pose, middle = screen.pose, scene.bodies[-1].mean(axis=1)
            screen = Plane(Pose(pose.rotation, middle + (pose.shift - middle) / smaller))
            half_width = half_width[0] / smaller, half_width[1] / smaller
        else:
            squeeze = scene.squeeze
            screen = screen.moved(Pose.at((1 - 1 / squeeze) * (start - end) * scene.along))
    seen = np.concatenate([*scene.bodies, scene.source, screen_points(screen, half_width)], axis=1)
    box = box_of(seen)
    eye = box.mean(axis=1) + AWAY / 2 * np.linalg.norm(np.ptp(box, axis=1)) * scene.turn[2]
    return _Stand(screen, half_width, eye, scene.turn, LIT, smaller, 1 / squeeze)


def _posts(
    drawn: Sequence[DrawnElement], boxes: Sequence[Floats]
) -> tuple[tuple[float, float, float, float], ...]:
    """Return where elements rest on posts: below their middles, where nothing else is in the way.

    boxes : of the elements, and of the screen.
    """
    posts = []
    for element, box in zip(drawn, boxes):
        (x, _, z), radius = box.mean(axis=1), POST * _size(box)
        points = np.concatenate([face.points.reshape(3, -1) for face in element.placed], axis=1)
        above = np.hypot(points[0] - x, points[2] - z) <= radius
        top = float(points[1, above].min(initial=np.inf)) if above.any() else float(box[1, 0])
        others = [other for other in boxes if other is not box]
        if not any(b[0, 0] <= x <= b[0, 1] and b[2, 0] <= z <= b[2, 1] and b[1, 0] < top for b in others):
            posts.append((float(x), top, float(z), radius))
    return tuple(posts)


def _screen(system: System, size: float, top: float) -> tuple[float, float, float, float]:
    """Return half-widths of the screen and its distance from the lens, mm, and how many times smaller than it
    is it is drawn.

    size : half-width of the lens.  top : z of its end.
    """
    problem, target = system.problem, system.problem.target
    if target.far_field:
        tangents = np.tan(np.radians(np.minimum(target.half_width, WIDEST)))
        throw = size * min(FAR, LARGEST / float(tangents.max()))
        return float(throw * tangents[0]), float(throw * tangents[1]), throw, 1.0
    hx, hy = target.half_width
    smaller = _smaller(target.half_width, size)
    return hx / smaller, hy / smaller, (problem.optic.thickness + problem.throw - top) / smaller, smaller


def _smaller(half_width: tuple[float, float], size: float) -> float:
    """Return how many times smaller a screen is drawn beside a lens of a half-width."""
    return float(FACTORS[FACTORS * LARGEST * size >= max(half_width)].min(initial=FACTORS[-1]))


def _window(stand: _Stand, points: Floats) -> tuple[float, float, float, float]:
    """Return the window of a camera's picture that holds points (3, n)."""
    right, up, back = stand.turn
    seen = points - stand.eye[:, None]
    x, y = (axis @ seen / -(back @ seen) for axis in (right, up))
    width, height = np.ptp(x) * (1 + 2 * MARGIN), np.ptp(y) * (1 + MARGIN + BELOW)
    low = y.min() - BELOW * np.ptp(y)
    scale = max(width / PIXELS[0], height / PIXELS[1])
    width, free = scale * PIXELS[0], scale * PIXELS[1] - height
    centre, low = (x.min() + x.max()) / 2, low - free / 2
    return centre - width / 2, centre + width / 2, low, low + scale * PIXELS[1]


def photo_caption(system: System) -> str:
    """Return what a photograph shows, and what of it is not as it is."""
    room = photo_room(system)
    light = "measured light on a translucent screen"
    mirrors = [isinstance(optic, MirrorElement) for optic in system.problem.optics]
    alone = "The mirror, which reflects the room, and its" if any(mirrors) else "The lens as glass and its"
    row = "Lenses that refract and mirrors that reflect the room, and their"
    what = row if len(mirrors) > 1 else alone
    shown = f"{what} {light}. The room is invented"
    if system.axial:
        shown = f"The lens as glass and its {light}, seen from behind the screen. The room is invented"
    if room.angular:
        screen = f"it shows the intensity in every direction, up to {WIDEST:g} degrees"
        return f"{shown}, and so is the screen: {screen}.{f' {MIRRORED}.' if system.target.mirrored else ''}"
    parts = [MIRRORED] if system.target.mirrored and system.axial else []
    if room.smaller > 1:
        parts.append(f"screen and distance are drawn {room.smaller:g} times smaller than they are")
    if abs(room.stretch - 1) > ROUNDING:
        factor, word = (room.stretch, "longer") if room.stretch > 1 else (1 / room.stretch, "shorter")
        parts.append(f"the distance to the screen is drawn {factor:.3g} times {word}")
    return f"{'; '.join([shown, *parts])}."
