"""The pictures of a report (matplotlib)."""

from collections.abc import Mapping, Sequence
from itertools import groupby

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.path import Path
from matplotlib.ticker import LogLocator, NullFormatter

from optics.designing.optimisation import Row, Stage
from optics.light.analysis import Measurement, counted_ways, fringe, unit_mean
from optics.light.tracing import RayPath
from optics.reporting.figures.canvas import block, new_figure, plane_figure, plt, png_bytes
from optics.reporting.figures.intensity_diagrams import intensity_figures
from optics.reporting.figures.overview import cell_corners, relative_light
from optics.reporting.figures.scene_figure import LENS
from optics.reporting.view import block_means, within_foot
from optics.scene.photometry import srgb
from optics.scene.system import System
from thbcad.checks import Floats
from thbcad.hierarchy import THBSpace
from thbcad.lens import FreeformSurface, Lens
from thbcad.moulds import Solid, lens_of
from thbcad.outlines import Outline

Figures = dict[str, tuple[str, bytes]]  # (caption, PNG) by name, in the order of the report

LABELLED = (1, 2, 3, 4, 6)  # times powers of ten, of a logarithmic axis
DARK = 0.75  # of the colours, from which on they are too light for thin lines
SAMPLES = 400  # of a sag, along the longer side
MOST = 0.995  # quantile of the fringe at which its scale ends
LEAST_SCALE = 1e-3  # in (u', v'): a tenth of what an eye sees between two fields
MIRRORED = "Seen from the side of the light, where the picture reads right: x goes to the left."


def light_figures(
    system: System, measurement: Measurement, paths: Mapping[str, Sequence[RayPath]]
) -> Figures:
    """Return the figures of what a lens delivers, and of rays through it.

    paths : fans of rays in the plane x = 0 by name, or none.
    """
    target, irradiance, error, span = relative_light(measurement)
    mean, top = measurement.target.mean(), float(target.max())
    density, unit, word = system.density, system.target.unit, system.problem.optic.noun
    quantity = density.quantity
    label, side = f"{quantity} / mean", block(target.shape)
    merged = f" Every pixel of the figures is the mean of {side} x {side}." if side > 1 else ""
    seen = f" {MIRRORED}" if system.target.mirrored else ""

    def picture(data: Floats, text: str, colours: str, low: float, high: float) -> bytes:
        half_width, mirrored = system.target.settings.half_width, system.target.mirrored
        return plane_figure(data, half_width, unit, text, colours, (low, high), mirrored)

    figures = {
        "target": (
            f"The light asked for; its mean is {density.text(mean)}.{merged}{seen}",
            picture(target, label, "gray", 0, top),
        ),
        "irradiance": (
            f"The light that the {word} makes ({counted_ways(measurement.metrics)}; fresh rays, box pixels), "
            f"on the scale of the light asked for.{seen}",
            picture(irradiance, label, "gray", 0, top),
        ),
        "error": (
            f"Made minus asked for; the greatest difference is {np.abs(error).max():.3g} of the mean.",
            picture(error, f"difference of {quantity} / mean", "RdBu_r", -span, span),
        ),
        "irradiance_02": (
            f"{quantity.capitalize()} to the power 0.2: stray light and faint detail.",
            picture(np.maximum(irradiance, 0) ** 0.2, f"({label})^0.2", "magma", 0, top**0.2),
        ),
    }
    if measurement.sharp is not None:
        sharp = unit_mean(measurement.sharp)
        caption = f"What the {word} would make without divergence of the light and roughness of its surfaces."
        figures["sharp"] = (caption, picture(sharp, label, "gray", 0, top))
    if system.target.far_field:
        screen = system.target.screen()
        figures |= intensity_figures(measurement.irradiance, measurement.target, screen, density)
    solid = system.solid
    return (
        figures
        | colour_figures(system, measurement, unit)
        | {
            f"rays_{k}": (f"Rays in the plane x = 0, {name}; green ones reach the target.", _rays(solid, fan))
            for k, (name, fan) in enumerate(paths.items(), 1)
        }
    )


