"""What another program shall find: rays with their landing points, numbers of the part and its light."""

import io
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any, Literal

import numpy as np

from optics.base.runtime import Check
from optics.exchange.verification import exact_landing
from optics.light.analysis import rel_l2
from optics.light.outgoing import outgoing_rays
from optics.scene.ray_files import RaySet, ray_bytes
from optics.scene.receivers import Screen
from optics.scene.sources import Rays
from optics.scene.system import System
from thbcad.checks import Floats
from thbcad.io import points_text
from thbcad.lens import ALLOWANCE, DenseGrid, Lens, dense_grid

LISTED, MANY = (100, 100), (1000, 1000)  # rays of the table, and of the files
PLACES = 0.0, 0.5  # of the half-widths, at which heights are compared
HEIGHT_NEAR, VOLUME_NEAR = 1e-4, 1e-6  # mm; relative
ASIDE = 0.1  # of a pixel, by which landing points of another program may be off
SINGLE = 1e-6  # relative: sums in single precision
U0_NEAR = 0.05  # of the boxes of a grid, with as many rays as their noise needs
LINEAR, CUBIC = 1e-3, 1e-6  # mm
POINTS, SLOPES = 1e-10, 1e-9  # mm, and of slopes: conics are splines within 1e-11 mm


@dataclass(frozen=True)
class Quantity:
    """A number to compare.

    value : by the lens.  by_rays : by the rays of the pack; None where they tell nothing.
    within : how near another program shall come, to by_rays where that is known.
    """

    name: str
    unit: str
    value: float
    by_rays: float | None
    within: float


def table_text(rows: Iterable[Quantity]) -> bytes:
    """Return the table to fill in, CSV."""
    lines = ["quantity,unit,of the lens,by the rays of this pack,within,found"]
    for r in rows:
        by_rays = "" if r.by_rays is None else f"{r.by_rays:.9g}"
        lines.append(f"{r.name},{r.unit},{r.value:.9g},{by_rays},{r.within:.3g},")
    return ("\n".join(lines) + "\n").encode()


def part_quantities(system: System) -> list[Quantity]:
    """Return what a program that holds the part may measure of it."""
    volume = system.made.volume()
    rows = [Quantity("volume", "mm^3", volume, None, VOLUME_NEAR * volume)]
    for (word, surface, vertex), *shares in product(system.designed.faces, PLACES, PLACES):
        x, y = (share * h for share, h in zip(shares, surface.half_width))
        z = vertex + float(surface(x, y))
        rows.append(Quantity(f"z of the {word} at x = {x:g}; y = {y:g}", "mm", z, None, HEIGHT_NEAR))
    return rows


def ray_table(system: System) -> bytes:
    """Return a CSV of about 1e4 rays: where they start and land, NaN where they do not."""
    rays, unit, flux = _source_rays(system, LISTED), system.target.receiver.unit, system.units.flux
    land, text = exact_landing(system.path, rays, system.backend), io.BytesIO()
    head = f"x_mm,y_mm,z_mm,l,m,n,flux_{flux},landing_u_{unit},landing_v_{unit},landing_flux_{flux}"
    columns = np.column_stack([rays.origin.T, rays.direction.T, rays.flux, land.points, land.flux])
    np.savetxt(text, columns, "%.17g", ",", header=head, comments="")
    return text.getvalue()


def ray_files(system: System, suffix: str) -> tuple[dict[str, bytes], RaySet]:
    """Return about 1e6 rays before the lens and as many behind it as files, and those before it.

    suffix : of a ray file.
    """
    rays = _source_rays(system, MANY)
    unit: Literal["W", "lm"] = "lm" if system.units.luminous else "W"
    wavelength = np.full(rays.flux.size, system.problem.source.wavelength, np.float32)
    position, direction, flux = (a.T.astype(np.float32) for a in (rays.origin, rays.direction, rays.flux))
    before = RaySet(position, direction, flux, unit, wavelength)
    behind = outgoing_rays(system, system.backend, MANY[0] * MANY[1], "rear")
    sets = {"source": before, "behind": behind}
    return {f"rays_{name}{suffix}": ray_bytes(held, suffix) for name, held in sets.items()}, before


