"""`thbcad road`: what the light of a lens or a luminaire file makes of a road, beside its class."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path

from optics.base.runtime import UserError, check_lines, verification
from optics.interface.commands.light_export import LUMINAIRE_SUFFIXES, traceable, traced_intensity
from optics.interface.commands.outcome import OF_GRADES, Outcome
from optics.interface.screens import road_screen
from optics.light.roads import CLASSES, RANGES, Installation, read_r_table, road_checks, uniformity
from optics.scene.luminaires import Luminaire, read_luminaire

VERDICTS = {
    "made": "is kept",
    "light misses": "is not kept",
    "not decided": "is not decided; take more --rays",
}


def road(options: Namespace) -> Outcome:
    """Judge a road under lamps by EN 13201."""
    chosen = {name: getattr(options, name) for name in (*RANGES, "rows")}
    installation = Installation(**chosen)
    surface = read_r_table(options.r_table) if options.r_table else None
    CLASSES[options.lighting_class].required(surface)
    lamp, parts, noise = _lamp(options)
    checks = road_checks(options.lighting_class, installation, lamp, parts, surface)
    checked, even = verification(checks), uniformity(checks)
    data = {
        "lighting_class": options.lighting_class,
        "installation": asdict(installation),
        "flux_lm": lamp.flux,
        "noise": noise,
        "specular_factor": surface and surface.specular,
        "uniformity": even,
        **checked,
    }
    where = (
        f"lamps {installation.height:g} m high, {installation.spacing:g} m apart, rows: {installation.rows}; "
        f"{installation.lanes} lanes of {installation.lane_width:g} m, "
        f"maintenance {installation.maintenance:g}"
    )
    lines = [
        where,
        f"{lamp.flux:.6g} lm leave each lens or plate, {installation.lenses} in a lamp"
        + (f"; noise {noise:.2%} of the intensity (L2)" if noise else ""),
        *([f"{options.r_table}: specular factor S1 = {surface.specular:.3g}"] if surface else []),
        *check_lines(checked),
        *([f"uniformity U0 of the illuminance, least over mean: {even:.2f}"] if even is not None else []),
        f"class {options.lighting_class} of EN 13201-2:2015 {VERDICTS[checked['grade']]}",
    ]
    screen = road_screen(options.lighting_class, where, checks)
    return Outcome(data, lines, OF_GRADES[checked["grade"]], screen)


def _lamp(options: Namespace) -> tuple[Luminaire, Sequence[Luminaire], float]:
    """Return the intensity in candela, independent estimates of it, and its noise; a file has neither.

    Raises UserError : as `traced_intensity` and `read_luminaire`; light in watts.
    """
    if Path(options.result).suffix.lower() in LUMINAIRE_SUFFIXES:
        return read_luminaire(options.result), (), 0.0
    system = traceable(options)
    if not system.units.luminous:
        raise UserError(
            f"roads are judged in lumens, and the source of {options.result} is in watts; "
            'design with source.unit = "lm" and its lumens as source.flux'
        )
    light = traced_intensity(system, options)
    parts = [replace(light.luminaire, candela=candela) for candela in light.parts]
    return light.luminaire, parts, light.noise
