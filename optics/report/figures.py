"""The pictures of a report (matplotlib)."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, cast

import matplotlib
import numpy as np
from numpy.typing import NDArray
from PIL import Image

matplotlib.use("Agg")
from matplotlib import pyplot as plt
from matplotlib.collections import PathCollection
from matplotlib.path import Path
from matplotlib.ticker import LogLocator, NullFormatter

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    from optics.analysis import Measurement
    from optics.optimisation import Row
    from optics.system import OpticalSystem
    from optics.tracing import RayPath
    from thbcad.hierarchy import THBSpace
    from thbcad.lens import FreeformSurface, Lens

    Figures = dict[str, tuple[str, bytes]]  # (caption, PNG) by name, in the order of the report

DPI, SIZE = 110, (5.2, 4.4)
COMPRESSION = 3  # of 9: half the time of the usual 6 for 9 % more bytes
LABELLED = (1, 2, 3, 4, 6)  # times powers of ten, of a logarithmic axis
ROOM = {"left": 0.17, "right": 0.95, "bottom": 0.12, "top": 0.94}  # of the figure


def light_figures(
    system: OpticalSystem,
    lens: Lens,
    measurement: Measurement,
    paths: Mapping[str, Sequence[RayPath]],
) -> Figures:
    """Return the figures of what a lens delivers, and of rays through it.

    paths : fans of rays in the plane x = 0 by name, or none.
    """
    mean = measurement.target.mean()
    target, irradiance = measurement.target / mean, measurement.irradiance / mean
    top = float(target.max())
    error = irradiance - target
    span = float(np.quantile(np.abs(error), 0.999)) or 1.0
    quantity, unit = ("intensity", "degrees") if system.path.far_field else ("irradiance", "mm")
    label = f"{quantity} / mean"

    def picture(data: NDArray[np.float64], text: str, colours: str, low: float, high: float) -> bytes:
        return plane_figure(data, system.target.settings.half_width, unit, text, colours, (low, high))

    return {
        "target": ("The light asked for.", picture(target, label, "gray", 0, top)),
        "irradiance": (
            "The light that the lens makes (fresh rays, box pixels).",
            picture(irradiance, label, "gray", 0, top),
        ),
        "error": ("Made minus asked for.", picture(error, label, "RdBu_r", -span, span)),
        "irradiance_02": (
            f"{quantity.capitalize()} to the power 0.2: stray light and faint detail.",
            picture(np.maximum(irradiance, 0) ** 0.2, f"({label})^0.2", "magma", 0, top**0.2),
        ),
        **{
            f"rays_{k}": (f"Rays in the plane x = 0, {name}; green ones reach the target.", _rays(lens, fan))
            for k, (name, fan) in enumerate(paths.items(), 1)
        },
    }


def lens_figures(lens: Lens, history: Sequence[Row]) -> Figures:
    """Return the figures of the free surfaces, those of the front named for it, and of the optimisation."""
    caption = "Misfit ||E - T|| / ||T|| as the optimiser measures it; a line marks each refinement."
    return {**_surfaces(lens), "loss": (caption, _loss(history))}


def _extent(half_width: tuple[float, float]) -> tuple[float, float, float, float]:
    hx, hy = half_width
    return (-hx, hx, -hy, hy)


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


def _axes(unit: str = "mm") -> tuple[Figure, Axes]:
    figure, axes = new_figure()
    axes.set_xlabel(f"x / {unit}")
    axes.set_ylabel(f"y / {unit}")
    return figure, axes


def plane_figure(
    data: NDArray[np.float64],
    half_width: tuple[float, float],
    unit: str,
    label: str,
    colours: str,
    limits: tuple[float, float],
) -> bytes:
    """Return an image over a rectangle as a picture with axes and a scale."""
    figure, axes = _axes(unit)
    shown = axes.imshow(
        data,
        cmap=colours,
        vmin=limits[0],
        vmax=limits[1],
        extent=_extent(half_width),
        interpolation="nearest",
    )
    figure.colorbar(shown, label=label)
    return png_bytes(figure)


def _surfaces(lens: Lens) -> dict[str, tuple[str, bytes]]:
    """Return sag and mesh of the free surfaces."""
    out = {}
    for prefix, name, surface in (("", "rear", lens.rear), ("front_", "front", lens.front)):
        if surface.sag is not None:
            out[f"{prefix}sag"] = (f"Sag of the {name} surface, added to its conic.", _sag(surface))
            out[f"{prefix}mesh"] = (
                f"Hierarchical mesh of the {name} surface: leaf cells by level.",
                _mesh(surface.sag.space, surface.half_width),
            )
    return out


def _sag(surface: FreeformSurface) -> bytes:
    x, y = (np.linspace(-h, h, 401) for h in surface.half_width)
    sag = surface.grid(x, y) - surface.conic(x[:, None], y[None, :])
    figure, axes = _axes()
    shown = axes.imshow(sag.T[::-1], cmap="viridis", extent=_extent(surface.half_width))
    figure.colorbar(shown, label="sag / mm")
    return png_bytes(figure)


def _mesh(space: THBSpace, half_width: tuple[float, float]) -> bytes:
    (hx, hy), cells = half_width, space.cells
    (x0, x1), (y0, y1) = (
        h * (2 * (space.boxes.T[2 * d : 2 * d + 2] - kv.start) / (kv.stop - kv.start) - 1)
        for d, (h, kv) in enumerate(((hx, space.kv_u), (hy, space.kv_v)))
    )
    corners = np.stack([x0, y0, x1, y0, x1, y1, x0, y1], 1).reshape(-1, 4, 2)
    figure, axes = _axes()
    # one path per level, which is much faster than one per cell
    levels = np.unique(cells[:, 0])
    paths = [Path.make_compound_path_from_polys(corners[cells[:, 0] == level]) for level in levels]
    colours = plt.get_cmap("viridis")(levels / max(1, space.levels - 1))
    lines = PathCollection(paths, facecolors="none", edgecolors=colours, linewidths=0.3)
    lines.set_snap(True)
    axes.add_collection(lines)
    axes.set_xlim(-hx, hx)
    axes.set_ylim(-hy, hy)
    axes.set_aspect("equal")
    axes.set_title(
        f"{space.dim} degrees of freedom, {len(cells)} cells, levels 0-{space.levels - 1}", fontsize=9
    )
    return png_bytes(figure)


def _rays(lens: Lens, fan: Sequence[RayPath]) -> bytes:
    """Return a section of the lens with the strongest branch of every ray."""
    figure, axes = new_figure()
    outline = []
    for surface, vertex, direction in ((lens.front, 0.0, 1), (lens.rear, lens.thickness, -1)):
        y = np.linspace(-1, 1, 201)[::direction] * surface.half_width[1]
        outline.append(np.stack([vertex + surface(np.zeros_like(y), y), y], axis=1))
    section = np.concatenate(outline)
    axes.fill(*section.T, facecolor="0.92", edgecolor="0.3", lw=1)
    low, high = (
        f(np.concatenate([section] + [path.points[:1, [2, 1]] for path in fan]), axis=0)
        for f in (np.min, np.max)
    )
    margin = 0.4 * (high - low).max()
    for path in fan:
        axes.plot(
            path.points[:, 2],
            path.points[:, 1],
            lw=0.8,
            color="tab:green" if path.fate.endswith("on_target") else "tab:red",
        )
    axes.set_xlim(low[0] - margin, high[0] + margin)
    axes.set_ylim(low[1] - margin, high[1] + margin)
    axes.set_aspect("equal")
    axes.set_xlabel("z / mm")
    axes.set_ylabel("y / mm")
    return png_bytes(figure)


def _loss(history: Sequence[Row]) -> bytes:
    figure, axes = new_figure()
    numbers = np.array([(r.evaluation, r.fit, r.level) for r in history])
    if len(numbers):
        axes.semilogy(numbers[:, 0], numbers[:, 1], lw=1.2)
        for start in np.nonzero(np.diff(numbers[:, 2]))[0]:
            axes.axvline(numbers[start, 0] + 0.5, color="0.8", lw=0.8, zorder=0)
        # plain numbers: the setting of powers of ten takes longer than all else in the picture
        axes.yaxis.set_major_locator(LogLocator(subs=LABELLED))
        axes.yaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set_xlabel("evaluations of loss and gradient")
    axes.set_ylabel("||E - T|| / ||T||")
    axes.grid(alpha=0.3, which="both")
    return png_bytes(figure)
