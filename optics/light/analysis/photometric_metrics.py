"""How bright and how even light is: the numbers that lighting engineers ask for, and sentences of them."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from itertools import pairwise
from math import isfinite, prod, sqrt
from typing import Any

import numpy as np

from optics.base.runtime import Backend, plain_number
from optics.light.analysis.light_estimate import LightEstimate
from optics.light.tracing import Tracer, normal_incidence_transmittance, polarising
from optics.scene.paths import LightPath
from optics.scene.photometry import BEAM, FIELD, BoxGrid, Density, Uniformity, Units, edge_width, plane_curves
from optics.scene.receivers import FarField, Plane, Screen
from optics.scene.system import System
from thbcad.checks import Floats

KILO = 1000  # lumens, to which cd/klm refers
BOX_POINTS = 4  # in each direction of a box, at which the area of curved receivers is read
RATIOS = "min_over_mean", "min_over_max", "rsd"  # of a Uniformity, with their errors
# rays that tell the change by polarisation, their stream of random numbers, and what is worth a note
POLARISED_RAYS, POLARISED_STREAM, POLARISED = (65, 65), 4, 0.001
JUDGED = *(name + end for name in RATIOS for end in ("", "_error")), "noise", "reason"


def box_screen(system: System) -> Screen | None:
    """Return the boxes on which uniformity is judged, as pixels of a screen; None of other light."""
    return system.target.box_screen(system.problem.verify.grid)


def per_area(light: LightEstimate, screen: Screen, boxes: Screen | None = None) -> LightEstimate:
    """Return light per area of the receiver, in the far field per solid angle.

    light : flux per du dv on a screen's pixels and on the boxes.
    """
    if boxes is None:
        return light.over(screen.projection())
    of_points = boxes.finer(BOX_POINTS).projection()
    areas = of_points.reshape(boxes.shape[0], BOX_POINTS, boxes.shape[1], BOX_POINTS).mean(axis=(1, 3))
    return light.over(screen.projection(), areas)


def photometric_metrics(system: System, screen: Screen, light: LightEstimate, blur: float) -> dict[str, Any]:
    """Return the mean light on a target plane or the beam of a far field, and how uniform even light is.

    light : see `per_area`, on pixels and boxes.  blur : see `optics.light.blur.spot_rms`.
    """
    density = system.density
    if system.target.far_field:
        found: dict[str, Any] = {"beam": beam_metrics(system, screen, light)}
    else:
        mean = float(np.average(light.irradiance, weights=screen.projection()))
        found = {f"target_mean_{density.suffix}": density.factor * mean}
    if system.target.uniform_region is not None:
        found["uniformity"] = uniformity_metrics(system, light, blur)
    return found


def zone_metrics(system: System, screen: Screen, light: LightEstimate) -> dict[str, Any]:
    """Return what the light is in every row of the target's zones, nothing where it has none.

    light : as of `photometric_metrics`, on the screen's pixels.
    """
    target, density, found = system.target, system.density, []
    for row in target.zone_rows(screen):
        reading = row.reading(light.draws.pixels, light.drift.pixels)
        numbers = {name: density.factor * value for name, value in reading._asdict().items()}
        greatest = numbers["greatest"] if isfinite(reading.greatest) else None
        over = reading.margin * reading.limit / reading.error if reading.error else None
        found.append(
            {
                "name": row.name,
                **numbers,
                "greatest": greatest,
                "limit": density.factor * reading.limit,
                "at_least": reading.at_least,
                "margin": reading.margin,
                "margin_in_errors": over,
                "unit": density.shown,
            }
        )
    return {"zones": found} if found else {}


def uniformity_metrics(system: System, light: LightEstimate, blur: float) -> dict[str, Any]:
    """Return how uniform light is on the region of a target that asks for the same everywhere, by name.

    light, blur : as of `photometric_metrics`.
    """
    target, screen, density = system.target, system.target.screen(), system.density
    if target.uniform_region is None or target.lit_pixels is None:
        raise ValueError("only a target that asks for the same light everywhere has a uniformity")
    boxes = BoxGrid(target.uniform_region, system.problem.verify.grid, blur)
    found, irradiance = boxes.uniformity(light.draws.boxes, light.drift.boxes), light.irradiance
    unit = screen.unit
    half_lit = target.light >= target.light.max() / 2
    lit, areas = target.lit_pixels, np.ones(screen.shape) if screen.angular else screen.projection()
    mean = float(np.average(irradiance[lit], weights=areas[lit])) if lit.any() else 0.0
    return {
        **{key: getattr(found, key) for key in JUDGED},
        f"lit_mean_{density.suffix}": density.factor * mean,
        "grid": found.grid,
        f"box_{unit}": list(found.box),
        "boxes": found.boxes,
        "region_left": found.left,
        f"margin_{unit}": found.margin,
        f"blur_rms_{unit}": blur,
        f"edge_width_{unit}": edge_width(irradiance, half_lit, found.mean, screen.pitch),
    }


def uniformity_of_pixels(system: System, image: Floats, screen: Screen, blur: float) -> Uniformity:
    """Return how uniform an image is that is known on pixels alone, as if it were even within each.

    image : per area, (rows, columns) of a screen.  blur : as of `photometric_metrics`.
    """
    region, boxes = system.target.uniform_region, box_screen(system)
    if region is None or boxes is None:
        raise ValueError("only a target that asks for the same light everywhere has a uniformity")
    return BoxGrid(region, boxes.pixels[0], blur).uniformity(boxes.means_of(image, screen)[None])


def beam_metrics(system: System, screen: Screen, light: LightEstimate) -> dict[str, float | None]:
    """Return peak intensity, beam angle and field angle, see `PlaneCurve.width`, and the errors of angles.

    Where light goes on beyond the target, the angle within the target takes the place of the error.

    light : as of `photometric_metrics`.
    """
    density, units = system.density, system.units
    peak = density.factor * float(light.irradiance.max())
    found: dict[str, float | None] = {f"peak_{density.suffix}": peak}
    if units.luminous:
        found["peak_cd_per_klm"] = KILO * peak / system.problem.flux
    for angle, share in (("beam_angle", BEAM), ("field_angle", FIELD)):
        for plane, curve in plane_curves(light.irradiance, *screen.centres).items():
            name = f"{angle}_{plane.partition('-')[0].lower()}"
            found[name] = width = curve.width(share)
            if width is None:
                found[f"{name}_at_least"] = curve.least_width(share)
                continue
            error = light.error_of(partial(_width, screen, plane, share, width))
            if error:
                found[f"{name}_error"] = error
    return found


def _width(screen: Screen, plane: str, share: float, known: float, intensity: Floats) -> float:
    """Return a beam's width in a plane, degrees; one that is known where the intensity has none."""
    width = plane_curves(intensity, *screen.centres)[plane].width(share)
    return known if width is None else width


