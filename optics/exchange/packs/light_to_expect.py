"""The light of a result for other programs: rays with their landing points, and what these rays make."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np

from optics.light.analysis import rel_l2
from optics.light.outgoing import outgoing_rays
from optics.light.tracing import Tracer
from optics.scene.ray_files import RaySet, ray_bytes
from optics.scene.receivers import Screen
from optics.scene.sources import Rays
from optics.scene.system import OpticalSystem
from thbcad.checks import Floats
from thbcad.lens import Lens

LISTED, MANY = (100, 100), (1000, 1000)  # rays of the table, and of the files
ASIDE = 0.1  # of a pixel, by which landing points of another program may be off
SINGLE = 1e-6  # relative: sums in single precision
U0_NEAR = 0.05  # of the boxes of a grid, with as many rays as their noise needs


@dataclass(frozen=True)
class Quantity:
    """A number to compare.

    value : by the lens.  by_rays : by the rays of the pack; None where they tell
        nothing.  within : how near another program shall come, to by_rays where that is known.
    """

    name: str
    unit: str
    value: float
    by_rays: float | None
    within: float


class Landed(NamedTuple):
    """Where rays land.  points : (n, 2) of the receiver's chart.  direction : (3, n).  flux : (n,), 0 of lost
    ones."""

    points: Floats
    direction: Floats
    flux: Floats


def landed(system: OpticalSystem, lens: Lens, rays: Rays) -> Landed:
    """Return where rays land that go through a lens."""
    backend, receiver = system.backend, system.target.receiver
    with backend.dr.suspend_grad():
        _, landing = Tracer(backend, system.path(lens), rays).trace()
        values = [landing.x, landing.y, landing.p, landing.q, landing.flux]
        backend.dr.eval(values)
    u, v, p, q, flux = (a.numpy() for a in values)
    own = np.stack([p, q, np.sqrt(np.maximum(1 - p * p - q * q, 0.0))])
    return Landed(np.column_stack([u, v]), receiver.pose.directions(own), flux)


def ray_table(system: OpticalSystem, lens: Lens) -> bytes:
    """Return a CSV of about 1e4 rays: where they start, and where they land; lost ones do nowhere."""
    rays, unit = _source_rays(system, lens, LISTED), system.target.receiver.unit
    land, flux = landed(system, lens, rays), system.units.flux
    head = ["x_mm", "y_mm", "z_mm", "l", "m", "n", f"flux_{flux}"]
    head += [f"landing_u_{unit}", f"landing_v_{unit}", "landing_l", "landing_m", "landing_n"]
    head.append(f"landing_flux_{flux}")
    behind = np.column_stack([land.points, land.direction.T, land.flux])
    lines = [",".join(head)]
    for start, end in zip(np.column_stack([rays.origin.T, rays.direction.T, rays.flux]), behind):
        there = [*end] if end[-1] > 0 else [""] * len(end)
        lines.append(",".join(n if n == "" else f"{n:.17g}" for n in (*start, *there)))
    return ("\n".join(lines) + "\n").encode()


def ray_files(system: OpticalSystem, lens: Lens, suffix: str) -> tuple[dict[str, bytes], RaySet]:
    """Return about 1e6 rays before the lens and as many behind it as files, and those before it.

    suffix : of a ray file.

    Raises UserError : rays that the format cannot hold.
    """
    rays = _source_rays(system, lens, MANY)
    unit: Literal["W", "lm"] = "lm" if system.units.luminous else "W"
    wavelength = np.full(rays.flux.size, system.problem.source.wavelength, np.float32)
    position, direction, flux = (a.T.astype(np.float32) for a in (rays.origin, rays.direction, rays.flux))
    before = RaySet(position, direction, flux, unit, wavelength)
    behind = outgoing_rays(system, lens, system.backend, MANY[0] * MANY[1], "rear")
    sets = {"source": before, "behind": behind}
    return {f"rays_{name}{suffix}": ray_bytes(held, suffix) for name, held in sets.items()}, before


def light_quantities(
    system: OpticalSystem, lens: Lens, rays: RaySet, light: Mapping[str, Floats], metrics: Mapping[str, Any]
) -> list[Quantity]:
    """Return the numbers to compare: of the lens, and of the rays as their file holds them.

    `within` is what changes where all landing points are off by a tenth of a pixel along u or v.

    light : irradiance and target of the result, (rows, columns).  metrics : of the result.
    """
    position, direction, flux = (a.T.astype(np.float64) for a in (rays.position, rays.direction, rays.flux))
    direction /= np.linalg.norm(direction, axis=0)  # rounded to single precision
    land = landed(system, lens, Rays(position, direction, flux))
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


def _source_rays(system: OpticalSystem, lens: Lens, counts: tuple[int, int]) -> Rays:
    """Return rays of the source one by one."""
    rays = system.source.rays(counts)
    return rays if isinstance(rays, Rays) else rays.rays(system.path(lens).before)


def _numbers(screen: Screen, points: Floats, flux: Floats, target: Floats) -> Floats:
    """Return the flux on the screen, rel_l2, and the greatest light per area, of rays in box pixels."""
    light = screen.binned(points, flux) / (screen.pixel_area * screen.projection())
    on_screen = float(screen.binned(points, flux).sum())
    return np.array([on_screen, rel_l2(light, target), light.max()])
