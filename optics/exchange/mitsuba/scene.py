"""A problem as a Mitsuba scene: emitter, closed lens, diffuse screen, pinhole camera (thesis 5.2.2).

The irradiance of a screen of reflectance r is E = pi L / r, with the radiance L that the camera sees.  The
screen is nearly black, so that light which it throws back on the lens does not come again; r cancels.

Everything that light can do in the scene is measured: it passes the edges, is reflected in the lens, or
misses the lens and meets the screen all the same.
"""

from __future__ import annotations

from math import atan2, cos, degrees, pi, radians, tan
from types import ModuleType
from typing import Any

import numpy as np

from optics.base.runtime import UserError
from optics.exchange.mitsuba.loading import MONO, current_mitsuba
from optics.exchange.mitsuba.mesh import LensMesh
from optics.scene.receivers import Screen
from optics.scene.sources import CollimatedBeam, LambertianArea, PointSource, Profile
from optics.scene.system import OpticalSystem
from thbcad.checks import Floats
from thbcad.lens import Lens

FIELD = 40.0  # degrees, of the camera, where the lens leaves room
NEAREST = 0.9  # of the distance from the screen to the lens: the camera is not farther away
WIDE = (640, 480)  # pixels of the camera that sees lens and screen
FLAT = 1e-6  # relative difference of a pixel's sides
REFLECTANCE = 2.0**-7  # of the screen
VERTICES = (449, 449)
BLACK = {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.0}}  # on both sides
DEPTH = 16  # most vertices of a light path
TEXTURE = 512  # columns and rows of a source's density, where it is no picture


def square_pixels(screen: Screen) -> None:
    """Check that pixels are square, as a camera's are.

    Raises UserError : they are not.
    """
    (hx, hy), (columns, rows) = screen.half_width, screen.pixels
    if abs(hx * rows / (hy * columns) - 1) > FLAT:
        raise UserError(
            "the camera's pixels are square: target.pixels must be in proportion to target.half_width, "
            f"got {columns} x {rows} pixels on {hx:g} x {hy:g} mm"
        )


def screen_rectangle(mi: ModuleType, screen: Screen, z: float, reflectance: float) -> dict[str, Any]:
    """Return the screen at z mm, which faces the lens."""
    hx, hy = screen.half_width
    plane = mi.ScalarTransform4f().translate([0, 0, z])
    return {
        "type": "rectangle",
        "to_world": plane.rotate([0, 1, 0], 180).scale([hx, hy, 1]),
        "bsdf": {"type": "diffuse", "reflectance": {"type": "uniform", "value": reflectance}},
    }


def watching_camera(
    mi: ModuleType, screen: Screen, z: float, highest: float, sigma: float = 0.0
) -> dict[str, Any]:
    """Return a pinhole camera between the lens and the screen that sees just the screen.

    highest : z of the lens's highest point, mm.
    sigma : pixels, of the Gaussian in which the film measures; 0 is a film of box pixels.
    """
    (hx, hy), (columns, rows) = screen.half_width, screen.pixels
    away = min(max(hx, hy) / tan(radians(FIELD / 2)), NEAREST * (z - highest))
    view = {"origin": [0, 0, z - away], "target": [0, 0, z], "up": [0, 1, 0]}
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
            "rfilter": {"type": "gaussian", "stddev": sigma} if sigma else {"type": "box"},
        },
    }


def overview_camera(mi: ModuleType, screen: Screen, z: float, lens: Lens) -> dict[str, Any]:
    """Return a pinhole camera behind the source that looks past the lens at the whole screen.

    The lens stands dark before a quarter of the screen: paths from the source end in a camera from matt
    surfaces alone, and glass is none.
    """
    (hx, hy), middle = screen.half_width, lens.thickness / 2
    behind = np.array([hx / 2, -hy / 2, z])  # the point of the screen that the middle of the lens covers
    size = max(hx, hy, *lens.rear.half_width)
    away = z - middle + 2 * size / tan(radians(FIELD / 2))
    origin = behind + (np.array([0.0, 0.0, middle]) - behind) * (away / (z - middle))
    view = {"origin": origin.tolist(), "target": [0, 0, z], "up": [0, 1, 0]}
    return {
        "type": "perspective",
        "fov": FIELD,
        "fov_axis": "smaller",
        "near_clip": 1e-3 * away,
        "far_clip": 10 * (away + hx + hy),
        "to_world": mi.ScalarTransform4f().look_at(**view),
        "film": {
            "type": "hdrfilm",
            "width": WIDE[0],
            "height": WIDE[1],
            "pixel_format": "luminance",
            "rfilter": {"type": "box"},
        },
    }