def lens_figures(
    lens: Lens,
    history: Sequence[Row],
    plan: Sequence[Stage],
    sides: tuple[str, str] = LENS,
    others: Sequence[tuple[str, Lens, tuple[str, str]]] = (),
) -> Figures:
    """Return the figures of the free surfaces, those of the front named for it, and of the optimisation.

    plan : every Stage that the rows of the history name.  sides : what front and rear are called.
    others : further free elements with their names.
    """
    caption = (
        "Misfit ||E - T|| / ||T|| as the optimiser measures it, by stage. A line marks where a stage begins: "
        "the mesh, the pixels or the window change there, and the curve jumps."
    )
    surfaces = _surfaces(lens, sides)
    for called, shape, faces in others:
        surfaces |= _surfaces(shape, faces, called)
    return {**surfaces, "loss": (caption, _loss(history, plan))}


def _surfaces(lens: Lens, sides: tuple[str, str], called: str = "") -> dict[str, tuple[str, bytes]]:
    """Return sag and mesh of the free surfaces.  called : one of several elements."""
    out, (front, rear), of = {}, sides, f" of {called}" if called else ""
    prefixes = (f"{called}_{rear}_", f"{called}_{front}_") if called else ("", f"{front}_")
    for prefix, name, surface in zip(prefixes, (rear, front), (lens.rear, lens.front)):
        if surface.sag is not None:
            out[f"{prefix}sag"] = (f"Sag of the {name} surface{of}, added to its conic.", _sag(surface))
            out[f"{prefix}mesh"] = (
                f"Hierarchical mesh of the {name} surface{of}: leaf cells by level.",
                _mesh(surface.sag.space, surface.outline),
            )
    return out


def _sag(surface: FreeformSurface) -> bytes:
    widest = max(surface.half_width)
    x, y = (
        h * (2 * np.arange(n) + 1 - n) / n
        for h in surface.half_width
        for n in [max(1, round(SAMPLES * h / widest))]
    )
    sag = surface.grid(x, y) - surface.conic(x[:, None], y[None, :])
    sag = np.where(surface.outline.contains(x[:, None], y), sag, np.nan)
    limits = float(np.nanmin(sag)), float(np.nanmax(sag))
    return plane_figure(sag.T[::-1], surface.half_width, "mm", "sag / mm", "viridis", limits)


def _mesh(space: THBSpace, outline: Outline) -> bytes:
    (hx, hy), cells = outline.half_width, space.cells
    corners = cell_corners(space, outline.half_width)
    figure, axes = new_figure()
    # one path per level, which is much faster than one per cell
    levels = np.unique(cells[:, 0])
    paths = [Path.make_compound_path_from_polys(corners[cells[:, 0] == level]) for level in levels]
    colours = plt.get_cmap("viridis")(DARK * levels / max(1, space.levels - 1))
    lines = PathCollection(paths, facecolors="none", edgecolors=colours, linewidths=0.3)
    lines.set_snap(True)
    axes.add_collection(lines)
    if not outline.is_rectangle:
        along = np.linspace(-1, 1, SAMPLES)
        one = np.ones(SAMPLES)
        rim = np.hstack([(along, -one), (one, along), (-along, one), (-one, -along)])
        axes.plot(*outline.filled(hx * rim[0], hy * rim[1]), color="tab:red", lw=0.8)
    axes.set(xlim=(-hx, hx), ylim=(-hy, hy), aspect="equal", xlabel="x / mm", ylabel="y / mm")
    axes.set_title(
        f"{space.dim} degrees of freedom, {len(cells)} cells, levels 0-{space.levels - 1}", fontsize=9
    )
    return png_bytes(figure)


def _rays(solid: Solid, fan: Sequence[RayPath]) -> bytes:
    """Return a section of the lens with the strongest branch of every ray."""
    figure, axes = new_figure()
    draw_fan(axes, solid, fan)
    axes.set(xlabel="z / mm", ylabel="y / mm")
    return png_bytes(figure)


