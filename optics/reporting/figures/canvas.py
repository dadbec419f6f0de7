"""Figures as PNG, and pictures whose pixels are whole numbers of pixels of the figure (matplotlib)."""

import io
from math import log
from typing import cast

import matplotlib
import numpy as np
from PIL import Image

from optics.reporting.view import block_means
from thbcad.checks import Floats

matplotlib.use("Agg")
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.transforms import IdentityTransform

DPI, SIZE = 110, (5.2, 4.4)
COMPRESSION = 3  # of 9: half the time of the usual 6 for 9 % more bytes
ROOM = {"left": 0.17, "right": 0.95, "bottom": 0.12, "top": 0.94}  # of the figure
ENLARGED = 520  # pixels: smaller pictures are enlarged up to this
WIDEST = 1040  # pixels: of larger pictures the means of blocks are shown
GAP, BAR, FRAME = 18, 20, 6  # pixels: between picture and scale, width of the scale, around all
EXTENDS = {(False, False): "neither", (True, False): "min", (False, True): "max", (True, True): "both"}
BESIDE = 1.2  # points: from where ticks begin, so that they touch no pixel of the picture
ROUNDING = 1e-9  # of the scale: what lies less beyond it does not count


def png_bytes(figure: Figure) -> bytes:
    """Return a figure as PNG, and close it."""
    figure.set_dpi(DPI)
    canvas = cast("FigureCanvasAgg", figure.canvas)
    canvas.draw()
    pixels = np.ascontiguousarray(np.asarray(canvas.buffer_rgba())[..., :3])  # nothing is transparent
    plt.close(figure)
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "png", compress_level=COMPRESSION, dpi=(DPI, DPI))
    return buffer.getvalue()


def new_figure() -> tuple[Figure, Axes]:
    """Return a figure with room for labels; a constrained layout would cost as much as the drawing."""
    figure, axes = plt.subplots(figsize=SIZE)
    figure.subplots_adjust(**ROOM)
    return figure, axes


def new_panels(count: int, size: tuple[float, float] = SIZE) -> tuple[Figure, list[Axes]]:
    """Return a figure with so many panels side by side, each of a size in inches."""
    width, height = size
    figure, axes = plt.subplots(
        1, count, figsize=(count * width, height), layout="constrained", squeeze=False
    )
    return figure, list(axes[0])


def block(shape: tuple[int, ...]) -> int:
    """Return how many pixels in each direction a picture of this shape shows as one."""
    return -(-max(shape) // WIDEST)


def plane_figure(
    data: Floats,
    half_width: tuple[float, float],
    unit: str,
    label: str,
    colours: str,
    limits: tuple[float, float],
    mirrored: bool = False,
) -> bytes:
    """Return an image over a rectangle as a picture with axes and a scale.

    A pixel of the image takes the same whole number of pixels of the figure everywhere.  Large images are
    shown as means of blocks, see `block`.

    data : (rows, columns), row 0 at +y.  half_width : in x and y.  limits : of the scale.
    mirrored : x goes to the left.
    """
    side = block(data.shape)
    pitch = [2 * h / n for h, n in zip(half_width, data.shape[::-1])]
    shown = block_means(data, side)
    rows, columns = shown.shape
    across, down = _enlargement((columns, rows), pitch[0] / pitch[1])
    (hx, hy), (px, py) = half_width, pitch
    figure, axes = plt.subplots(dpi=DPI)
    image = axes.imshow(
        shown,
        cmap=colours,
        vmin=limits[0],
        vmax=limits[1],
        extent=(-hx, columns * side * px - hx, hy - rows * side * py, hy),
        interpolation="nearest",
        aspect="auto",
    )
    if mirrored:
        axes.invert_xaxis()
    axes.spines[:].set_visible(False)  # the frame is drawn by `_place`
    axes.spines[:].set_position(("outward", BESIDE))
    axes.set(xlabel=f"x / {unit}", ylabel=f"y / {unit}")
    slack = ROUNDING * (limits[1] - limits[0])
    beyond = bool(data.min() < limits[0] - slack), bool(data.max() > limits[1] + slack)
    scale = figure.add_axes((0.9, 0.1, 0.05, 0.8))
    figure.colorbar(image, cax=scale, label=label, extend=EXTENDS[beyond])
    _place(figure, axes, scale, (across * columns, down * rows))
    return png_bytes(figure)


def _enlargement(pixels: tuple[int, int], aspect: float) -> tuple[int, int]:
    """Return by which whole numbers columns and rows are enlarged, at most to ENLARGED.

    The shape comes first, to 3 %, then the size.

    pixels : (columns, rows).  aspect : width / height of a pixel.
    """
    choices = [range(1, max(1, ENLARGED // n) + 1) for n in pixels]
    return max(
        ((across, down) for across in choices[0] for down in choices[1]),
        key=lambda n: (-round(abs(log(n[0] / n[1] / aspect)) / 0.03), n[0] * n[1]),
    )


def _place(figure: Figure, axes: Axes, scale: Axes, picture: tuple[int, int]) -> None:
    """Give the picture its size in pixels, and the figure the room that the labels need."""
    width, height = picture

    def resize(across: int, down: int) -> None:
        figure.set_size_inches((across + 0.1) / DPI, (down + 0.1) / DPI)  # rounded down by the canvas

    def put(left: float, bottom: float) -> None:
        whole = figure.get_size_inches() * DPI
        for part, start, wide in ((axes, left, width), (scale, left + width + GAP, BAR)):
            part.set_position((start / whole[0], bottom / whole[1], wide / whole[0], height / whole[1]))

    resize(width + 400, height + 200)
    put(100, 100)
    boxes = [part.get_tightbbox() for part in (axes, scale)]
    left, bottom = (int(100 - min(getattr(b, side) for b in boxes)) + FRAME for side in ("x0", "y0"))
    right, top = (int(max(getattr(b, side) for b in boxes)) + FRAME for side in ("x1", "y1"))
    resize(right - 100 + left, top - 100 + bottom)
    put(left, bottom)
    # a frame beside the pixels and not over them: a dark rectangle behind the picture, one pixel wider
    frame = Rectangle((left - 1, bottom - 1), width + 2, height + 2, facecolor="0.2", lw=0, zorder=-1)
    frame.set_transform(IdentityTransform())
    frame.set_antialiased(False)
    figure.add_artist(frame)
