"""A picture of source, lens and lit target with rays between them, seen obliquely from behind the target."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from matplotlib.transforms import Affine2D
from numpy.typing import NDArray

from optics.light.tracing import RayPath
from optics.reporting.figures.canvas import plt, png_bytes
from optics.reporting.figures.solid_figure import draw_solid
from optics.reporting.view import (
    Face,
    Scene,
    View,
    block_means,
    caption,
    corners,
    outermost,
    placed,
    solid_faces,
    stop_rims,
    with_far_rays,
)
from optics.scene.system import LightTarget, OpticalSystem
from thbcad.lens import Lens

Array = NDArray[np.float64]

MOST_PIXELS = 256  # of the light on a curved target, across
SMALL = 0.15  # of the picture: smaller lenses are drawn again, larger
WIDTH, TALLEST, TEXT = 7.6, 5.0, 0.4  # inches: of the picture, and of what stands under it
LETTERS = 110  # under a picture; more are smaller
AIM, LOST, GLOW, INK = "#d08400", "#c0392b", "#f5b301", "0.25"


def scene_view(system: OpticalSystem, lens: Lens, irradiance: Array, paths: Sequence[RayPath]) -> bytes:
    """Return a PNG of source, lens, rays and the light on the target, in parallel projection.

    Of a target in the far field the rays alone are shown.  A long throw is drawn shorter, a short one longer,
    and the text under the picture says so.  A lens that is small beside its target is shown again, larger.
    Of a beam much wider than the lens the middle is shown.

    irradiance : (rows, columns), row 0 at +y.  paths : from `scene_paths`.
    """
    problem = system.problem
    faces, _ = solid_faces(system.solid(lens))
    scene = placed(system, faces)
    body = corners(scene.lens)
    target = scene.target if scene.target.size else corners(with_far_rays(scene.lens))
    stops = stop_rims(system, lens)
    boxes = [_wider(scene.box(body, scene.source, target, *(rims[0] for rims in stops)), 0.06)]
    if np.ptp(scene.box(body), axis=0).max() < SMALL * np.ptp(boxes[0], axis=0).max():
        boxes.append(_wider(scene.box(body, scene.source), 0.25))
    shapes = np.array([np.divide(*np.ptp(box, axis=0)) for box in boxes])  # width / height
    height = min(TALLEST, WIDTH / shapes.sum())
    starts = (WIDTH - height * shapes.sum()) / 2 + height * np.cumsum([0.0, *shapes[:-1]])
    figure = plt.figure(figsize=(WIDTH, height + TEXT))
    for box, shape, start in zip(boxes, shapes, starts):
        position = (start / WIDTH, TEXT / (height + TEXT), shape * height / WIDTH, height / (height + TEXT))
        axes = figure.add_axes(position, frameon=False, xticks=[], yticks=[])
        _draw(axes, scene, faces, paths)
        if scene.target.size:
            _target(axes, scene, irradiance, system.target)
        for rims in stops:
            _stop(axes, scene, rims)
        (left, low), (right, high) = box
        axes.set_xlim(left, right)
        axes.set_ylim(low, high)
    under = caption(problem, scene)
    size = min(9.0, 9.0 * LETTERS / len(under))
    figure.text(0.5, 0.1 / (height + TEXT), under, fontsize=size, ha="center")
    return png_bytes(figure)


def _draw(axes: Axes, scene: Scene, faces: Sequence[Face], paths: Sequence[RayPath]) -> None:
    """Draw source, lens and rays, what is nearer above what is farther."""
    for path in paths:
        points = scene.visible(path.points)
        colour = AIM if path.fate.endswith("on_target") else LOST
        for part, order in ((points[:, :-1], 1), (points[:, -2:], 3 if points.shape[1] > 2 else 1)):
            axes.plot(*scene(part), color=colour, lw=0.6, alpha=0.7, zorder=order)
    axes.fill(*scene(scene.source), facecolor=GLOW, edgecolor=INK, lw=0.8, alpha=0.5, zorder=1.5)
    if not np.ptp(scene.source[:2]):
        axes.plot(*scene(scene.source[:, :1]), "o", color=GLOW, mec=INK, ms=5, zorder=1.5)
    low, high = scene.box(outermost(faces))
    draw_solid(axes, faces, View(scene.turn, (low + high) / 2, 0.55 * (high - low).max()), alpha=0.75)


def _stop(axes: Axes, scene: Scene, rims: Sequence[Array]) -> None:
    """Draw a stop as a thin plate.  rims : as of `stop_rims`."""
    shape = Path.make_compound_path(*(Path(scene(rim).T, closed=True) for rim in map(_closed, rims)))
    before = bool(rims[-1][2].mean() < scene.lens[2].mean())
    patch = PathPatch(shape, facecolor=INK, edgecolor=INK, lw=0.8, alpha=0.5, zorder=1.6 if before else 3.5)
    axes.add_patch(patch)


def _closed(rim: Array) -> Array:
    return np.concatenate([rim, rim[:, :1]], axis=1)


def _wider(box: Array, margin: float) -> Array:
    """Return a (2, 2) box with a margin around it, relative to its longer side."""
    room = margin * np.ptp(box, axis=0).max()
    return box + np.array([[-room], [room]])


def _target(axes: Axes, scene: Scene, irradiance: Array, target: LightTarget) -> None:
    """Draw the light on the target: a curved one pixel by pixel, or block by block."""
    (x, y), receiver = target.settings.half_width, target.receiver
    shown: dict[str, Any] = {"cmap": "gray", "vmin": 0, "vmax": float(np.quantile(irradiance, 0.999)) or 1.0}
    if target.settings.curved:
        light = block_means(irradiance, -(-max(irradiance.shape) // MOST_PIXELS))
        u, v = (np.linspace(-h, h, n + 1) for h, n in zip((x, y), light.shape[::-1]))
        points = np.stack(np.broadcast_arrays(*receiver.points(*np.meshgrid(u, v[::-1]))))
        seen = scene(points.reshape(3, -1)).reshape(2, *points.shape[1:])
        axes.pcolormesh(*seen, light, zorder=4, rasterized=True, **shown)
    else:
        corners = np.broadcast_arrays(*receiver.points(np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])))
        origin, right, up = scene(np.stack(corners)).T
        plane = Affine2D(
            np.array([[*column, 0.0] for column in (right - origin, up - origin)] + [[*origin, 1.0]]).T
        )
        axes.imshow(
            irradiance,
            extent=(-x, x, -y, y),
            transform=plane + axes.transData,
            interpolation="antialiased",
            zorder=4,
            **shown,
        )
    axes.fill(*scene(scene.rim), facecolor="none", edgecolor=INK, lw=0.9, zorder=4)
