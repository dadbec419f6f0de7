"""Where the light of a finished lens goes: by fate in sequence, with all reflections, and in phase space."""

from __future__ import annotations

from functools import reduce
from operator import add, or_
from typing import Any

import numpy as np

from optics.base.runtime import Backend
from optics.light.analysis.closed_lens_light import NEGLIGIBLE, ROULETTE
from optics.light.analysis.light_estimate import Light, LightEstimate
from optics.light.analysis.light_of_rays import traced_parts
from optics.light.analysis.light_of_wavelengths import light_of_plate
from optics.light.analysis.phase_space import PhaseSpace, at_target, jacobian_determinants, source_points
from optics.light.analysis.photometric_metrics import passing_share
from optics.light.measuring import Splat
from optics.light.tracing import (
    RayPath,
    SequentialFates,
    TargetArea,
    trace_nonsequential,
    trace_paths,
)
from optics.scene.paths import LightPath
from optics.scene.receivers import BoxWindow, Screen, receiver_at
from optics.scene.sources import Rays, single_rays
from optics.scene.system import System
from thbcad.checks import Floats

RAYS_AT_ONCE = 1 << 21
NONSEQUENTIAL_RAYS = (256, 256)
SAMPLES = (33, 33)  # rays whose neighbours are traced for the conservation of etendue
LINES = 201  # of the grid in the sections of phase space, in each direction
WIDEST = 0.98  # of the sine of the source's half-angle: where the grid ends; of that angle, where fans do
FAN = 8  # rays
CROSSTALK = 3  # stream of random numbers, other than those of the other traces
CROSSTALK_RAYS, REPLICATES = (64, 64), 4


def sequential(system: System, backend: Backend, rays: int) -> tuple[Floats, SequentialFates, dict[str, int]]:
    """Trace rays x rays rays and measure them with box pixels: so many of each lens of a plate, at every
    wavelength.

    Returns (irradiance (rows, columns), flux by fate, rays by fate).
    """
    screen, counts = system.target.screen(), list[dict[str, int]]()
    splat = Splat(backend, screen, BoxWindow())

    def traced(
        system: System, path: LightPath, screen: Screen, backend: Backend
    ) -> tuple[LightEstimate, SequentialFates]:
        image, fates = np.zeros(screen.pixels[0] * screen.pixels[1]), list[SequentialFates]()
        parts = system.source.parts((rays, rays), None, RAYS_AT_ONCE)
        fresh = np.random.default_rng(system.problem.run.seed)
        for tracer, landing in traced_parts(path, system.slope_rms, parts, fresh, backend):
            image = image + splat(landing.x, landing.y, landing.flux).numpy()
            fates.append(tracer.fates(landing, screen.half_width))
            counts.append(tracer.counts(landing, screen.half_width))
        every, irradiance = reduce(add, fates), image.reshape(screen.shape, order="F")
        return LightEstimate.exact(Light.of([irradiance], every.on_target, every.off_target)), every

    light = light_of_plate(system, system.shaded_path, screen, backend, traced)
    numbers = {name: sum(c.get(name, 0) for c in counts) for name in reduce(or_, counts)}
    return light.estimate.irradiance, light.fates, numbers


def sequential_metrics(system: System, fates: SequentialFates, counts: dict[str, int]) -> dict[str, Any]:
    """Return the metrics of a trace by `sequential`, by name."""
    return {
        "rays": sum(counts.values()),
        "counts": counts,
        system.units.key("fates"): fates.by_name,
        "efficiency": fates.on_target / system.problem.flux,
        **passing_share(system.path),
    }


def nonsequential(system: System, backend: Backend) -> dict[str, Any]:
    """Return the fates of the light in the closed lens.

    `by_other_ways` is the fraction of the light on the target, through the lens, that did not pass front and
    rear once each.
    """
    rays = system.own_rays(system.source.rays(NONSEQUENTIAL_RAYS))
    hx, hy = half_width = system.target.settings.half_width
    plane = TargetArea.of(system.own_path, half_width)
    result = trace_nonsequential(
        backend,
        system.solid,
        rays,
        plane,
    )
    landings = result.landings
    onto = (np.abs(landings.x) <= hx) & (np.abs(landings.y) <= hy)
    total, direct = result.fates.onto, float(landings.flux[onto & result.direct].sum())
    other = 1 - direct / total if total else 0.0
    return {
        system.units.key("fates"): result.fates.by_name,
        "by_other_ways": other,
        "sequential_suffices": other <= NEGLIGIBLE,
    }