def draw_fan(axes: Axes, solid: Solid, fan: Sequence[RayPath]) -> None:
    """Draw the section x = 0 of a lens or its body and the paths of rays; those to the target are green."""
    lens, outline = lens_of(solid), []
    for number, (_, surface, vertex) in enumerate(lens.faces):
        y = np.linspace(-1, 1, 201)[:: 1 - 2 * number] * surface.half_width[1]
        if not isinstance(solid, Lens):
            _, y = within_foot(solid, number, np.zeros_like(y), y)
        outline.append(np.stack([vertex + surface(np.zeros_like(y), y), y], axis=1))
    edges = [] if isinstance(solid, Lens) else [(z, edge.half_width[1]) for edge, z in solid.level_edges]
    wall = np.reshape(edges, (-1, 2))
    section = np.concatenate([outline[0], wall, outline[1], wall[::-1] * [1, -1]])
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
    axes.set(
        xlim=(low[0] - margin, high[0] + margin), ylim=(low[1] - margin, high[1] + margin), aspect="equal"
    )


def _loss(history: Sequence[Row], plan: Sequence[Stage]) -> bytes:
    figure, axes = new_figure()
    for number, (index, rows) in enumerate(groupby(history, key=lambda row: row.stage)):
        evaluations, fits = np.array([(row.evaluation, row.fit) for row in rows]).T
        columns, lines = plan[index].screen.pixels
        label = f"{plan[index].name}, {columns} x {lines} pixels"
        axes.semilogy(evaluations, fits, ".-", lw=1.2, ms=4, label=label)
        if number:
            axes.axvline(evaluations[0] - 0.5, color="0.6", lw=0.8, ls="--", zorder=0)
    if history:
        # plain numbers: the setting of powers of ten takes longer than all else in the picture
        axes.yaxis.set_major_locator(LogLocator(subs=LABELLED))
        axes.yaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_minor_formatter(NullFormatter())
        axes.legend(fontsize=8)
    axes.set(xlabel="evaluations of loss and gradient", ylabel="||E - T|| / ||T||")
    axes.grid(alpha=0.3, which="both")
    return png_bytes(figure)


def colour_figures(system: System, measurement: Measurement, unit: str) -> dict[str, tuple[str, bytes]]:
    """Return (caption, PNG) of the picture in colour and of the colour fringe, by name.

    Without a spectrum, or where no light is visible, there are none.  unit : of lengths on the target.
    """
    if measurement.colour is None:
        return {}
    source, numbers = system.problem.source, measurement.metrics["colour"]
    half_width = system.target.settings.half_width
    named = source.spectrum if isinstance(source.spectrum, str) else f"{len(system.wavelengths)} wavelengths"
    of_unit_flux = [wavelength.weight * np.array(wavelength.xyz) for wavelength in system.wavelengths]
    white = np.sum(of_unit_flux, axis=0) * measurement.target.max()
    if not white[1]:
        return {}
    distance = fringe(system, measurement.colour)
    seen = distance[np.isfinite(distance)]
    top = max(float(np.quantile(seen, MOST)), LEAST_SCALE) if seen.size else LEAST_SCALE
    return {
        "colour": (
            f"The light of {named} in colour, seen by an eye adapted to it; white is the brightest light "
            "asked for. Colours that sRGB cannot show are mixed with grey.",
            _colour_picture(srgb(measurement.colour, white), half_width, unit),
        ),
        "fringe": (
            "Colour fringe: distance of the chromaticity (u', v') from that of the source. The same ray "
            f"lands {numbers['shift']:.3g} {unit} ({numbers['shift_pixels']:.2g} pixels) apart at "
            f"{numbers['from_nm']:.0f} and {numbers['to_nm']:.0f} nm on average.",
            plane_figure(distance, half_width, unit, "distance in (u', v')", "magma", (0, top)),
        ),
    }


def _colour_picture(picture: Floats, half_width: tuple[float, float], unit: str) -> bytes:
    """Draw an sRGB picture, (3, rows, columns)."""
    (hx, hy), side = half_width, block(picture.shape[1:])
    figure, axes = new_figure()
    shown = block_means(np.moveaxis(picture, 0, -1), side)
    axes.imshow(shown, extent=(-hx, hx, -hy, hy), interpolation="nearest")
    axes.set(xlabel=f"x / {unit}", ylabel=f"y / {unit}")
    return png_bytes(figure)
