"""Pictures of a tool on a lens: where it is tight, how its cusps blur, how hard it moves (matplotlib)."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from optics.reporting.figures.canvas import new_panels, png_bytes
from optics.tolerancing.machining import CuspBlur, CuspLight, SpiralMotion, SurfaceFindings, ToolFindings
from thbcad.checks import Floats
from thbcad.tools import concavity, round_axis, tool_acceleration

POINTS = 256  # of maps, in each direction; even: none on the axis
BINS = 96  # of the map of blur, in each direction: several rays each
THIN = 8  # of 1024 gaps beside each side every eighth is drawn: finer than pixels
SIZE = (4.6, 4.0)  # inches, of a panel


def figures_of_tool(findings: ToolFindings) -> list[tuple[str, str, bytes]]:
    """Return (name of the file, caption, PNG) for every surface that a tool was tried on."""
    return [_surface_figure(findings, surface) for surface in findings.surfaces]


def _surface_figure(findings: ToolFindings, surface: SurfaceFindings) -> tuple[str, str, bytes]:
    order, motion, blur = findings.order, surface.motion, surface.blur
    pitch = surface.pitch if blur is not None else None
    light = surface.light
    figure, axes = new_panels(1 + sum(part is not None for part in (pitch, light, motion)), SIZE)
    panels = iter(axes)
    _tightness(figure, next(panels), surface, order.spiral)
    sentences = ["Tool radius times concave curvature, which 1 must not exceed"]
    if blur is not None and pitch is not None:
        _blur(figure, next(panels), surface, blur, pitch)
        sentences.append("width of the blur that its cusps make, in pixels")
    if light is not None:
        _picture(figure, next(panels), light)
        sentences.append("the picture with the cusps")
    if motion is not None:
        _acceleration(figure, next(panels), surface, motion)
        sentences.append("acceleration over the square of the angular speed, beside the lens too")
    caption = f"{order.words} on the {surface.name}. {'; '.join(sentences)}. Rings show the worst positions."
    return f"tool_{surface.name}.png", caption, png_bytes(figure)


def _tightness(figure: Figure, axes: Axes, surface: SurfaceFindings, spiral: bool) -> None:
    x, y = _grid(surface)
    tight = surface.fit.tool * concavity(surface.graph, x.ravel(), y.ravel(), spiral).reshape(x.shape)
    least = surface.fit.least
    worst = (least.u, least.v) if np.isfinite(least.value) else None
    _map(figure, axes, surface, tight, ("RdBu_r", 0.0, 2.0), worst)
    axes.contour(x[0], y[:, 0], tight, [1.0], colors="k", linewidths=0.6)
    axes.set_title("tool radius x concave curvature", fontsize=10)


def _blur(figure: Figure, axes: Axes, surface: SurfaceFindings, blur: CuspBlur, pitch: float) -> None:
    """Draw the greatest blur of the rays in every bin."""
    known = np.isfinite(blur.pixels)
    column, row = (
        np.minimum(((a[known] + kv.stop) * (BINS / (2 * kv.stop))).astype(int), BINS - 1)
        for a, kv in zip((blur.x, blur.y), (surface.graph.kv_u, surface.graph.kv_v))
    )
    image = np.full((BINS, BINS), np.nan)
    np.fmax.at(image, (row, column), pitch * blur.pixels[known])
    _, x, y = blur.worst()
    _map(figure, axes, surface, image, ("viridis", 0.0, None), (x, y), "pixels")
    axes.set_title("blur by cusps", fontsize=10)


def _picture(figure: Figure, axes: Axes, light: CuspLight) -> None:
    shown = axes.imshow(light.picture, "gray", vmin=0)
    figure.colorbar(shown, ax=axes, label="irradiance / mean", shrink=0.8)
    axes.set_title(f"light with cusps: rel_l2 {light.with_cusps:.3g}", fontsize=10)
    axes.set_axis_off()


def _acceleration(figure: Figure, axes: Axes, surface: SurfaceFindings, motion: SpiralMotion) -> None:
    x, y = _grid(surface)
    at = round_axis(surface.graph, x.ravel(), y.ravel())
    over = tool_acceleration(at, surface.fit.tool, motion.cut.advance).reshape(x.shape)
    gaps = motion.gaps
    limit = max(float(over.max()), float(gaps.kernel.max()) if gaps else 0.0)
    _map(figure, axes, surface, over, ("magma", 0.0, limit), (motion.kernel.u, motion.kernel.v))
    if gaps is not None:
        for side in np.split(np.arange(len(gaps.x)), 4):
            x, y, kernel = (a[side[::THIN]] for a in (gaps.x, gaps.y, gaps.kernel))
            axes.pcolormesh(x, y, kernel, shading="gouraud", cmap="magma", vmin=0, vmax=limit)
        _, u, v = gaps.worst()
        axes.plot([u], [v], "o", mfc="none", mec="tab:orange", ms=9)
    reach = 1.03 * motion.cut.radius
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach))
    axes.set_title("|z''| / omega^2 in mm", fontsize=10)


def _grid(surface: SurfaceFindings) -> tuple[Floats, Floats]:
    hx, hy = surface.graph.kv_u.stop, surface.graph.kv_v.stop
    x, y = np.meshgrid(np.linspace(-hx, hx, POINTS), np.linspace(-hy, hy, POINTS))
    return x, y


def _map(
    figure: Figure,
    axes: Axes,
    surface: SurfaceFindings,
    image: Floats,
    scale: tuple[str, float, float | None],
    worst: tuple[float, float] | None,
    unit: str = "",
) -> None:
    """Draw a map over a surface, row 0 at -y, with its scale and a ring round the worst position."""
    hx, hy = surface.graph.kv_u.stop, surface.graph.kv_v.stop
    colours, low, high = scale
    shown = axes.imshow(image, colours, vmin=low, vmax=high, origin="lower", extent=(-hx, hx, -hy, hy))
    figure.colorbar(shown, ax=axes, label=unit, shrink=0.8)
    if worst is not None:
        axes.plot(*([a] for a in worst), "o", mfc="none", mec="tab:red", ms=11, mew=1.5, clip_on=False)
    axes.set(xlabel="x / mm", ylabel="y / mm")
