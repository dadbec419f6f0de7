"""The faces of the lens as points, and shaded images of it as a solid.

The faces are sampled as points with normals, turned, and put into a depth buffer: the nearest
point gives a pixel its colour.  The light grazes, and fine slopes are drawn steeper than they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from math import isqrt

import numpy as np
from scipy.ndimage import distance_transform_edt, grey_closing

from thbcad.checks import Floats, Integers
from thbcad.lens import SIDES, FreeformSurface, Lens
from thbcad.moulds import FACES, Made, MouldedBody, Plate, lens_of
from thbcad.outlines import Outline
from thbcad.poses import Pose

SAMPLES = 420  # across a face
PIXELS = 440  # across a view, in which a face takes 350 at most
STEEP = 0.5  # median slope up to which relief is drawn steeper
FACTORS = np.outer(10.0 ** np.arange(4), [1, 2, 5]).ravel()
LIGHT = np.array([-0.63, 0.60, 0.49])  # direction to the light: right, up, towards the viewer
GLASS, GROUND = (0.86, 0.93, 1.0), (0.78, 0.84, 0.9)  # of optical faces and of edges
AMBIENT = 0.25
DIRECTIONS, HALVINGS = 721, 20  # of the feet of walls, linear between them: within a hundredth of a pixel


@dataclass(frozen=True, eq=False)
class Face:
    """A face as a grid of points, mm, with the outward normals that it is shaded by, both (3, n, m)."""

    name: str
    points: Floats
    normals: Floats
    colour: tuple[float, float, float]

    def posed(self, pose: Pose) -> Face:
        """Return the face of a body that lies elsewhere."""
        return replace(self, points=pose.points(self.points), normals=pose.directions(self.normals))


@dataclass(frozen=True, eq=False)
class View:
    """A direction to look along.

    turn : (3, 3), rows right, up and towards the viewer
    centre : (2,), right and up in the middle of the view, mm
    half_size : half the width and height of the view, mm
    """

    turn: Floats
    centre: Floats
    half_size: float

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Left, right, bottom and top of the view, mm."""
        (x, y), r = self.centre, self.half_size
        return (x - r, x + r, y - r, y + r)

    def pixels(self, seen: Floats) -> Integers:
        """Return the number of the pixel of every turned point (3, n), (n,)."""
        scale = PIXELS / (2 * self.half_size)
        column, row = ((seen[:2] + (self.half_size - self.centre)[:, None]) * scale).astype(np.int64)
        return row * PIXELS + column


def oblique(turn: float, rise: float) -> Floats:
    """Return the rotation of a view on the rear from `turn` degrees to the right and `rise` above, (3, 3)."""
    a, b = np.deg2rad([turn, rise])
    right = np.array([np.cos(a), 0.0, -np.sin(a)])
    toward = np.array([np.cos(b) * np.sin(a), np.sin(b), np.cos(b) * np.cos(a)])
    return np.stack([right, np.cross(toward, right), toward])


def solid_faces(solid: Made, samples: int = SAMPLES) -> tuple[list[Face], dict[str, float]]:
    """Return the faces, front and rear first, and by name how many times steeper their relief is.

    The edge of a lens that is no rectangle is one face; so is each wall of a body, whose edges are sharp.

    samples : across a face
    """
    if isinstance(solid, Plate):
        return _plate_faces(solid, samples)
    faces, steeper, lens = [], {}, lens_of(solid)
    for number, (name, surface, vertex) in enumerate(lens.faces):
        side = (-1, 1)[number]  # of the outward normal along z
        x, y = _positions(surface, samples)
        u, v = np.meshgrid(x, y, indexing="ij")
        evaluate = partial(surface.grid, x, y)
        if not surface.outline.is_rectangle:
            u, v = surface.outline.filled(u, v)
        if not isinstance(solid, Lens):
            u, v = within_foot(solid, number, u, v)
        if not (surface.outline.is_rectangle and solid is lens):
            evaluate = partial(surface, u, v)
        slopes = [evaluate(order) for order in ((1, 0), (0, 1))]
        smooth = [_linear(slope, x, y) for slope in slopes]
        usual = np.median(np.hypot(*(slope - flat for slope, flat in zip(slopes, smooth))))
        relief = surface.sag is not None and surface.sag.coefficients.any()
        steeper[name] = float(FACTORS[FACTORS * usual < STEEP].max(initial=1.0)) if relief else 1.0
        drawn = [flat + steeper[name] * (slope - flat) for slope, flat in zip(slopes, smooth)]
        points = np.stack([u, v, vertex + evaluate()])
        faces.append(
            Face(name, points, _unit(-side * drawn[0], -side * drawn[1], np.full_like(drawn[0], side)), GLASS)
        )
    rims = [_rims(face) for face in faces]
    larger = rims[int(lens.rear.half_width > lens.front.half_width)]
    levels = [] if isinstance(solid, Lens) else solid.level_edges
    rings = [rims[0], *(_level(larger, *edge) for edge in levels), rims[1]]
    size = np.ptp(np.concatenate([face.points for face in faces], axis=1), axis=(1, 2))
    count = 2 + int(samples * size[2] / size.max())
    for low, high in pairwise(rings):
        edges = _edges(low, high, count)
        faces += edges if lens.front.outline.is_rectangle else [_joined(edges)]
    return faces, steeper


