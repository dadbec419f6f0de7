"""How bright and how even light is: the numbers that lighting engineers ask for, and sentences of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from optics.photometry import BEAM, FIELD, plane_curves, uniformity

if TYPE_CHECKING:
    from optics.photometry import Density, Units
    from optics.system import OpticalSystem
    from optics.target import Screen

KILO = 1000  # lumens, to which cd/klm refers

Floats = NDArray[np.float64]


def photometric_metrics(
    system: OpticalSystem, screen: Screen, irradiance: Floats, error: Floats
) -> dict[str, Any]:
    """Return the mean light on a target plane or the beam of a far field, and the uniformity of lit pixels.

    A picture has no uniformity.

    irradiance, error : as of a Measurement, and as standard deviations, (rows, columns).
    """
    density = system.density
    if system.target.far_field:
        found: dict[str, Any] = {"beam": _beam(system, screen, irradiance)}
    else:
        found = {f"target_mean_{density.suffix}": density.factor * float(irradiance.mean())}
    lit = system.target.lit_pixels
    even = None if lit is None else uniformity(irradiance, lit)
    if lit is None or even is None:
        return found
    found["uniformity"] = {
        "min_over_mean": even.min_over_mean,
        "min_over_max": even.min_over_max,
        "noise": float(np.sqrt(np.square(error[lit]).mean())) / even.mean,
        f"lit_mean_{density.suffix}": density.factor * even.mean,
        "lit_pixels": int(lit.sum()),
        f"pixel_{'degrees' if screen.angular else 'mm'}": list(screen.pitch),
    }
    return found


def _beam(system: OpticalSystem, screen: Screen, intensity: Floats) -> dict[str, float | None]:
    """Return peak intensity, beam angle and field angle, see `PlaneCurve.width`."""
    density, units = system.density, system.units
    peak = density.factor * float(intensity.max())
    found: dict[str, float | None] = {f"peak_{density.suffix}": peak}
    if units.luminous:
        found["peak_cd_per_klm"] = KILO * peak / system.problem.source.flux
    curves = plane_curves(intensity, *screen.centres)
    for angle, share in (("beam_angle", BEAM), ("field_angle", FIELD)):
        for plane, curve in curves.items():
            found[f"{angle}_{plane.partition('-')[0].lower()}"] = curve.width(share)
    return found


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
    if even := metrics.get("uniformity"):
        lines.append(_uniformity_line(even, units.density("pixel_degrees" in even)))
    return lines


def _uniformity_line(even: dict[str, Any], density: Density) -> str:
    unit = "degrees" if "pixel_degrees" in even else "mm"
    across, down = even[f"pixel_{unit}"]
    symbol = "I" if unit == "degrees" else "E"
    return (
        f"uniformity {symbol}_min/{symbol}_mean {even['min_over_mean']:.3f}, "
        f"{symbol}_min/{symbol}_max {even['min_over_max']:.3f}, "
        f"mean {even[f'lit_mean_{density.suffix}']:.4g} {density.shown} "
        f"on {even['lit_pixels']} lit pixels of {across:.3g} x {down:.3g} {unit}; "
        f"the noise of a pixel is {100 * even['noise']:.1g} % and lowers {symbol}_min"
    )


def _angle(width: float | None) -> str:
    """Return a width in words."""
    return "beyond the target" if width is None else f"{width:.3g} degrees"
