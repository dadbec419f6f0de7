"""A picture of source, lens and lit target with rays between them, seen obliquely from behind the target."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isinf
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.transforms import Affine2D
from numpy.typing import NDArray

from optics.report.canvas import plt, png_bytes
from optics.report.scene_rays import FAR
from optics.report.solid_figure import draw_solid
from optics.report.solid_renderer import Face, View, oblique, solid_faces

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from optics.problem import Problem
    from optics.system import OpticalSystem
    from optics.tracing import RayPath
    from thbcad.lens import Lens

    Array = NDArray[np.float64]

RISE, LEAST_TURN, MOST_TURN = 18.0, 52.0, 60.0  # degrees: from where the scene is seen
# half-widths of lens and target together between their middles in the picture: more than 1 leaves both free
CLEAR = 1.7
# in the same half-widths: shorter and longer throws are drawn longer and shorter
SHORT = CLEAR / np.tan(np.radians(MOST_TURN))
LONG = 3.0
FACTORS = np.outer(10.0 ** np.arange(7), [1, 2, 5]).ravel()
BESIDE = 1.3  # half-widths of the front, to where a wider beam is drawn
SMALL = 0.15  # of the picture: smaller lenses are drawn again, larger
WIDTH, TALLEST, TEXT = 7.6, 5.0, 0.4  # inches: of the picture, and of what stands under it
AIM, LOST, GLOW, INK = "#d08400", "#c0392b", "#f5b301", "0.25"


@dataclass(frozen=True, eq=False)
class Scene:
    """The positions of source, lens and target, mm, and their projection.

    turn : (3, 3), rows right, up and towards the viewer
    lens : (3, 2), least and greatest corner of the box around it
    source : (3, n), outline
    target : (3, 4), corners, or (3, 0) for the far field
    squeeze : how many times the distance behind the lens is drawn shorter than it is (below 1: longer)
    """

    turn: Array
    lens: Array
    source: Array
    target: Array
    squeeze: float

    def __call__(self, points: Array) -> Array:
        """Return points (3, n) in the picture, (2, n)."""
        x, y, z = points
        top = self.lens[2, 1]
        return self.turn[:2] @ np.stack([x, y, np.minimum(z, top) + np.maximum(z - top, 0.0) / self.squeeze])

    def box(self, *parts: Array) -> Array:
        """Return the (2, 2) least and greatest corner of what is drawn of points."""
        seen = self(np.concatenate(parts, axis=1))
        return np.stack([seen.min(axis=1), seen.max(axis=1)])


def scene_view(system: OpticalSystem, lens: Lens, irradiance: Array, paths: Sequence[RayPath]) -> bytes:
    """Return a PNG of source, lens, rays and the light on the target, in parallel projection.

    Of a target in the far field the rays alone are shown.  A long throw is drawn shorter, a short one longer,
    and the text under the picture says so.  A lens that is small beside its target is shown again, larger.
    Of a beam much wider than the lens the middle is shown.

    irradiance : (rows, columns), row 0 at +y.  paths : from `scene_paths`.
    """
    problem = system.problem
    faces, _ = solid_faces(lens)
    scene = placed(problem, faces)
    body = _corners(scene.lens)
    target = scene.target if scene.target.size else _corners(_behind(scene.lens))
    boxes = [_wider(scene.box(body, scene.source, target), 0.06)]
    if np.ptp(scene.box(body), axis=0).max() < SMALL * np.ptp(boxes[0], axis=0).max():
        boxes.append(_wider(scene.box(body, scene.source), 0.25))
    shapes = np.array([np.divide(*np.ptp(box, axis=0)) for box in boxes])  # width / height
    height = min(TALLEST, WIDTH / shapes.sum())
    starts = (WIDTH - height * shapes.sum()) / 2 + height * np.cumsum([0.0, *shapes[:-1]])
    figure = plt.figure(figsize=(WIDTH, height + TEXT))
    for box, shape, start in zip(boxes, shapes, starts):
        position = (start / WIDTH, TEXT / (height + TEXT), shape * height / WIDTH, height / (height + TEXT))
        axes = figure.add_axes(position, frameon=False, xticks=[], yticks=[])
        _draw(axes, scene, faces, irradiance, paths)
        (left, low), (right, high) = box
        axes.set_xlim(left, right)
        axes.set_ylim(low, high)
    figure.text(0.5, 0.1 / (height + TEXT), _text(problem, scene), fontsize=9, ha="center")
    return png_bytes(figure)


def placed(problem: Problem, faces: Sequence[Face]) -> Scene:
    """Return the scene of a problem, turned so that the target leaves the lens free."""
    points = np.concatenate([face.points.reshape(3, -1) for face in faces[:2]], axis=1)
    box = np.stack([points.min(axis=1), points.max(axis=1)], axis=1)
    source, kind = problem.source, problem.source.kind
    before = box[2, 0] - 0.6 * np.ptp(box[:2], axis=1).max() if kind == "collimated" else -source.distance
    around = np.linspace(0, 2 * np.pi, 65) if source.profile == "round" else np.pi / 4 * np.arange(1, 10, 2)
    size = 1.0 if source.profile == "round" else np.sqrt(2)
    extent = (
        np.minimum(source.half_width, BESIDE * faces[0].points[:2].max(axis=(1, 2)))
        if kind == "collimated"
        else source.half_width
    )
    outline = np.stack(
        [*(h * size * f(around) for h, f in zip(extent, (np.cos, np.sin))), np.full(around.size, before)]
    )
    if isinf(problem.target_z):
        return Scene(oblique(-LEAST_TURN, RISE), box, outline, np.zeros((3, 0)), 1.0)
    hx, hy = problem.target.half_width
    corners = np.array([[-hx, hx, hx, -hx], [-hy, -hy, hy, hy], [problem.target_z] * 4])
    throw, width = problem.target_z - box[2, 1], hx + box[0, 1]
    squeeze = FACTORS[FACTORS * LONG * width <= throw].max(initial=1.0) / FACTORS[
        FACTORS * throw >= SHORT * width
    ].min(initial=FACTORS[-1])
    turn = np.clip(np.degrees(np.arctan2(CLEAR * width, throw / squeeze)), LEAST_TURN, MOST_TURN)
    return Scene(oblique(-turn, RISE), box, outline, corners, squeeze)


def _draw(
    axes: Axes, scene: Scene, faces: Sequence[Face], irradiance: Array, paths: Sequence[RayPath]
) -> None:
    """Draw everything, what is nearer above what is farther."""
    _rays(axes, scene, paths)
    _source(axes, scene)
    low, high = scene.box(*(face.points.reshape(3, -1) for face in faces[:2]))
    draw_solid(axes, faces, View(scene.turn, (low + high) / 2, 0.55 * (high - low).max()), alpha=0.75)
    if scene.target.size:
        _target(axes, scene, irradiance)


def _wider(box: Array, margin: float) -> Array:
    """Return a (2, 2) box with a margin around it, relative to its longer side."""
    room = margin * np.ptp(box, axis=0).max()
    return box + np.array([[-room], [room]])


def _corners(box: Array) -> Array:
    """Return the eight corners of a box (3, 2), (3, 8)."""
    return np.array(np.meshgrid(*box)).reshape(3, 8)


def _behind(lens: Array) -> Array:
    """Return the box of a lens made wider and as long as rays to the far field are drawn, (3, 2)."""
    across = 1.5 * lens[:2]
    return np.stack([*across, lens[2] + [0.0, FAR / 2 * np.ptp(lens[:2], axis=1).max()]])


def _rays(axes: Axes, scene: Scene, paths: Sequence[RayPath]) -> None:
    """Draw the rays, their last part above the lens and what comes before it below."""
    for path in paths:
        points = path.points.T.copy()
        if points[2, 0] < scene.source[2, 0]:  # parallel light comes from before its source's picture
            points[:, 0] = *points[:2, 0], scene.source[2, 0]
        colour = AIM if path.fate.endswith("on_target") else LOST
        for part, order in ((points[:, :-1], 1), (points[:, -2:], 3 if points.shape[1] > 2 else 1)):
            axes.plot(*scene(part), color=colour, lw=0.6, alpha=0.7, zorder=order)


def _source(axes: Axes, scene: Scene) -> None:
    """Draw the outline of the source, or a point."""
    axes.fill(*scene(scene.source), facecolor=GLOW, edgecolor=INK, lw=0.8, alpha=0.5, zorder=1.5)
    if not np.ptp(scene.source[:2]):
        axes.plot(*scene(scene.source[:, :1]), "o", color=GLOW, mec=INK, ms=5, zorder=1.5)


def _target(axes: Axes, scene: Scene, irradiance: Array) -> None:
    """Draw the light on the target's plane."""
    (x, y), z = scene.target[:2, 2], scene.target[2, 0]
    origin, right, up = scene(np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [z, z, z]])).T
    plane = Affine2D(
        np.array([[*column, 0.0] for column in (right - origin, up - origin)] + [[*origin, 1.0]]).T
    )
    top = float(np.quantile(irradiance, 0.999)) or 1.0
    axes.imshow(
        irradiance,
        cmap="gray",
        vmin=0,
        vmax=top,
        extent=(-x, x, -y, y),
        transform=plane + axes.transData,
        interpolation="antialiased",
        zorder=4,
    )
    axes.fill(*scene(scene.target), facecolor="none", edgecolor=INK, lw=0.9, zorder=4)


def _text(problem: Problem, scene: Scene) -> str:
    """Return what stands under the picture."""
    if not scene.target.size:
        return "rays to the far field"
    hx, hy = problem.target.half_width
    text = f"target {2 * hx:g} x {2 * hy:g} mm, {problem.target.distance:g} mm behind the lens"
    if scene.squeeze == 1:
        return text
    drawn = f"{scene.squeeze:g} times shorter" if scene.squeeze > 1 else f"{1 / scene.squeeze:g} times longer"
    return f"{text}; this distance is drawn {drawn} than it is"
