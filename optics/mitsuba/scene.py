"""A problem as a Mitsuba scene: emitter, closed lens, diffuse screen, pinhole camera (thesis 5.2.2).

The irradiance of a screen of reflectance r is E = pi L / r, with the radiance L that the camera sees.  The
screen is nearly black, so that light which it throws back on the lens does not come again; r cancels.

Everything that light can do in the scene is measured: it passes the edges, is reflected in the lens, or
misses the lens and meets the screen all the same.
"""

from __future__ import annotations

from math import atan2, cos, degrees, pi, radians, tan
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from optics.mitsuba.loading import current_mitsuba
from optics.mitsuba.mesh import LensMesh
from optics.runtime import UserError

if TYPE_CHECKING:
    from optics.problem import Problem, Source
    from optics.sources import Profile
    from optics.system import OpticalSystem

REFLECTANCE = 2.0**-7  # of the screen
FIELD = 40.0  # degrees, of the camera, where the lens leaves room
NEAREST = 0.9  # of the distance from the screen to the lens: the camera is not farther away
DEPTH = 16  # most vertices of a light path
TEXTURE = 512  # columns and rows of a source's density, where it is no picture
FLAT = 1e-6  # relative difference of a pixel's sides


def mitsuba_scene(system: OpticalSystem, mesh: LensMesh) -> Any:
    """Return the Mitsuba scene, mi.Scene, of a problem and its lens; lengths in mm, fluxes in W.

    Its objects are "source", "front", "rear", "edges", "screen", "sensor" and "integrator" (a particle
    tracer); `mesh.update` moves the lens.

    Raises
    ------
    UserError : a target in the far field, pixels that are not square, a point source of another intensity
        than a uniform one.
    """
    problem = system.problem
    if system.target.far_field:
        raise UserError("Mitsuba's screen is a plane: target.distance must be finite, got inf")
    mi = current_mitsuba()
    glass = mi.load_dict({"type": "dielectric", "int_ior": mesh.lens.index, "ext_ior": 1.0})
    heights = [surface.jet()[0] for surface in mesh.surfaces.values()]
    lowest, highest = float(heights[0].min()), float(np.concatenate(heights).max())
    return mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "ptracer", "max_depth": DEPTH},
            "source": _emitter(mi, system, lowest),
            **mesh.shapes(mi, bsdf=glass),
            "screen": _screen(mi, problem),
            "sensor": _camera(mi, problem, highest),
        }
    )


def camera_irradiance(scene: Any, spp: int, seed: int = 0) -> NDArray[np.float64]:
    """Return the irradiance of the screen, (rows, columns) W/mm^2, row 0 at +y, column 0 at -x.

    scene : of `mitsuba_scene`.  spp : light paths per pixel.  The camera looks along +z and sees +x on its
        left.

    Raises
    ------
    UserError : another variant than a mono one, in which spectra would scale the flux.
    """
    mi = current_mitsuba()
    if mi.variant() != "llvm_ad_mono":
        raise UserError(
            f"the camera measures W/mm^2 in the variant llvm_ad_mono only, got {mi.variant()}; "
            "call load_mitsuba first"
        )
    picture = np.array(mi.render(scene, spp=spp, seed=seed), dtype=np.float64)[..., 0]
    return pi / REFLECTANCE * picture[:, ::-1]


def _emitter(mi: ModuleType, system: OpticalSystem, lowest: float) -> dict[str, Any]:
    """Return the source.

    lowest : z of the lowest point of the front, before which parallel light starts, mm.
    """
    source = system.problem.source
    if source.kind == "point":
        return _point(source)
    if source.kind == "lambertian" and source.half_angle < 90:
        raise UserError(
            "Mitsuba's glowing areas light the whole half-space: source.half_angle must be 90, got "
            f"{source.half_angle:g}"
        )
    collimated = source.kind == "collimated"
    z = lowest - source.distance if collimated else -source.distance
    (hx, hy), disk = source.half_width, source.profile == "round"
    area = pi * hx * hy if disk else 4 * hx * hy
    radiance = source.flux / (area if collimated else pi * area)
    return {
        "type": "disk" if disk else "rectangle",
        "to_world": mi.ScalarTransform4f().translate([0, 0, z]).scale([hx, hy, 1]),
        "bsdf": {"type": "null"},
        "emitter": {
            "type": "directionalarea" if collimated else "area",
            "radiance": _radiance(mi, system.source.profile, radiance),
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


def _point(source: Source) -> dict[str, Any]:
    if source.exponent:
        raise UserError(
            f"Mitsuba's points light their cone uniformly: source.exponent must be 0, got {source.exponent:g}"
        )
    intensity = {"type": "uniform", "value": source.flux / (2 * pi * (1 - cos(radians(source.half_angle))))}
    position = [0.0, 0.0, -source.distance]
    if source.half_angle == 90:  # light that goes back meets nothing
        return {"type": "point", "position": position, "intensity": intensity}
    cone = {"cutoff_angle": source.half_angle, "beam_width": source.half_angle}
    towards = current_mitsuba().ScalarTransform4f().look_at(origin=position, target=[0, 0, 0], up=[0, 1, 0])
    return {"type": "spot", "to_world": towards, "intensity": intensity, **cone}


def _screen(mi: ModuleType, problem: Problem) -> dict[str, Any]:
    hx, hy = problem.target.half_width
    plane = mi.ScalarTransform4f().translate([0, 0, problem.target_z])
    return {
        "type": "rectangle",
        "to_world": plane.rotate([0, 1, 0], 180).scale([hx, hy, 1]),
        "bsdf": {"type": "diffuse", "reflectance": {"type": "uniform", "value": REFLECTANCE}},
    }


def _camera(mi: ModuleType, problem: Problem, highest: float) -> dict[str, Any]:
    """Return a pinhole camera between the lens and the screen that sees just the screen.

    highest : z of the lens's highest point, mm.
    """
    (hx, hy), (columns, rows) = problem.target.half_width, problem.target.pixels
    if abs(hx * rows / (hy * columns) - 1) > FLAT:
        raise UserError(
            "the camera's pixels are square: target.pixels must be in proportion to target.half_width, "
            f"got {columns} x {rows} pixels on {hx:g} x {hy:g} mm"
        )
    away = min(max(hx, hy) / tan(radians(FIELD / 2)), NEAREST * (problem.target_z - highest))
    view = {"origin": [0, 0, problem.target_z - away], "target": [0, 0, problem.target_z], "up": [0, 1, 0]}
    return {
        "type": "perspective",
        "fov": 2 * degrees(atan2(hx, away)),
        "fov_axis": "x",
        "near_clip": 1e-3 * away,
        "far_clip": 10 * (away + hx + hy),
        "to_world": mi.ScalarTransform4f().look_at(**view),
        "film": {
            "type": "hdrfilm",
            "width": columns,
            "height": rows,
            "pixel_format": "luminance",
            "rfilter": {"type": "box"},
        },
    }
