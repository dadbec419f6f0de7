"""A picture of the lens as a solid: four views at one scale, shaded by slope, with dimensions in mm."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from optics.reporting.figures.canvas import plt, png_bytes
from optics.reporting.view import Face, View, oblique, outermost, rendered, solid_faces
from thbcad.lens import Lens
from thbcad.moulds import Solid, lens_of

Array = NDArray[np.float64]

INK = "0.2"
LABEL = {"facecolor": "white", "alpha": 0.6, "lw": 0, "pad": 1.5}
OBLIQUE, SIDE = "oblique", "from the side, z to the right"
LENS = "front", "rear"  # what the optical faces of a lens are called
# of the axes, relative to the picture: left, bottom, width, height
POSITIONS = [(left, bottom, 0.5, 0.45) for bottom in (0.525, 0.05) for left in (0.0, 0.5)]


def solid_views(solid: Solid, sides: tuple[str, str] = LENS) -> bytes:
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
    figure.text(0.5, 0.01, _text(lens_of(solid), steeper, names), fontsize=9, ha="center")
    return png_bytes(figure)


def _turns(sides: tuple[str, str]) -> dict[str, Array]:
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


def _dimensions(axes: Axes, box: Sequence[Array], half_size: float, height: bool) -> None:
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


def _names(axes: Axes, faces: Sequence[Face], turn: Array, names: dict[str, str]) -> None:
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
