"""The faces of the lens as points, and shaded images of it as a solid.

The faces are sampled as points with normals, turned, and put into a depth buffer: the nearest
point gives a pixel its colour.  The light grazes, and fine slopes are drawn steeper than they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, grey_closing

from thbcad.lens import SIDES, FreeformSurface, Lens
from thbcad.poses import Pose

Array = NDArray[np.float64]

SAMPLES = 420  # across a face
PIXELS = 440  # across a view, in which a face takes 350 at most
STEEP = 0.5  # median slope up to which relief is drawn steeper
FACTORS = np.outer(10.0 ** np.arange(4), [1, 2, 5]).ravel()
LIGHT = np.array([-0.63, 0.60, 0.49])  # direction to the light: right, up, towards the viewer
GLASS, GROUND = (0.86, 0.93, 1.0), (0.78, 0.84, 0.9)  # of optical faces and of edges
AMBIENT = 0.25


@dataclass(frozen=True, eq=False)
class Face:
    """A face as a grid of points, mm, with the outward normals that it is shaded by, both (3, n, m)."""

    name: str
    points: Array
    normals: Array
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

    turn: Array
    centre: Array
    half_size: float

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Left, right, bottom and top of the view, mm."""
        (x, y), r = self.centre, self.half_size
        return (x - r, x + r, y - r, y + r)

    def pixels(self, seen: Array) -> NDArray[np.int64]:
        """Return the number of the pixel of every turned point (3, n), (n,)."""
        scale = PIXELS / (2 * self.half_size)
        column, row = ((seen[:2] + (self.half_size - self.centre)[:, None]) * scale).astype(np.int64)
        return row * PIXELS + column


def oblique(turn: float, rise: float) -> Array:
    """Return the rotation of a view on the rear from `turn` degrees to the right and `rise` above, (3, 3)."""
    a, b = np.deg2rad([turn, rise])
    right = np.array([np.cos(a), 0.0, -np.sin(a)])
    toward = np.array([np.cos(b) * np.sin(a), np.sin(b), np.cos(b) * np.cos(a)])
    return np.stack([right, np.cross(toward, right), toward])


def solid_faces(lens: Lens, samples: int = SAMPLES) -> tuple[list[Face], dict[str, float]]:
    """Return the faces, front and rear first, and by name how many times steeper their relief is.

    The edge of a lens that is no rectangle is one face.

    samples : across a face
    """
    faces, steeper = [], {}
    for name, surface, vertex, side in (
        ("front", lens.front, 0.0, -1),
        ("rear", lens.rear, lens.thickness, 1),
    ):
        x, y = _positions(surface, samples)
        u, v = np.meshgrid(x, y, indexing="ij")
        evaluate = partial(surface.grid, x, y)
        if not surface.outline.is_rectangle:
            u, v = surface.outline.filled(u, v)
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
    edges = _edges(faces[0], faces[1], samples)
    if not lens.front.outline.is_rectangle:
        edges = [_joined(edges)]
    return faces + edges, steeper


def rendered(faces: Sequence[Face], view: View) -> tuple[Array, Array]:
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


def _positions(surface: FreeformSurface, samples: int) -> list[Array]:
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


def _linear(slope: Array, x: Array, y: Array) -> Array:
    """Return the linear function of x and y that is nearest to values on a grid."""
    x, y = x - x.mean(), y - y.mean()
    return slope.mean() + np.mean(slope.T @ x / (x @ x)) * x[:, None] + np.mean(slope @ y / (y @ y)) * y


def _edges(front: Face, rear: Face, samples: int) -> list[Face]:
    """Return the four ruled faces between the rims, their points along a rim and then from front to rear."""
    size = np.ptp(np.concatenate([front.points, rear.points], axis=1), axis=(1, 2))
    w = np.linspace(0, 1, 2 + int(samples * size[2] / size.max()))
    edges = []
    for side in SIDES:
        rim, sign = (np.s_[:, :, side.end], np.s_[:, side.end])[side.axis], -1 if side.clockwise else 1
        low, high = (face.points[rim].reshape(3, -1, 1) for face in (front, rear))
        points = (1 - w) * low + w * high
        normals = sign * np.cross(np.gradient(points, axis=1), high - low, axis=0)
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


def _unit(x: Array, y: Array, z: Array) -> Array:
    """Return vectors divided by their length, (3, ...)."""
    return np.stack([x, y, z]) / np.sqrt(x * x + y * y + z * z)


def _closed(depth: Array, image: Array, step: float) -> tuple[Array, Array]:
    """Return depth and image with the pixels closed that steep samples leave open, by their neighbours."""
    with np.errstate(invalid="ignore"):
        holes = grey_closing(depth, 3) - depth > step
    at = tuple(distance_transform_edt(holes, return_distances=False, return_indices=True))
    return depth[at], image[at]