def _plate_faces(plate: Plate, samples: int) -> tuple[list[Face], dict[str, float]]:
    """Return the faces of all lenses of a plate, front and rear of the first with their names, and the land's
    six, without what lies within the lenses."""
    own, steeper = solid_faces(plate.lens, samples // isqrt(len(plate.places)))
    faces = [
        replace(face, name=face.name * (not number and face.name in FACES)).posed(Pose.at((x, y, 0.0)))
        for number, (x, y) in enumerate(plate.places)
        for face in own
    ]
    flat = FreeformSurface(plate.outline.half_width)
    land, _ = solid_faces(Lens(flat, flat, plate.high - plate.low, plate.index), samples)
    beside = Pose.at((*plate.middle, plate.low))
    ground = [
        replace(face, name="land" * (face.name == "rear"), colour=GROUND).posed(beside) for face in land
    ]
    # walls rise from the smaller rim, and hide what of the land they cut
    smaller = min(plate.lens.front.half_width, plate.lens.rear.half_width)
    for k in (0, 1):
        ground[k] = replace(ground[k], points=_beside(ground[k].points, plate.places, smaller))
    return faces + ground, steeper


def _beside(points: Floats, places: Floats, half_width: tuple[float, float]) -> Floats:
    """Return points of a plane (3, ...) with those within rectangles around places moved to the borders."""
    moved = points.copy()
    for place in places:
        away = [moved[axis] - place[axis] for axis in (0, 1)]
        depth = [half - np.abs(a) for half, a in zip(half_width, away)]
        within, first = (depth[0] > 0) & (depth[1] > 0), depth[0] <= depth[1]
        for axis, nearest in enumerate((first, ~first)):
            out = within & nearest
            moved[axis][out] += np.copysign(depth[axis], away[axis])[out]
    return moved


def within_foot(body: MouldedBody, number: int, x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Return points within the outline of front (0) or rear (1) moved along rays from the axis, the outline
    onto the foot of the wall there, mm."""
    _, surface, vertex = body.lens.faces[number]
    turn = np.linspace(-np.pi, np.pi, DIRECTIONS)
    u, v = np.array([np.cos(turn), np.sin(turn)]) / surface.outline.gauge(np.cos(turn), np.sin(turn))
    low, high = np.zeros(DIRECTIONS), np.ones(DIRECTIONS)
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        inside = (
            body.wall(number).beside(middle * u, middle * v, vertex + surface(middle * u, middle * v)) < 0
        )
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    share = np.interp(np.arctan2(y, x), turn, high)
    return share * x, share * y


def outermost(faces: Sequence[Face]) -> Floats:
    """Return points of faces among which the outermost are, (3, n): front, rear, and the edges of others."""
    edges = (face.points[:, :, [0, -1]] for face in faces[2:])
    return np.concatenate([p.reshape(3, -1) for p in (*(f.points for f in faces[:2]), *edges)], axis=1)


def rendered(faces: Sequence[Face], view: View) -> tuple[Floats, Floats]:
    """Return the depth and the colour of the nearest point of every pixel.

    Shapes (PIXELS, PIXELS) and (PIXELS, PIXELS, 4).  The depth is -inf where there is no point.
    """
    depth, image = np.full(PIXELS**2, -np.inf), np.zeros((PIXELS**2, 4))
    for face in faces:
        normals = view.turn @ face.normals.reshape(3, -1)
        if normals[2].max() <= 0:  # turned away
            continue
        seen = view.turn @ face.points.reshape(3, -1)
        pixel = view.pixels(seen)
        np.maximum.at(depth, pixel, seen[2])
        nearest = np.flatnonzero(seen[2] >= depth[pixel])
        light = AMBIENT + (1 - AMBIENT) * (0.5 + 0.5 * (LIGHT @ normals[:, nearest])) ** 1.5
        image[pixel[nearest]] = np.column_stack([light[:, None] * face.colour, np.ones_like(light)])
    return _closed(depth.reshape(PIXELS, PIXELS), image.reshape(PIXELS, PIXELS, 4), 0.02 * view.half_size)


def _positions(surface: FreeformSurface, samples: int) -> list[Floats]:
    """Return x and y of samples, denser where the surface is steep.

    They are equal steps of a length that grows, at every x or y, as the steepest of the lines across it.
    """
    uniform = [np.linspace(-h, h, samples) for h in surface.half_width]
    z = surface.grid(uniform[0], uniform[1])
    positions = []
    for axis, a in enumerate(uniform):
        step = np.hypot(np.diff(a), np.abs(np.diff(z, axis=axis)).max(axis=1 - axis))
        length = np.concatenate([[0.0], np.cumsum(step)])
        positions.append(np.interp(np.linspace(0, length[-1], samples), length, a))
    return positions


def _linear(slope: Floats, x: Floats, y: Floats) -> Floats:
    """Return the linear function of x and y that is nearest to values on a grid."""
    x, y = x - x.mean(), y - y.mean()
    return slope.mean() + np.mean(slope.T @ x / (x @ x)) * x[:, None] + np.mean(slope @ y / (y @ y)) * y


def _rims(face: Face) -> list[Floats]:
    """Return the points along the four sides of front or rear, (3, n, 1) each."""
    sides = ((np.s_[:, :, side.end], np.s_[:, side.end])[side.axis] for side in SIDES)
    return [face.points[side].reshape(3, -1, 1) for side in sides]


def _level(rims: Sequence[Floats], outline: Outline, z: float) -> list[Floats]:
    """Return the points of a level outline in the directions of rims."""
    return [
        np.stack([x / outline.gauge(x, y), y / outline.gauge(x, y), np.full_like(x, z)]) for x, y, _ in rims
    ]


def _edges(lows: Sequence[Floats], highs: Sequence[Floats], count: int) -> list[Face]:
    """Return the four ruled faces between two rims, `count` points from one to the other."""
    w, edges = np.linspace(0, 1, count), []
    for side, low, high in zip(SIDES, lows, highs):
        points = (1 - w) * low + w * high
        normals = (-1 if side.clockwise else 1) * np.cross(np.gradient(points, axis=1), high - low, axis=0)
        edges.append(Face(side.name, points, _unit(*normals), GROUND))
    return edges


def _joined(edges: Sequence[Face]) -> Face:
    """Return the edge round a lens as one face, from those over the sides of its rectangle."""
    turned = [(-1 if side.clockwise else 1) for side in SIDES]
    points, normals = (
        np.concatenate([getattr(e, name)[:, ::step] for e, step in zip(edges, turned)], axis=1)
        for name in ("points", "normals")
    )
    return Face("edge", points, normals, GROUND)


def _unit(x: Floats, y: Floats, z: Floats) -> Floats:
    """Return vectors divided by their length, (3, ...)."""
    return np.stack([x, y, z]) / np.sqrt(x * x + y * y + z * z)


def _closed(depth: Floats, image: Floats, step: float) -> tuple[Floats, Floats]:
    """Return depth and image with the pixels closed that steep samples leave open, by their neighbours."""
    with np.errstate(invalid="ignore"):
        holes = grey_closing(depth, 3) - depth > step
    at = tuple(distance_transform_edt(holes, return_distances=False, return_indices=True))
    return depth[at], image[at]
