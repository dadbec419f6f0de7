"""The sources of a problem as Mitsuba's emitters; fluxes in W."""

from math import cos, pi, radians
from types import ModuleType
from typing import Any

import numpy as np

from optics.base.runtime import UserError
from optics.exchange.mitsuba.cameras import placed
from optics.scene.sources import (
    CollimatedBeam,
    LambertianArea,
    LightSource,
    PlacedSource,
    PointSource,
    Profile,
)
from thbcad.poses import IDENTITY, Pose

TEXTURE = 512  # columns and rows of a source's density, where it is no picture


def emitters(
    mi: ModuleType, source: LightSource, lowest: float, brighter: float
) -> dict[str, dict[str, Any]]:
    """Return the emitters of a source, "source", or of several, "source_1", "source_2" and so on.

    lowest : z from which parallel light along the axis starts, mm, less the distance of its source.
    brighter : factor of their flux.
    """
    if not source.several:
        return {"source": _emitter(mi, source, lowest, brighter)}
    members = enumerate(source.each, 1)
    return {f"source_{k}": _emitter(mi, member, 0.0, brighter) for k, member in members}


def _emitter(mi: ModuleType, source: LightSource, lowest: float, brighter: float) -> dict[str, Any]:
    pose = IDENTITY
    if isinstance(source, PlacedSource):
        pose, source, lowest = source.pose, source.source, 0.0
    if isinstance(source, PointSource):
        return _point(mi, source, pose, brighter)
    if not isinstance(source, CollimatedBeam | LambertianArea):
        raise UserError("Mitsuba has no light of ray and luminaire files; take another source.kind there")
    if not source.from_afar and source.cone < 90:
        raise UserError(
            "Mitsuba's area emitters light the whole half-space: source.half_angle must be 90, got "
            f"{source.cone:g}"
        )
    if source.diverging:
        raise UserError(
            "Mitsuba's beams are parallel: source.divergence must be 0 there, with a profile other than sun"
        )
    z = lowest - source.distance if source.collimated else -source.distance
    (hx, hy), disk = source.half_width, source.shape == "round"
    area = pi * hx * hy if disk else 4 * hx * hy
    radiance = brighter * source.flux / (area if source.collimated else pi * area)
    return {
        "type": "disk" if disk else "rectangle",
        "to_world": placed(mi, pose).translate([0, 0, z]).scale([hx, hy, 1]),
        "bsdf": {"type": "null"},
        "emitter": {
            "type": "directionalarea" if source.collimated else "area",
            "radiance": _radiance(mi, source.profile, radiance),
        },
    }


def _radiance(mi: ModuleType, profile: Profile, mean: float) -> dict[str, Any]:
    """Return the texture of a source's density with the given mean."""
    if profile.kind in ("uniform", "round"):
        return {"type": "uniform", "value": mean}
    rows, columns = (TEXTURE, TEXTURE) if profile.light is None else profile.light.shape
    s, t = ((2 * np.arange(n) + 1) / n - 1 for n in (columns, rows))  # row 0 of a bitmap lies at -y
    density = profile(s[None, :], t[:, None])
    bitmap = mi.Bitmap((mean * density / density.mean())[..., None].astype(np.float32))
    return {"type": "bitmap", "bitmap": bitmap, "raw": True, "filter_type": "nearest"}


def _point(mi: ModuleType, source: PointSource, pose: Pose, brighter: float) -> dict[str, Any]:
    if source.exponent:
        raise UserError(
            f"Mitsuba's points light their cone uniformly: source.exponent must be 0, got {source.exponent:g}"
        )
    flux = brighter * source.flux
    intensity = {"type": "uniform", "value": flux / (2 * pi * (1 - cos(radians(source.half_angle))))}
    position = pose.points(np.array([0.0, 0.0, -source.distance])).tolist()
    if source.half_angle == 90:  # light that goes back meets nothing
        return {"type": "point", "position": position, "intensity": intensity}
    cone = {"cutoff_angle": source.half_angle, "beam_width": source.half_angle}
    view = {"origin": [0, 0, -source.distance], "target": [0, 0, 0], "up": [0, 1, 0]}
    towards = placed(mi, pose) @ mi.ScalarTransform4f().look_at(**view)
    return {"type": "spot", "to_world": towards, "intensity": intensity, **cone}
