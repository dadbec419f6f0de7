"""A problem as a Mitsuba scene in mm and W: emitters, bodies, diffuse screen, pinhole camera (thesis 5.2.2).

The irradiance of a screen of reflectance r is E = pi L / r, with the radiance L that the camera sees.  The
screen is nearly black, so that light which it throws back on the lens does not come again; r cancels.

Everything that light can do in the scene is measured: it passes the edges, is reflected in the lens, or
misses the lens and meets the screen all the same.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from math import cos, pi, radians
from types import ModuleType
from typing import Any

import numpy as np

from optics.base.runtime import UserError
from optics.exchange.mitsuba.cameras import placed, screen_rectangle, square_pixels, watching_camera
from optics.exchange.mitsuba.loading import MONO, current_mitsuba
from optics.exchange.mitsuba.mesh import FACES, LensMesh
from optics.scene.problem import LensSpec, MirrorElement
from optics.scene.receivers import Plane, Screen
from optics.scene.sources import (
    CollimatedBeam,
    LambertianArea,
    LightSource,
    PlacedSource,
    PointSource,
    Profile,
)
from optics.scene.system import System, pose_of
from thbcad.checks import Floats
from thbcad.poses import IDENTITY, Pose

REFLECTANCE = 2.0**-7  # of the screen
VERTICES = (449, 449)
BLACK = {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.0}}  # on both sides
DEPTH = 16  # most vertices of a light path
TEXTURE = 512  # columns and rows of a source's density, where it is no picture


def mitsuba_scene(system: System, mesh: LensMesh) -> Any:
    """Return the Mitsuba scene, mi.Scene, of a problem and its lens; lengths in mm, fluxes in W.

    `mesh.update` moves the lens.

    Raises UserError : as `scene_dictionary`.
    """
    return current_mitsuba().load_dict(scene_dictionary(system, mesh))


def scene_dictionary(
    system: System,
    mesh: LensMesh | None = None,
    screen: Screen | None = None,
    sigma: float = 0.0,
    brighter: float = 1.0,
) -> dict[str, Any]:
    """Return a problem and its lens as a dictionary for mi.load_dict; lengths in mm, fluxes in W.

    Its objects are "source", "front", "rear", "edges", "screen", "sensor" and "integrator" (a particle
    tracer); of several sources "source_1", "source_2"; of elements "L1_front" and so on.  The camera sees the
    irradiance E as pi L / REFLECTANCE, mirrored in x: see `camera_irradiance`.

    mesh : of the designed lens; left out, one of VERTICES in each direction.
    screen : and its pixels, those of the target where it is left out.
    sigma : pixels, of the Gaussian in which the camera's film measures; 0 is a film of box pixels.
    brighter : factor of the source's flux.

    Raises UserError : a target that is no plane, pixels that are not square, a point source of another
        intensity than a uniform one, stops, a clear aperture or coatings.
    """
    require_open(system)
    if coated(system) or any(system.slope_rms):  # Mitsuba's glass is neither
        raise UserError(
            "scenes for Mitsuba hold smooth faces, and lenses without coatings: leave slope_rms and the "
            "reflectance of lenses out"
        )
    receiver = system.target.receiver
    if receiver.far_field:
        raise UserError("Mitsuba's screen is a plane: target.distance must be finite, got inf")
    if not isinstance(receiver, Plane):
        raise UserError('Mitsuba\'s screen is a plane: target.surface must be "plane"')
    screen, mi = screen or system.target.screen(), current_mitsuba()
    square_pixels(screen)
    meshes = body_meshes(system, mesh)
    surfaces = face_surfaces(system, meshes)
    shapes: dict[str, Any] = {}
    for body, face in product(meshes, FACES):
        shapes |= body.shapes(mi, [face], mi.load_dict(surfaces[body.named(face)]))
    points = np.concatenate([body.points for body in meshes], axis=1)
    lowest = 0.0 if system.problem.element else float(meshes[0].surfaces["front"].jet()[0].min())
    return {
        "type": "scene",
        "integrator": {"type": "ptracer", "max_depth": DEPTH},
        **emitters(mi, system.source, lowest, brighter),
        **shapes,
        "screen": screen_rectangle(mi, screen, receiver.pose, REFLECTANCE),
        "sensor": watching_camera(mi, screen, receiver.pose, points, sigma),
    }


def body_meshes(system: System, mesh: LensMesh | None = None) -> list[LensMesh]:
    """Return the meshes of all elements in the order of the problem, where they lie, with their names.

    mesh : as of `scene_dictionary`.
    """
    own = mesh or LensMesh.uniform(system.designed, VERTICES)
    if not system.problem.element:
        return [own]
    others = {optic.called: LensMesh.uniform(blank, VERTICES) for optic, blank in system.others}
    return [
        replace(others.get(optic.called, own), pose=pose_of(optic), called=optic.called)
        for optic in system.problem.optics
    ]


def face_surfaces(system: System, meshes: Sequence[LensMesh]) -> dict[str, dict[str, Any]]:
    """Return by the names of faces what they do with light: they are glass, a mirror, or black."""
    found: dict[str, dict[str, Any]] = {}
    for optic, mesh in zip(system.problem.optics, meshes):
        glass: dict[str, Any] = {"type": "dielectric", "int_ior": mesh.lens.index, "ext_ior": 1.0}
        faces = {face: glass for face in FACES}
        if optic.wall == "absorbing":
            faces["edges"] = BLACK
        if isinstance(optic, MirrorElement):
            share = {"type": "uniform", "value": float(optic.share)}
            mirror = {"type": "conductor", "material": "none", "specular_reflectance": share}
            faces |= {"front": mirror, "rear": BLACK}
        found |= {mesh.named(face): surface for face, surface in faces.items()}
    return found


def require_open(system: System) -> None:
    """Raise UserError where stops or a clear aperture block light, of which meshes know nothing."""
    if system.stops or any(any(optic.clear_aperture) for optic in system.problem.optics):
        raise UserError(
            "scenes and meshes for Mitsuba hold neither [[stop]] nor lens.clear_aperture; leave them out, or "
            'trace with optimizer.engine = "exact" or "mitsuba-exact"'
        )


def absorbs(system: System) -> bool:
    """Return whether light is absorbed on its way in glass, of which scenes and meshes know nothing."""
    return any(medium.absorption for medium in system.unshaped.path.media)


def coated(system: System) -> bool:
    """Return whether the faces of a lens are coated."""
    return any(isinstance(optic, LensSpec) and optic.coats != (None, None) for optic in system.problem.optics)


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
