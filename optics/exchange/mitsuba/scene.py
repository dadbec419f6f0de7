"""A problem as a Mitsuba scene: emitters, closed bodies, diffuse screen, pinhole camera (thesis 5.2.2).

The irradiance of a screen of reflectance r is E = pi L / r, with the radiance L that the camera sees.  The
screen is nearly black, so that light which it throws back on the lens does not come again; r cancels.

Everything that light can do in the scene is measured: it passes the edges, is reflected in the lens, or
misses the lens and meets the screen all the same.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from math import pi
from typing import Any

import numpy as np

from optics.base.runtime import UserError
from optics.exchange.mitsuba.cameras import screen_rectangle, square_pixels, watching_camera
from optics.exchange.mitsuba.emitters import emitters
from optics.exchange.mitsuba.loading import MONO, current_mitsuba
from optics.exchange.mitsuba.mesh import FACES, LensMesh
from optics.scene.problem import LensSpec, MirrorElement
from optics.scene.receivers import Plane, Screen
from optics.scene.system import OpticalSystem, pose_of
from thbcad.checks import Floats
from thbcad.lens import Lens

REFLECTANCE = 2.0**-7  # of the screen
VERTICES = (449, 449)
BLACK = {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.0}}  # on both sides
DEPTH = 16  # most vertices of a light path


def mitsuba_scene(system: OpticalSystem, mesh: LensMesh) -> Any:
    """Return the Mitsuba scene, mi.Scene, of a problem and its lens; lengths in mm, fluxes in W.

    `mesh.update` moves the lens.

    Raises UserError : as `scene_dictionary`.
    """
    return current_mitsuba().load_dict(scene_dictionary(system, mesh))


def scene_dictionary(
    system: OpticalSystem,
    lens: Lens | LensMesh,
    screen: Screen | None = None,
    sigma: float = 0.0,
    brighter: float = 1.0,
) -> dict[str, Any]:
    """Return a problem and its lens as a dictionary for mi.load_dict; lengths in mm, fluxes in W.

    Its objects are "source", "front", "rear", "edges", "screen", "sensor" and "integrator" (a particle
    tracer); of several sources "source_1", "source_2"; of elements "L1_front" and so on.  The camera sees the
    irradiance E as pi L / REFLECTANCE, mirrored in x: see `camera_irradiance`.

    lens : or its mesh; a lens has one of VERTICES in each direction.
    screen : and its pixels, those of the target where it is left out.
    sigma : pixels, of the Gaussian in which the camera's film measures; 0 is a film of box pixels.
    brighter : factor of the source's flux.

    Raises UserError : a target that is no plane, pixels that are not square, a point source of another
        intensity than a uniform one, stops, a clear aperture or coatings.
    """
    require_open(system)
    _require_bare(system)
    receiver = system.target.receiver
    if receiver.far_field:
        raise UserError("Mitsuba's screen is a plane: target.distance must be finite, got inf")
    if not isinstance(receiver, Plane):
        raise UserError('Mitsuba\'s screen is a plane: target.surface must be "plane"')
    screen, mi = screen or system.target.screen(), current_mitsuba()
    square_pixels(screen)
    meshes = body_meshes(system, lens)
    surfaces = face_surfaces(system, meshes)
    shapes: dict[str, Any] = {}
    for mesh, face in product(meshes, FACES):
        shapes |= mesh.shapes(mi, [face], mi.load_dict(surfaces[mesh.named(face)]))
    points = np.concatenate([mesh.points for mesh in meshes], axis=1)
    lowest = 0.0 if system.problem.element else float(meshes[0].surfaces["front"].jet()[0].min())
    return {
        "type": "scene",
        "integrator": {"type": "ptracer", "max_depth": DEPTH},
        **emitters(mi, system.source, lowest, brighter),
        **shapes,
        "screen": screen_rectangle(mi, screen, receiver.pose, REFLECTANCE),
        "sensor": watching_camera(mi, screen, receiver.pose, points, sigma),
    }


def body_meshes(system: OpticalSystem, lens: Lens | LensMesh) -> list[LensMesh]:
    """Return the meshes of all elements in the order of the problem, where they lie, with their names.

    lens : of the one that is designed, or its mesh.
    """
    own = lens if isinstance(lens, LensMesh) else LensMesh.uniform(lens, VERTICES)
    if not system.problem.element:
        return [own]
    others = {optic.called: LensMesh.uniform(blank, VERTICES) for optic, blank in system.others}
    return [
        replace(others.get(optic.called, own), pose=pose_of(optic), called=optic.called)
        for optic in system.problem.optics
    ]


def face_surfaces(system: OpticalSystem, meshes: Sequence[LensMesh]) -> dict[str, dict[str, Any]]:
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


def require_open(system: OpticalSystem) -> None:
    """Raise UserError where stops or a clear aperture block light, of which meshes know nothing."""
    if system.stops or any(any(optic.clear_aperture) for optic in system.problem.optics):
        raise UserError(
            "scenes and meshes for Mitsuba hold neither [[stop]] nor lens.clear_aperture; leave them out, or "
            'trace with optimizer.engine = "exact" or "mitsuba-exact"'
        )


def _require_bare(system: OpticalSystem) -> None:
    """Raise UserError where faces are coated or rough: Mitsuba's glass is neither."""
    coated = any(
        isinstance(optic, LensSpec) and optic.coats != (None, None) for optic in system.problem.optics
    )
    if coated or any(system.slope_rms):
        raise UserError(
            "scenes for Mitsuba hold smooth faces, and lenses without coatings: leave slope_rms and the "
            "reflectance of lenses out"
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