def mitsuba_scene(system: OpticalSystem, mesh: LensMesh) -> Any:
    """Return the Mitsuba scene, mi.Scene, of a problem and its lens; lengths in mm, fluxes in W.

    `mesh.update` moves the lens.

    Raises UserError : as `scene_dictionary`.
    """
    return current_mitsuba().load_dict(scene_dictionary(system, mesh))


def scene_dictionary(
    system: OpticalSystem, lens: Lens | LensMesh, screen: Screen | None = None, sigma: float = 0.0
) -> dict[str, Any]:
    """Return a problem and its lens as a dictionary for mi.load_dict; lengths in mm, fluxes in W.

    Its objects are "source", "front", "rear", "edges", "screen", "sensor" and "integrator" (a particle
    tracer).  The camera sees the irradiance E as pi L / REFLECTANCE, mirrored in x: see `camera_irradiance`.

    lens : or its mesh; a lens has one of VERTICES in each direction.
    screen : and its pixels, those of the target where it is left out.
    sigma : pixels, of the Gaussian in which the camera's film measures; 0 is a film of box pixels.

    Raises UserError : a target that is no plane across the axis, pixels that are not square, a point source
        of another intensity than a uniform one, stops or a clear aperture.
    """
    require_open(system)
    if system.target.far_field:
        raise UserError("Mitsuba's screen is a plane: target.distance must be finite, got inf")
    if not system.axial:
        raise UserError(
            "Mitsuba's screen is a plane across the axis, and this target lies "
            f"{system.problem.target.place}; "
            'leave target.tilt and surface out, or take optimizer.engine = "exact" or "mitsuba-mesh"'
        )
    screen, z = screen or system.target.screen(), float(system.target.receiver.pose.shift[2])
    square_pixels(screen)
    mi, mesh = current_mitsuba(), LensMesh.uniform(lens, VERTICES) if isinstance(lens, Lens) else lens
    faces = mesh.shapes(
        mi, bsdf=mi.load_dict({"type": "dielectric", "int_ior": mesh.lens.index, "ext_ior": 1.0})
    )
    if system.problem.optic.wall == "absorbing":
        faces |= mesh.shapes(mi, ["edges"], mi.load_dict(BLACK))
    heights = [surface.jet()[0] for surface in mesh.surfaces.values()]
    lowest, highest = float(heights[0].min()), float(np.concatenate(heights).max())
    return {
        "type": "scene",
        "integrator": {"type": "ptracer", "max_depth": DEPTH},
        "source": _emitter(mi, system, lowest),
        **faces,
        "screen": screen_rectangle(mi, screen, z, REFLECTANCE),
        "sensor": watching_camera(mi, screen, z, highest, sigma),
    }


def require_open(system: OpticalSystem) -> None:
    """Raise UserError where stops or a clear aperture block light, of which meshes know nothing."""
    if system.stops or any(system.problem.optic.clear_aperture):
        raise UserError(
            "scenes and meshes for Mitsuba hold neither [[stop]] nor lens.clear_aperture; leave them out, or "
            'trace with optimizer.engine = "exact" or "mitsuba-exact"'
        )


def camera_irradiance(scene: Any, spp: int, seed: int = 0) -> Floats:
    """Return the irradiance of the screen, (rows, columns) W/mm^2, row 0 at +y, column 0 at -x.

    scene : of `mitsuba_scene`.  spp : light paths per pixel.  The camera looks along +z and sees +x on its
        left.

    Raises UserError : another variant than a mono one, in which spectra would scale the flux.
    """
    mi = current_mitsuba()
    if mi.variant() != MONO:
        raise UserError(
            f"the camera measures W/mm^2 in the variant {MONO} only, got {mi.variant()}; "
            "call load_mitsuba first"
        )
    picture = np.array(mi.render(scene, spp=spp, seed=seed), dtype=np.float64)[..., 0]
    return pi / REFLECTANCE * picture[:, ::-1]


def _emitter(mi: ModuleType, system: OpticalSystem, lowest: float) -> dict[str, Any]:
    """Return the source.

    lowest : z of the lowest point of the front, before which parallel light starts, mm.
    """
    source = system.source
    if isinstance(source, PointSource):
        return _point(source)
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
    radiance = source.flux / (area if source.collimated else pi * area)
    return {
        "type": "disk" if disk else "rectangle",
        "to_world": mi.ScalarTransform4f().translate([0, 0, z]).scale([hx, hy, 1]),
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


def _point(source: PointSource) -> dict[str, Any]:
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