def light_quantities(
    system: System, rays: RaySet, light: Mapping[str, Floats], metrics: Mapping[str, Any]
) -> list[Quantity]:
    """Return the numbers of the light: of the lens, and of the rays as their file holds them.

    `within` is what changes where all landing points are off by a tenth of a pixel along u or v.

    light : irradiance and target of the result, (rows, columns).  metrics : of the result.
    """
    position, direction, flux = (a.T.astype(np.float64) for a in (rays.position, rays.direction, rays.flux))
    direction /= np.linalg.norm(direction, axis=0)  # rounded to single precision
    land = exact_landing(system.path, Rays(position, direction, flux), system.backend)
    screen, density = system.target.screen(), system.density
    scale = np.array([1 / system.problem.flux, 1.0, density.factor])
    here, *aside = (
        scale * _numbers(screen, land.points + np.multiply(screen.pitch, step), land.flux, light["target"])
        for step in ((0.0, 0.0), (ASIDE, 0.0), (-ASIDE, 0.0), (0.0, ASIDE), (0.0, -ASIDE))
    )
    within = np.abs(np.subtract(aside, here)).max(axis=0) + SINGLE * here
    peak = density.factor * float(light["irradiance"].max())
    names = ("efficiency", ""), ("rel_l2", ""), (f"peak {density.quantity}", density.shown)
    values = metrics["efficiency"], metrics["rel_l2"], peak
    rows = [
        Quantity(*name, float(value), float(by_rays), float(near))
        for name, value, by_rays, near in zip(names, values, here, within)
    ]
    even = metrics.get("uniformity", {}).get("min_over_mean")
    return rows if even is None else [*rows, Quantity("U0", "", even, None, U0_NEAR)]


def _source_rays(system: System, counts: tuple[int, int]) -> Rays:
    """Return rays of the source one by one."""
    return system.source.rays(counts).rays(system.path.before)


def _numbers(screen: Screen, points: Floats, flux: Floats, target: Floats) -> Floats:
    """Return the flux on the screen, rel_l2, and the greatest light per area, of rays in box pixels."""
    sums = screen.binned(points, flux)
    light = sums / (screen.pixel_area * screen.projection())
    return np.array([sums.sum(), rel_l2(light, target), light.max()])


def dense_points(lens: Lens) -> tuple[dict[str, bytes], list[Check], dict[str, DenseGrid]]:
    """Return the files of front and rear, what the bounds and the files read back say, and the grids."""
    files, checks, grids = {}, [], {}
    for (word, surface, vertex), graph in zip(lens.faces, lens.own_graphs()):
        grid = dense_grid(graph, LINEAR - ALLOWANCE, CUBIC - ALLOWANCE)
        text = points_text(graph, vertex, word == "rear", grid.x, grid.y)
        files[f"points_{word}.xyz"], grids[word] = text, grid
        x, y, z, *normal = np.loadtxt(io.BytesIO(text)).T.reshape(6, len(grid.x), len(grid.y))
        off = z - vertex - surface.grid(x[:, 0], y[0])
        turned = (n / normal[2] + surface.grid(grid.x, grid.y, o) for n, o in zip(normal, ((1, 0), (0, 1))))
        by = "XYZ read back by numpy"
        checks += [
            Check(f"{word} points, {by}", float(np.abs(off).max()), POINTS, "mm"),
            Check(f"{word} slopes, {by}", max(float(np.abs(t).max()) for t in turned), SLOPES, ""),
            Check(f"{word} points, linear between them, bound", grid.linear + ALLOWANCE, LINEAR, "mm"),
            Check(f"{word} points, cubic between them, bound", grid.cubic + ALLOWANCE, CUBIC, "mm"),
        ]
    return files, checks, grids
