"""Pictures of the lens as a solid, four views at one scale, shaded by slope, with dimensions, and of source,
element and lit target with rays between them, seen obliquely.
"""

from collections.abc import Sequence
from itertools import groupby
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from matplotlib.transforms import Affine2D

from optics.light.tracing import RayPath
from optics.reporting.figures.canvas import plt, png_bytes
from optics.reporting.view import (
    DrawnElement,
    Face,
    Scene,
    View,
    block_means,
    caption,
    drawn_elements,
    oblique,
    outermost,
    placed,
    rendered,
    solid_faces,
    stop_rims,
)
from optics.scene.problem import FaceMet
from optics.scene.receivers import Plane
from optics.scene.system import LightTarget, System
from thbcad.checks import Floats
from thbcad.lens import Lens
from thbcad.moulds import Made, lens_of

LABEL = {"facecolor": "white", "alpha": 0.6, "lw": 0, "pad": 1.5}
OBLIQUE, SIDE = "oblique", "from the side, z to the right"
LENS = "front", "rear"  # what the optical faces of a lens are called
# of the axes, relative to the picture: left, bottom, width, height
POSITIONS = [(left, bottom, 0.5, 0.45) for bottom in (0.525, 0.05) for left in (0.0, 0.5)]
MOST_PIXELS = 256  # of the light on a curved target, across
SMALL = 0.15  # of the picture: smaller elements are drawn again, larger
WIDTH, TALLEST, TEXT = 7.6, 5.0, 0.4  # inches: of the picture, and of what stands under it
LETTERS = 110  # under a picture; more are smaller
AIM, LOST, GLOW, INK = "#d08400", "#c0392b", "#f5b301", "0.25"


def solid_views(solid: Made, sides: tuple[str, str] = LENS) -> bytes:
    """Return a PNG of a lens, its body or a mirror from the rear, the side, the front and obliquely.

    Faces are shaded by slope, in light from the upper left.  The relief of a surface with a sag, its slopes
    beyond those of a quadric, is shaded steeper: by the greatest of 1, 2, 5, 10, ... 5000 that leaves the
    median of these slopes below 0.5.  Outlines are true.  The text under the picture says what was shaded
    steeper.

    sides : what front and rear are called
    """
    faces, steeper = solid_faces(solid)
    turns, names = _turns(sides), dict(zip(LENS, sides))
    points = outermost(faces)
    boxes = {name: [f(turn[:2] @ points, axis=1) for f in (np.min, np.max)] for name, turn in turns.items()}
    half_size = max(
        (0.53 if name == OBLIQUE else 0.64) * np.ptp(box, axis=0).max() for name, box in boxes.items()
    )
    figure = plt.figure(figsize=(8.4, 8.6))
    for position, (name, turn) in zip(POSITIONS, turns.items()):
        axes = figure.add_axes(position, frameon=False, xticks=[], yticks=[])
        draw_solid(axes, faces, View(turn, np.mean(boxes[name], axis=0), half_size))
        axes.set_title(name, fontsize=10)
        if name == OBLIQUE:
            _names(axes, faces, turn, names)
        else:
            _dimensions(axes, boxes[name], half_size, height=name != SIDE)
    text = _text(lens_of(solid), steeper, names)
    size = min(9.0, 9.0 * LETTERS / max(map(len, text.split("\n"))))
    figure.text(0.5, 0.01, text, fontsize=size, ha="center")
    return png_bytes(figure)


def _turns(sides: tuple[str, str]) -> dict[str, Floats]:
    """Return the views by name; rows are right, up and towards the viewer, in the frame of the lens."""
    front, rear = sides
    return {
        f"from the {rear}, x to the right": np.eye(3),
        SIDE: np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]),
        f"from the {front}, x to the left": np.diag([-1.0, 1.0, -1.0]),
        OBLIQUE: oblique(32 if sides == LENS else 212, 24),  # a mirror is seen on its face
    }


def draw_solid(axes: Axes, faces: Sequence[Face], view: View, alpha: float = 1.0) -> None:
    """Draw the faces, the outline of the whole and those edges that are not hidden.  alpha : opacity of the
    faces."""
    depth, image = rendered(faces, view)
    image = np.rint(255 * image).astype(np.uint8)  # resampled in half the time
    axes.imshow(image, origin="lower", extent=view.extent, interpolation="bilinear", alpha=alpha, zorder=2)
    axes.contour(
        np.isfinite(depth),
        levels=[0.5],
        colors=INK,
        linewidths=0.9,
        origin="lower",
        extent=view.extent,
        zorder=2,
    )
    lines = []
    for face in faces[2:]:
        for line in (face.points[:, :, 0], face.points[:, :, -1], face.points[:, 0], face.points[:, -1]):
            seen = view.turn @ line
            hidden = seen[2] < depth.ravel()[view.pixels(seen)] - 0.02 * view.half_size
            lines += [np.where(hidden, np.nan, seen[:2]), np.full((2, 1), np.nan)]
    axes.plot(*np.concatenate(lines, axis=1), color=INK, lw=0.9, zorder=2)


