"""A photograph's room: where camera, lens, lamp, screen and table stand, and which rays make its pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from optics.reporting.view.scene_layout import FACTORS, LONG, SHORT, corners, drawn_elements, placed
from optics.scene.problem import Problem
from optics.scene.system import OpticalSystem, source_of
from thbcad.checks import Floats, Integers
from thbcad.lens import Lens

PIXELS = (960, 540)  # columns and rows
COARSE = 61  # samples across a face, for the box around it
ROUNDING = 1e-9  # of a factor
LINES = 2  # of rays in a row of pixels: one ray above on the left, one below on the right
BACK = 1.6  # of throw and half-width of the screen together: from the screen back to the camera
ABOVE = 0.12  # of the camera's distance from the lens: its height over the axis
CLEAR = 1.08  # of what lens and screen take: the space between them in the picture
SIDEWAYS = 1.6  # of the camera's distance from the screen: most that it stands beside the axis
MARGIN, BELOW = 0.06, 0.16  # of the picture: free on all sides, and for the table
LARGEST = 2.5  # half-widths of the lens: those of the screen; larger ones are drawn smaller and nearer
FAR, WIDEST = (
    5.0,
    45.0,
)  # half-widths of the lens to a far field's screen, at most; degrees on it
BESIDE = 0.04  # of the lens's half-width: half the width that a point of light is given
CORNERS = 5  # points of the outline of a rectangle, the first twice; a circle has more
TALLER = 1.06  # half-heights of the screen from its middle down to the table
STANDING = 1.3  # half-heights of the lens from its axis down to the table, at least


@dataclass(frozen=True, eq=False)
class PhotoRoom:
    """Lengths in mm, in the frame of the lens.

    lens : (3, 2), least and greatest corner of the box around it.  lamp : (hx, hy, z), half-widths and place.
    round_lamp : whether it is an ellipse.  parallel : whether its light is.
    screen : (hx, hy, z).  angular : whether it shows directions of a far field.
    table : y of its top.  eye, forward : (3,), the camera, which looks horizontally.
    window : left, right, bottom and top of the picture, in tangents.
    smaller : how many times screen and throw are drawn smaller.  stretch : the throw again, longer (above 1).
    """

    lens: Floats
    lamp: tuple[float, float, float]
    round_lamp: bool
    parallel: bool
    screen: tuple[float, float, float]
    angular: bool
    table: float
    eye: Floats
    forward: Floats
    window: tuple[float, float, float, float]
    smaller: float
    stretch: float

    def directions(self, lines: Integers) -> Floats:
        """Return the unit directions of the rays of some lines, line by line, (3, n)."""
        left, right, bottom, top = self.window
        beside = np.where(lines % LINES, 0.75, 0.25)[:, None]
        x = left + (right - left) * (np.arange(PIXELS[0]) + beside) / PIXELS[0]
        y = top - (top - bottom) * (lines + 0.5) / (LINES * PIXELS[1])
        across = np.array([-self.forward[2], 0.0, self.forward[0]])
        rays = self.forward[:, None, None] + across[:, None, None] * x
        rays[1] += y[:, None]
        return (rays / np.sqrt((rays * rays).sum(axis=0))).reshape(3, -1)


def photo_room(problem: Problem, lens: Lens) -> PhotoRoom:
    """Return the room of a problem's lens on the axis, before a plane across it or the far field."""
    system = OpticalSystem(problem)
    scene = placed(system, lens, drawn_elements(system, lens, COARSE))
    size, top = float(np.ptp(scene.lens[:2], axis=1).max() / 2), float(scene.lens[2, 1])
    hx, hy, throw, smaller = _screen(problem, size, top)
    stretch = np.clip(throw, SHORT * (hx + size), LONG * (hx + size)) / throw
    throw *= stretch
    back = BACK * (throw + max(hx, hy))
    sideways = min(CLEAR * (size * back + hx * (back + throw)) / throw, SIDEWAYS * back)
    eye = np.array([-sideways, ABOVE * (back + throw), top + throw + back])
    lamp = np.maximum(np.abs(scene.source[:2]).max(axis=1), BESIDE * size)
    screen = np.array([[-hx, hx, hx, -hx], [-hy, -hy, hy, hy], [top + throw] * 4])
    forward, window = _aim(eye, np.concatenate([corners(scene.lens), screen], axis=1))
    return PhotoRoom(
        lens=scene.lens,
        lamp=(float(lamp[0]), float(lamp[1]), float(scene.source[2, 0])),
        round_lamp=scene.source.shape[1] > CORNERS,
        parallel=source_of(problem).from_afar,
        screen=(hx, hy, top + throw),
        angular=problem.target.far_field,
        table=-max(TALLER * hy, STANDING * size, -scene.lens[1, 0] + 0.1 * size),
        eye=eye,
        forward=forward,
        window=window,
        smaller=smaller,
        stretch=float(stretch),
    )


def _screen(problem: Problem, size: float, top: float) -> tuple[float, float, float, float]:
    """Return half-widths of the screen and its distance from the lens, mm, and how many times smaller than it
    is it is drawn.

    size : half-width of the lens.  top : z of its end.
    """
    target = problem.target
    if target.far_field:
        tangents = np.tan(np.radians(np.minimum(target.half_width, WIDEST)))
        throw = size * min(FAR, LARGEST / float(tangents.max()))
        return float(throw * tangents[0]), float(throw * tangents[1]), throw, 1.0
    hx, hy = target.half_width
    smaller = float(FACTORS[FACTORS * LARGEST * size >= max(hx, hy)].min(initial=FACTORS[-1]))
    return hx / smaller, hy / smaller, (problem.optic.thickness + problem.throw - top) / smaller, smaller


def _aim(eye: Floats, points: Floats) -> tuple[Floats, tuple[float, float, float, float]]:
    """Return the horizontal direction of a camera and the window of its picture that holds points (3, n)."""
    seen = points - eye[:, None]
    angles = np.arctan2(-seen[0], -seen[2])
    middle = (angles.min() + angles.max()) / 2
    forward = -np.array([np.sin(middle), 0.0, np.cos(middle)])
    across = np.array([-forward[2], 0.0, forward[0]])
    x, y = across @ seen / (forward @ seen), seen[1] / (forward @ seen)
    width, height = np.ptp(x) * (1 + 2 * MARGIN), np.ptp(y) * (1 + MARGIN + BELOW)
    low = y.min() - BELOW * np.ptp(y)
    scale = max(width / PIXELS[0], height / PIXELS[1])
    width, free = scale * PIXELS[0], scale * PIXELS[1] - height
    centre, low = (x.min() + x.max()) / 2, low - free / 2
    return forward, (centre - width / 2, centre + width / 2, low, low + scale * PIXELS[1])


def photo_caption(problem: Problem, lens: Lens) -> str:
    """Return what a photograph shows, and what of it is not as it is."""
    room = photo_room(problem, lens)
    shown = (
        "The lens as glass and its measured light on a translucent screen, seen from behind the screen. "
        "The room is invented"
    )
    if room.angular:
        screen = f"it shows the intensity in every direction, up to {WIDEST:g} degrees"
        return f"{shown}, and so is the screen: {screen}."
    parts = []
    if room.smaller > 1:
        parts.append(f"screen and distance are drawn {room.smaller:g} times smaller than they are")
    if abs(room.stretch - 1) > ROUNDING:
        factor, word = (room.stretch, "longer") if room.stretch > 1 else (1 / room.stretch, "shorter")
        parts.append(f"the distance to the screen is drawn {factor:.3g} times {word}")
    return f"{'; '.join([shown, *parts])}."