def photometric_lines(metrics: dict[str, Any], units: Units) -> list[str]:
    """Return a line on the beam and one on the uniformity, where the metrics of a measurement have them."""
    lines = []
    if beam := metrics.get("beam"):
        density = units.in_far_field
        angles = (
            f"{name.replace('_', ' ')} {_angle(beam[f'{name}_c0'])} in C0-C180, "
            f"{_angle(beam[f'{name}_c90'])} in C90-C270"
            for name in ("beam_angle", "field_angle")
        )
        per_klm = f" ({beam['peak_cd_per_klm']:.4g} cd/klm)" if units.luminous else ""
        peak = f"peak intensity {beam[f'peak_{density.suffix}']:.4g} {density.shown}{per_klm}"
        lines.append("; ".join([peak, *angles]))
    if found := metrics.get("uniformity"):
        lines.append(_uniformity_line(found, units.density("box_degrees" in found)))
    return lines


def _uniformity_line(found: dict[str, Any], density: Density) -> str:
    unit = next(unit for unit in (Plane.unit, FarField.unit) if f"box_{unit}" in found)
    symbol = "I" if unit == FarField.unit else "E"
    across, down = found[f"box_{unit}"]
    edge = found[f"edge_width_{unit}"]
    mean = f"mean {found[f'lit_mean_{density.suffix}']:.4g} {density.shown}"
    border = "" if edge is None else f"; edge from 90 to 10 % {plain_number(edge, 3)} {unit} wide"
    if found["min_over_mean"] is None:
        return f"uniformity not known, since {found['reason']}; {mean}{border}"
    return (
        f"uniformity U0 = {symbol}_min/{symbol}_mean {found['min_over_mean']:.3f}, "
        f"{symbol}_min/{symbol}_max {found['min_over_max']:.3f}, rsd {found['rsd']:.3f} "
        f"on {found['boxes']} boxes of {plain_number(across, 3)} x {plain_number(down, 3)} {unit}, "
        f"with a noise of {found['noise']:.1%} at most; {mean}{border}"
    )


