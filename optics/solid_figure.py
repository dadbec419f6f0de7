"""A picture of the lens as a solid: four views at one scale, shaded by slope, with dimensions in mm.

The six faces are sampled as points with normals, turned, and put into a depth buffer: the nearest
point gives a pixel its colour.  The light grazes, and fine slopes are drawn steeper than they are.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import matplotlib
import numpy as np
from numpy.typing import NDArray

matplotlib.use("Agg")
from matplotlib import pyplot as plt
from scipy.ndimage import distance_transform_edt, grey_closing

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from thbcad.lens import Lens

    Array = NDArray[np.float64]

DPI = 110
SAMPLES = 500  # across a face
PIXELS = 440  # across a view, in which a face takes 350 at most
STEEP = 0.5  # median slope up to which relief is drawn steeper
FACTORS = np.outer(10.0 ** np.arange(4), [1, 2, 5]).ravel()
LIGHT = np.array([-0.63, 0.60, 0.49])  # direction to the light: right, up, towards the viewer
GLASS, GROUND = (0.86, 0.93, 1.0), (0.78, 0.84, 0.9)  # of optical faces and of edges
AMBIENT = 0.25
INK = "0.2"
NAMES = ("from the rear, x to the right", "from the side, z to the right", "from the front, x to the left", "oblique")
LABEL = {"facecolor": "white", "alpha": 0.6, "lw": 0, "pad": 1.5}
REAR = np.eye(3)  # rows: right, up and towards the viewer, as directions in the lens frame
FRONT = np.diag([-1.0, 1.0, -1.0])
SIDE = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])


@dataclass(frozen=True, eq=False)
class Face:
    """A face as a grid of points, mm, with the outward normals that it is shaded by, both (3, n, m)."""

    name: str
    points: Array
    normals: Array
    colour: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class View:
    """A direction to look along.

    turn : (3, 3), rows right, up and towards the viewer
    centre : (2,), right and up in the middle of the view, mm
    reach : half the width of the view, mm
    """

    turn: Array
    centre: Array
    reach: float

    def pixels(self, seen: Array) -> NDArray[np.int64]:
        """Return the number of the pixel of every turned point (3, n), (n,)."""
        column, row = ((seen[:2] + (self.reach - self.centre)[:, None]) * (PIXELS / (2 * self.reach))).astype(np.int64)
        return row * PIXELS + column


def solid_views(lens: Lens) -> bytes:
    """Return a PNG of the lens from the rear, from the side, from the front and obliquely.

    Faces are shaded by slope, in light from the upper left.  Of a surface with a sag the slopes
    beyond those of a quadric, its relief, are taken steeper for that: by the greatest of
    1, 2, 5, 10, ... 5000 that leaves their median below 0.5.  Outlines are true, and the text
    under the picture says what was taken steeper.
    """
    faces, steeper = _faces(lens)
    turns = dict(zip(NAMES, (REAR, SIDE, FRONT, _oblique(32, 24))))
    points = np.concatenate([face.points.reshape(3, -1) for face in faces[:2]], axis=1)
    boxes = {name: [f(turn[:2] @ points, axis=1) for f in (np.min, np.max)] for name, turn in turns.items()}
    reach = max((0.53 if name == NAMES[3] else 0.64) * np.ptp(box, axis=0).max() for name, box in boxes.items())
    figure, grid = plt.subplots(2, 2, figsize=(8.4, 8.6), layout="constrained")
    for axes, (name, turn) in zip(grid.flat, turns.items()):
        view = View(turn, np.mean(boxes[name], axis=0), reach)
        _draw(axes, faces, view)
        axes.set_title(name, fontsize=10)
        if name == NAMES[3]:
            _names(axes, faces, turn)
        else:
            _dimensions(axes, boxes[name], reach, height=name != NAMES[1])
    figure.supxlabel(_text(lens, steeper), fontsize=9)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=DPI, metadata={"Software": None})
    plt.close(figure)
    return buffer.getvalue()


def _faces(lens: Lens) -> tuple[list[Face], dict[str, float]]:
    """Return the six faces, and by how much the relief of front and rear is steeper than it is."""
    faces, steeper = [], {}
    for name, surface, vertex, side in (("front", lens.front, 0.0, -1), ("rear", lens.rear, lens.thickness, 1)):
        x, y = (np.linspace(-h, h, SAMPLES) for h in surface.half_width)
        slopes = [surface.grid(x, y, order) for order in ((1, 0), (0, 1))]
        smooth = [_linear(slope, x, y) for slope in slopes]
        usual = np.median(np.hypot(*(slope - flat for slope, flat in zip(slopes, smooth))))
        steeper[name] = 1.0 if surface.sag is None else float(FACTORS[FACTORS * usual < STEEP].max(initial=1.0))
        drawn = [flat + steeper[name] * (slope - flat) for slope, flat in zip(slopes, smooth)]
        points = np.stack([*np.meshgrid(x, y, indexing="ij"), vertex + surface.grid(x, y)])
        faces.append(Face(name, points, _unit(-side * drawn[0], -side * drawn[1], np.full_like(drawn[0], side)), GLASS))
    return faces + _edges(*faces), steeper


def _linear(slope: Array, x: Array, y: Array) -> Array:
    """Return the linear function of x and y that is nearest to values on a symmetric grid."""
    return slope.mean() + np.mean(slope.T @ x / (x @ x)) * x[:, None] + np.mean(slope @ y / (y @ y)) * y


def _edges(front: Face, rear: Face) -> list[Face]:
    """Return the four ruled faces between the rims, their points along a rim and then from front to rear."""
    size = np.ptp(np.concatenate([front.points, rear.points], axis=1), axis=(1, 2))
    w = np.linspace(0, 1, 2 + int(SAMPLES * size[2] / size.max()))
    edges = []
    for name, rim, sign in (("-y", np.s_[:, :, :1], 1), ("+x", np.s_[:, -1:], 1), ("+y", np.s_[:, :, -1:], -1), ("-x", np.s_[:, :1], -1)):
        low, high = (face.points[rim].reshape(3, -1, 1) for face in (front, rear))
        points = (1 - w) * low + w * high
        normals = sign * np.cross(np.gradient(points, axis=1), high - low, axis=0)
        edges.append(Face(f"edge {name}", points, _unit(*normals), GROUND))
    return edges


def _unit(x: Array, y: Array, z: Array) -> Array:
    """Return vectors divided by their length, (3, ...)."""
    return np.stack([x, y, z]) / np.sqrt(x * x + y * y + z * z)


def _oblique(turn: float, rise: float) -> Array:
    """Return the turn of a view on the rear from `turn` degrees to the right and `rise` degrees above."""
    a, b = np.deg2rad([turn, rise])
    right = np.array([np.cos(a), 0.0, -np.sin(a)])
    toward = np.array([np.cos(b) * np.sin(a), np.sin(b), np.cos(b) * np.cos(a)])
    return np.stack([right, np.cross(toward, right), toward])


def _draw(axes: Axes, faces: Sequence[Face], view: View) -> None:
    """Draw the faces, the outline of the whole and those edges that are not hidden."""
    depth, image = _rendered(faces, view)
    extent = [view.centre[k] + side * view.reach for k in (0, 1) for side in (-1, 1)]
    axes.imshow(image, origin="lower", extent=extent, interpolation="bilinear")
    axes.contour(np.isfinite(depth), levels=[0.5], colors=INK, linewidths=0.9, origin="lower", extent=extent)
    for face in faces[2:]:
        for line in (face.points[:, :, 0], face.points[:, :, -1], face.points[:, 0], face.points[:, -1]):
            seen = view.turn @ line
            hidden = seen[2] < depth.ravel()[view.pixels(seen)] - 0.02 * view.reach
            axes.plot(*np.where(hidden, np.nan, seen)[:2], color=INK, lw=0.9)
    axes.set_axis_off()


def _rendered(faces: Sequence[Face], view: View) -> tuple[Array, Array]:
    """Return the depth of the nearest point of every pixel, -inf for none, (PIXELS, PIXELS), and its colour, (PIXELS, PIXELS, 4)."""
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
    return _closed(depth.reshape(PIXELS, PIXELS), image.reshape(PIXELS, PIXELS, 4), 0.02 * view.reach)


def _closed(depth: Array, image: Array, step: float) -> tuple[Array, Array]:
    """Return depth and image without the pixels that steep samples leave open: those take what is beside them."""
    with np.errstate(invalid="ignore"):
        holes = grey_closing(depth, 3) - depth > step
    at = tuple(distance_transform_edt(holes, return_distances=False, return_indices=True))
    return depth[at], image[at]


def _dimensions(axes: Axes, box: Sequence[Array], reach: float, height: bool) -> None:
    """Draw the width of the outline below it, and its height at its left."""
    (left, bottom), (right, top) = box
    gap = 0.07 * reach
    arrow = {"arrowstyle": "<->", "lw": 0.8, "color": INK, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", (left, bottom - gap), (right, bottom - gap), arrowprops=arrow)
    axes.text((left + right) / 2, bottom - 1.4 * gap, f"{right - left:.2f} mm", ha="center", va="top", fontsize=9)
    if height:
        axes.annotate("", (left - gap, bottom), (left - gap, top), arrowprops=arrow)
        axes.text(left - 1.4 * gap, (bottom + top) / 2, f"{top - bottom:.2f} mm", ha="right", va="center", rotation=90, fontsize=9)


def _names(axes: Axes, faces: Sequence[Face], turn: Array) -> None:
    """Write the names of the faces that the viewer sees in the middle of them."""
    for face in faces:
        middle = (slice(None), *(n // 2 for n in face.points.shape[1:]))
        if turn[2] @ face.normals[middle] > 0.1:
            axes.text(*(turn[:2] @ face.points[middle]), face.name, ha="center", va="center", fontsize=8, bbox=LABEL)


def _text(lens: Lens, steeper: dict[str, float]) -> str:
    """Return what stands under the picture."""
    front, rear = (f"{2 * s.half_width[0]:g} x {2 * s.half_width[1]:g} mm" for s in (lens.front, lens.rear))
    sizes = f"front and rear {front}" if front == rear else f"front {front}, rear {rear}"
    middle = lens.thickness + lens.rear(0, 0)[0] - lens.front(0, 0)[0]
    drawn = [f"relief of the {name} shaded {factor:g} times as steep as it is" for name, factor in steeper.items() if factor > 1]
    return "\n".join([f"{sizes}, {middle:.2f} mm thick in the middle; outlines and dimensions are true", *drawn])