def _dimensions(axes: Axes, box: Sequence[Floats], half_size: float, height: bool) -> None:
    """Draw the width of the outline below it, and its height at its left."""
    (left, bottom), (right, top) = box
    gap = 0.07 * half_size
    arrow = {"arrowstyle": "<->", "lw": 0.8, "color": INK, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", (left, bottom - gap), (right, bottom - gap), arrowprops=arrow)
    axes.text(
        (left + right) / 2, bottom - 1.4 * gap, f"{right - left:.2f} mm", ha="center", va="top", fontsize=9
    )
    if height:
        axes.annotate("", (left - gap, bottom), (left - gap, top), arrowprops=arrow)
        axes.text(
            left - 1.4 * gap,
            (bottom + top) / 2,
            f"{top - bottom:.2f} mm",
            ha="right",
            va="center",
            rotation=90,
            fontsize=9,
        )


def _names(axes: Axes, faces: Sequence[Face], turn: Floats, names: dict[str, str]) -> None:
    """Write the names of the faces that the viewer sees in the middle of them.  names : of front and rear."""
    for face in faces:
        middle = (slice(None), *(n // 2 for n in face.points.shape[1:]))
        if turn[2] @ face.normals[middle] > 0.1:
            x, y = turn[:2] @ face.points[middle]
            axes.text(x, y, names.get(face.name, face.name), ha="center", va="center", fontsize=8, bbox=LABEL)


def _text(lens: Lens, steeper: dict[str, float], names: dict[str, str]) -> str:
    """Return what stands under the picture."""
    (one, front), (other, rear) = zip(names.values(), (s.outline.text() for s in (lens.front, lens.rear)))
    sizes = f"{one} and {other} {front}" if front == rear else f"{one} {front}, {other} {rear}"
    middle = lens.thickness + lens.rear(0, 0) - lens.front(0, 0)
    drawn = [
        f"relief of the {names[name]} shaded {factor:g} times as steep as it is"
        for name, factor in steeper.items()
        if factor > 1
    ]
    return "\n".join(
        [f"{sizes}, {middle:.2f} mm thick in the middle; outlines and dimensions are true", *drawn]
    )


def scene_view(system: System, irradiance: Floats, paths: Sequence[RayPath]) -> bytes:
    """Return a PNG of source, element, rays and the light on the target, in parallel projection.

    Of a target in the far field the rays alone are shown.  A long throw is drawn shorter, and a short one of
    a lens on the axis longer; the text under the picture says so.  An element that is small beside its target
    is shown again, larger.  Of a beam much wider than the element the middle is shown.

    irradiance : (rows, columns), row 0 at +v.  paths : from `scene_paths`.
    """
    elements = drawn_elements(system)
    scene = placed(system, elements)
    stops = stop_rims(system)
    boxes = [
        _wider(scene.box(*scene.bodies, scene.source, scene.outlook, *(rims[0] for rims in stops)), 0.06)
    ]
    if np.ptp(scene.box(scene.body), axis=0).max() < SMALL * np.ptp(boxes[0], axis=0).max():
        boxes.append(_wider(scene.box(scene.body, scene.source), 0.25))
    shapes = np.array([np.divide(*np.ptp(box, axis=0)) for box in boxes])  # width / height
    height = min(TALLEST, WIDTH / shapes.sum())
    starts = (WIDTH - height * shapes.sum()) / 2 + height * np.cumsum([0.0, *shapes[:-1]])
    figure = plt.figure(figsize=(WIDTH, height + TEXT))
    for box, shape, start in zip(boxes, shapes, starts):
        position = (start / WIDTH, TEXT / (height + TEXT), shape * height / WIDTH, height / (height + TEXT))
        axes = figure.add_axes(position, frameon=False, xticks=[], yticks=[])
        _draw(axes, scene, elements, paths, system.problem.faces_met)
        if scene.target.size:
            _target(axes, scene, system.target, irradiance)
        for rims in stops:
            _stop(axes, scene, rims)
        (left, low), (right, high) = box
        axes.set(xlim=(left, right), ylim=(low, high))
    under = caption(system.problem, scene)
    size = min(9.0, 9.0 * LETTERS / len(under))
    figure.text(0.5, 0.1 / (height + TEXT), under, fontsize=size, ha="center")
    return png_bytes(figure)


def _draw(
    axes: Axes,
    scene: Scene,
    elements: Sequence[DrawnElement],
    paths: Sequence[RayPath],
    met: Sequence[FaceMet],
) -> None:
    """Draw source, elements and rays; behind an element those that come to, or leave, a face turned away.

    met : the faces that light meets
    """
    faces = {element.name: element.placed for element in elements}
    visits = [list(some) for _, some in groupby(met, key=lambda face: face.optic.called)]
    over = [
        [
            1 + 2 * (scene.turn[2] @ faces[f.optic.called][f.face == "rear"].normals.sum(axis=(1, 2)) > 0)
            for f in ends
        ]
        for ends in ((visit[0], visit[-1]) for visit in visits)
    ]
    for path in paths:
        colour = AIM if path.fate.endswith("on_target") else LOST
        for points, (entry, leaving) in zip(_by_visit(scene.visible(path.points), visits), over):
            orders = entry, leaving if points.shape[1] > 2 else entry
            for part, order in zip((points[:, :-1], points[:, -2:]), orders):
                axes.plot(*scene(part), color=colour, lw=0.6, alpha=0.7, zorder=order)
    for source in scene.sources:
        outline = source.outline
        order = 3.4 if scene.nearer(outline) else 1.5
        axes.fill(*scene(outline), facecolor=GLOW, edgecolor=INK, lw=0.8, alpha=0.5, zorder=order)
        if not any(source.half_width):
            axes.plot(*scene(outline[:, :1]), "o", color=GLOW, mec=INK, ms=5, zorder=order)
    for element in sorted(elements, key=lambda e: float(scene.turn[2] @ e.box.mean(axis=1))):
        low, high = scene.box(outermost(element.placed))
        view = View(scene.turn, (low + high) / 2, 0.55 * (high - low).max())
        draw_solid(axes, element.placed, view, alpha=0.75)
        if elements[1:]:
            under = (low[0] + high[0]) / 2, low[1]
            axes.annotate(element.name, under, (0, -3), textcoords="offset points", ha="center", va="top")


def _by_visit(points: Floats, visits: Sequence[Sequence[Any]]) -> list[Floats]:
    """Return the points (3, n) of a path cut in the middle between an element and the next."""
    parts = []
    for visit in visits[:-1]:
        last = len(visit)  # the point on the face by which light leaves
        if points.shape[1] < last + 2:
            break
        middle = points[:, last : last + 2].mean(axis=1, keepdims=True)
        parts.append(np.concatenate([points[:, : last + 1], middle], axis=1))
        points = np.concatenate([middle, points[:, last + 1 :]], axis=1)
    return [*parts, points]


def _stop(axes: Axes, scene: Scene, rims: Sequence[Floats]) -> None:
    """Draw a stop as a thin plate.  rims : as of `stop_rims`."""
    closed = (np.concatenate([rim, rim[:, :1]], axis=1) for rim in rims)
    shape = Path.make_compound_path(*(Path(scene(rim).T, closed=True) for rim in closed))
    order = 3.5 if scene.nearer(rims[-1]) else 1.6
    axes.add_patch(PathPatch(shape, facecolor=INK, edgecolor=INK, lw=0.8, alpha=0.5, zorder=order))


def _wider(box: Floats, margin: float) -> Floats:
    """Return a (2, 2) box with a margin around it, relative to its longer side."""
    room = margin * np.ptp(box, axis=0).max()
    return box + np.array([[-room], [room]])


def _target(axes: Axes, scene: Scene, target: LightTarget, irradiance: Floats) -> None:
    """Draw the light on the target, a curved one pixel by pixel, or block by block."""
    receiver, (x, y) = target.receiver, target.settings.half_width
    behind = scene.turn[2] @ np.array(receiver.normal(0.0, 0.0)) > 0
    order = (4.0 if behind else 2.5) if scene.nearer(scene.outlook) else 0.5
    shown: dict[str, Any] = {"cmap": "gray", "vmin": 0, "vmax": float(np.quantile(irradiance, 0.999)) or 1.0}

    def seen(u: Floats, v: Floats) -> Floats:
        return scene(np.stack(np.broadcast_arrays(*receiver.points(u, v))))

    if isinstance(receiver, Plane):
        origin, right, up = seen(np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])).T
        plane = np.array([[*column, 0.0] for column in (right - origin, up - origin)] + [[*origin, 1.0]]).T
        axes.imshow(
            irradiance,
            extent=(-x, x, -y, y),
            transform=Affine2D(plane) + axes.transData,
            interpolation="antialiased",
            zorder=order,
            **shown,
        )
    else:
        light = block_means(irradiance, -(-max(irradiance.shape) // MOST_PIXELS))
        u, v = (np.linspace(-h, h, n + 1) for h, n in zip((x, y), light.shape[::-1]))
        axes.pcolormesh(*seen(*np.meshgrid(u, v[::-1])), light, zorder=order, rasterized=True, **shown)
    axes.fill(*scene(scene.outlook), facecolor="none", edgecolor=INK, lw=0.9, zorder=order)