def _angle(width: float | None) -> str:
    """Return a width in words."""
    return "beyond the target" if width is None else f"{width:.3g} degrees"


def passing_share(path: LightPath) -> dict[str, float | None]:
    """Return which share of light a mirror, a lens or a row passes on at normal incidence, by its metric."""
    if len(path.surfaces) == 1 and path.surfaces[0].kind == "reflect":
        return {"reflectance": path.surfaces[0].share}
    shares = [surface.share for surface in path.surfaces]
    if shares == [None, None]:
        return {"normal_incidence_transmittance": normal_incidence_transmittance(path.media[1].index)}
    bare = (
        1.0 if surface.kind == "reflect" else sqrt(normal_incidence_transmittance(b.index / a.index))
        for surface, (a, b) in zip(path.surfaces, pairwise(path.media))
    )
    passing = prod(own if share is None else share for own, share in zip(bare, shares))
    lens = [surface.kind for surface in path.surfaces] == ["refract", "refract"]
    return {"coated_transmittance" if lens else "row_transmittance": passing}


def passing_words(metrics: Mapping[str, Any]) -> str:
    """Return how much light could arrive at best, in words."""
    if "reflectance" in metrics:
        return f"the mirror reflects {metrics['reflectance']:.1%}"
    if "coated_transmittance" in metrics:
        return f"front and rear as coated pass {metrics['coated_transmittance']:.1%} at normal incidence"
    if "row_transmittance" in metrics:
        return f"the elements pass {metrics['row_transmittance']:.1%} at normal incidence"
    return f"two uncoated faces at normal incidence pass {metrics['normal_incidence_transmittance']:.1%}"


def polarisation_change(system: System, path: LightPath, backend: Backend) -> dict[str, float]:
    """Return the relative change of the flux on the target, F / F_mean - 1, as `polarisation_change`.

    F_mean is the flux with the mean of s and p at every face, which the optimiser takes.  The dictionary is
    empty where light does not meet two oblique faces of bare glass, or never the target.

    backend : of double precision.
    """
    fresh = np.random.default_rng((system.problem.run.seed, POLARISED_STREAM))
    rays, half_width = system.source.rays(POLARISED_RAYS, fresh), system.target.settings.half_width
    if not polarising(path, rays):
        return {}
    tracers = (Tracer(backend, path, rays, polarised=polarised) for polarised in (True, False))
    flux, mean = (tracer.fates(tracer.landed(), half_width).on_target for tracer in tracers)
    return {"polarisation_change": flux / mean - 1} if mean else {}


def polarisation_note(metrics: dict[str, Any]) -> list[str]:
    """Return a sentence where polarisation changes the light on the target by more than POLARISED."""
    change = metrics.get("polarisation_change", 0.0)
    if abs(change) <= POLARISED:
        return []
    return [
        f"the faces polarise the light: {abs(change):.2%} {'more' if change > 0 else 'less'} of it reaches "
        "the target than with the mean of both polarisations, which the optimiser takes"
    ]