def crosstalk(system: System, backend: Backend) -> dict[str, float]:
    """Return the light of the source in the middle of a plate that other lenses take on, of its flux.

    All its ways through the whole plate are traced, to a plane behind it: `crosstalk` goes forward and last
    left the glass by the front or the rear of a neighbour, `by_plate_edges` by walls and land.  Light that
    goes back counts in neither; what a neighbour reflects from outside counts where it left the glass.

    backend : of double precision.
    """
    lens = system.designed
    plane = TargetArea.of(system.path.onto(receiver_at(plane_behind(system))), lens.rear.half_width)
    rng, solid, found = np.random.default_rng((system.problem.run.seed, CROSSTALK)), system.made, []
    for _ in range(REPLICATES):
        rays = single_rays(system.source.rays(CROSSTALK_RAYS, rng), lens)
        every = trace_nonsequential(backend, solid, rays, plane, threshold=ROULETTE, roulette=rng).fates
        edges = every.edges_on_target + every.edges_off_target
        found.append(np.array([every.crosstalk, edges]) / system.problem.flux)
    (neighbours, edges), error = np.mean(found, axis=0), np.std(found, axis=0, ddof=1)[0]
    return {
        "crosstalk": float(neighbours),
        "crosstalk_error": float(error / np.sqrt(REPLICATES)),
        "by_plate_edges": float(edges),
    }


def crosstalk_line(metrics: dict[str, Any]) -> list[str]:
    """Return what is printed of `crosstalk`; nothing of a lens alone."""
    if "crosstalk" not in metrics:
        return []
    share, error = (100 * metrics[name] for name in ("crosstalk", "crosstalk_error"))
    return [
        f"crosstalk {share:.3g} +- {error:.1g} %: light of the source in the middle that goes forward and "
        "last left the glass by a neighbour's front or rear; by walls and land "
        f"{metrics['by_plate_edges']:.2%}"
    ]


def conservation(system: System, backend: Backend) -> dict[str, float]:
    """Return how far the determinant of the map from source to target in phase space is from 1.

    `rays` counts those that arrive, over which `median` and `most` are taken.
    """
    lens = system.designed
    rays, source = single_rays(system.source.rays(SAMPLES), lens), system.problem.source
    size = max(source.half_width) or source.distance
    determinants = jacobian_determinants(
        backend,
        lens,
        source_points(rays),
        (size, size, 0.1, 0.1),
        float(rays.origin[2, 0]),
        plane_behind(system),
    )
    off = np.abs(determinants[np.isfinite(determinants)] - 1)
    return {
        "rays": int(off.size),
        "median": float(np.median(off)) if off.size else 0.0,
        "most": float(off.max(initial=0.0)),
    }


def plane_behind(system: System) -> float:
    """Return z of a target plane across the axis; else that of a plane one thickness behind the lens, mm."""
    return float(system.target.receiver.pose.shift[2]) if _across(system) else 2 * system.designed.thickness


def _across(system: System) -> bool:
    """Return whether the target is a plane across the axis."""
    return system.axial and not system.target.far_field


def sections(system: System, backend: Backend) -> dict[str, tuple[PhaseSpace, float]]:
    """Return rays of the source with x = 0 and p = 0 in phase space, by the name of a plane.

    With them comes the greatest |y| to show there, mm.
    """
    lens = system.designed
    source, collimated, target = system.problem.source, system.source.collimated, system.target
    behind = 2 * lens.thickness
    size = source.half_width[1] or 1.0
    y = np.linspace(-1, 1, LINES) * source.half_width[1]
    q = np.linspace(-1, 1, LINES) * WIDEST * np.sin(np.radians(system.source.cone))
    points = np.zeros((4, LINES * LINES))
    points[1], points[3] = (a.ravel() for a in np.meshgrid(y, q))
    start = -source.distance - (max(lens.front.half_width) if collimated else 0.0)
    planes = {
        "source": (PhaseSpace(points, np.ones(points.shape[1])), 1.1 * size),
        f"behind the lens, z = {behind:g} mm": (
            at_target(backend, lens, points, start, behind),
            1.5 * lens.rear.half_width[1],
        ),
    }
    if _across(system):
        planes["target"] = (
            at_target(backend, lens, points, start, plane_behind(system)),
            1.1 * target.settings.half_width[1],
        )
    return planes


def fans(system: System, backend: Backend) -> dict[str, list[RayPath]]:
    """Return the paths of two fans of rays from the source's centre in the plane x = 0.

    One has equal steps of the angle, the other of its sine.
    """
    source = system.problem.source
    widest = np.radians(source.half_angle) * WIDEST
    solid = system.solid
    area, out = TargetArea.of(system.path, system.target.settings.half_width), {}
    for name, sine in (
        ("equal angles", np.sin(np.linspace(-widest, widest, FAN))),
        ("equal steps of the sine", np.linspace(-1, 1, FAN) * np.sin(widest)),
    ):
        origin, direction = np.zeros((2, 3, FAN))
        origin[2] = -source.distance
        direction[1], direction[2] = sine, np.sqrt(1 - sine**2)
        out[name] = trace_paths(backend, solid, Rays(origin, direction, np.ones(FAN)), area)
    return out
