"""Pictures of the studies: small PNG files of matplotlib figures, and rows of pictures."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import matplotlib
import numpy as np
from numpy.typing import NDArray
from PIL import Image

matplotlib.use("Agg")
from matplotlib import pyplot as plt
from matplotlib.collections import PatchCollection
from matplotlib.colors import LightSource
from matplotlib.patches import Rectangle

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]

DPI = 90
COLOURS = 256  # of a picture: half of the bytes of true colour


def png(figure: Figure) -> bytes:
    """Return a figure as PNG with few colours, and close it."""
    buffer = io.BytesIO()
    figure.savefig(buffer, dpi=DPI, format="png")
    plt.close(figure)
    return few_colours(buffer.getvalue())


def few_colours(data: bytes, scale: float = 1.0) -> bytes:
    """Return a PNG with few colours, and smaller by a factor."""
    image, small = Image.open(io.BytesIO(data)).convert("RGB"), io.BytesIO()
    width, height = (round(scale * n) for n in image.size)
    image.resize((width, height)).quantize(COLOURS).save(small, "png", optimize=True)
    return small.getvalue()


def panels(rows: int, columns: int, size: float = 2.2) -> tuple[Figure, NDArray[Any]]:
    """Return a figure with rows x columns square axes without ticks, and the axes, (rows, columns)."""
    figure, axes = plt.subplots(
        rows, columns, figsize=(size * columns, (size + 0.25) * rows), layout="constrained", squeeze=False
    )
    for ax in axes.ravel():
        ax.set(xticks=[], yticks=[])
    return figure, axes


def irradiance(ax: Axes, image: Floats, title: str, power: float = 1.0, top: float | None = None) -> None:
    """Draw an irradiance over its mean, to a power (0.2 shows stray light); row 0 is at +y."""
    scaled = np.maximum(image / image.mean(), 0) ** power
    ax.imshow(scaled, cmap="gray" if power == 1 else "magma", vmin=0, vmax=top)
    ax.set_title(title, fontsize=8)


def relief(ax: Axes, heights: Floats, title: str) -> None:
    """Draw heights (nx, ny) as a relief in slanted light; titles name their scale."""
    span = float(np.ptp(heights)) or 1.0
    shade = LightSource(azdeg=315, altdeg=40).shade(
        heights.T, plt.get_cmap("gist_earth"), blend_mode="soft", vert_exag=0.3 * len(heights) / span
    )
    ax.imshow(shade, origin="lower")
    ax.set_title(title, fontsize=8)


def mesh(ax: Axes, boxes: Floats, levels: Sequence[int], title: str) -> None:
    """Draw leaf cells, darker by level.  boxes : (n, 4), columns u0, u1, v0, v1."""
    patches = [Rectangle((u0, v0), u1 - u0, v1 - v0) for u0, u1, v0, v1 in boxes]
    cells = PatchCollection(patches, edgecolor="0.25", linewidth=0.2, cmap="Blues", clim=(-0.5, 6))
    cells.set_array(np.asarray(levels))
    ax.add_collection(cells)
    low, high = boxes.min(0), boxes.max(0)
    ax.set(xlim=(low[0], high[1]), ylim=(low[2], high[3]), aspect="equal")
    ax.set_title(title, fontsize=8)


def curves(figsize: tuple[float, float] = (7.0, 4.2)) -> tuple[Figure, Axes]:
    """Return a figure with one pair of axes and a grid, for curves."""
    figure, ax = plt.subplots(figsize=figsize, layout="constrained")
    ax.grid(which="both", alpha=0.25)
    return figure, ax


def curve_row(columns: int, size: float = 4.0) -> tuple[Figure, NDArray[Any]]:
    """Return a figure with axes side by side, each with a grid, for curves; the axes are (columns,)."""
    figure, axes = plt.subplots(
        1, columns, figsize=(size * columns, 3.6), layout="constrained", squeeze=False
    )
    for ax in axes[0]:
        ax.grid(which="both", alpha=0.25)
    return figure, axes[0]
