"""The light path of a perturbed system, and what becomes of its source there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from optics.base.runtime import UserError
from optics.scene.materials import Material
from optics.scene.paths import HeightError, LightPath, Medium
from optics.scene.problem import FaceMet, Optic
from optics.scene.sources import RayGrid, Rays, SourceCells
from optics.scene.system import System, indexing_material, pose_of
from optics.tolerancing.perturbations.perturbation import ElementErrors, Perturbation
from thbcad.checks import Floats
from thbcad.lens import FreeformSurface, Lens
from thbcad.poses import IDENTITY, Pose
from thbcad.sags import Conic
from thbcad.surfaces import THBSurface


@dataclass(frozen=True, eq=False)
class PerturbedParts:
    """The light path of perturbed parts, and the source, both in one frame.

    Of a lens on the axis it is that of its front, which meets light as designed: all else moves back.  A row
    of elements is in the frame of the scene.

    source : its motion.  size : factor on its width.  own : from the source's frame to that of the scene.
    """

    path: LightPath
    source: Pose
    size: float
    own: Pose

    @classmethod
    def of(cls, system: System, p: Perturbation, shaded: bool = False) -> PerturbedParts:
        """Return the parts of a system whose elements, source and target a perturbation changes.

        shaded : among the bodies of all elements and the screen.

        Raises UserError : no lens or no source is so wrong.
        """
        if p.source_size <= -1:
            raise UserError(f"a source whose size changes by {p.source_size:.0%} has none left")
        on_axis = system.lens_on_axis
        back = Pose.at(p.lens_shift, p.lens_tilt).inverse() if on_axis else IDENTITY
        source = back @ Pose.at(p.source_shift, p.source_tilt, system.source.middle)
        made = system.with_shapes({o.called: _made(system, o, lens, p) for o, lens in system.elements})
        path = made.shaded_path if shaded else made.path
        own, faces = path.receiver.pose, system.problem.faces_met
        target = Pose.at(own.directions(p.target_shift), own.directions(p.target_tilt), own.shift)
        errors = [p.of(face.optic, system.problem.optic) for face in faces]
        motions = [_motion(face, e, on_axis) for face, e in zip(faces, errors)]
        frame = motions[0] if on_axis else IDENTITY
        path = path.moved([*motions, back @ target]).with_stops_moved(back).seen_from(frame)
        path = path.with_height_errors([_height_error(face, e) for face, e in zip(faces, errors)])
        return cls(path, frame.inverse() @ source, 1 + p.source_size, system.source.frame)

    @property
    def half_width(self) -> tuple[float, float]:
        """Of the surface that light meets first, mm."""
        return self.path.surfaces[0].shape.half_width

    def cells(self, cells: SourceCells) -> SourceCells:
        """Return moved cells.  Parallel ones stay a grid where they only shift, within the front."""
        source, size = self.source, self.size
        if source.is_identity and size == 1.0:
            return cells if self._within(cells.s, cells.t) else replace(cells, parallel=False)
        if cells.parallel and not source.rotates:
            dx, dy = source.shift[:2]
            s, t = size * cells.s + dx, size * cells.t + dy

            def density(x: Floats, y: Floats) -> Floats:
                return cells.density((x - dx) / size, (y - dy) / size)

            return replace(cells, s=s, t=t, density=density, parallel=self._within(s, t))

        def at(s: Floats, t: Floats, flux: Floats) -> Rays:
            return self.rays(cells.at(s, t, flux))

        return replace(cells, at=at, parallel=False)

    def rays(self, rays: Rays | RayGrid) -> Rays:
        """Return moved rays."""
        assert isinstance(rays, Rays)
        if self.size != 1.0:
            width = np.array([[self.size], [self.size], [1.0]])
            origin = self.own.points(width * self.own.inverse().points(rays.origin))
            rays = replace(rays, origin=np.asarray(origin))
        return rays.posed(self.source)

    def _within(self, s: Floats, t: Floats) -> bool:
        """Whether all of a grid of parallel rays meets the front."""
        return all(np.abs(row).max() <= h * (1 + 1e-12) for row, h in zip((s, t), self.half_width))


def perturbed_media(system: System, media: Sequence[Medium], p: Perturbation) -> list[Medium]:
    """Return media of the path, those of lenses with indices that err."""

    def erring(face: FaceMet, medium: Medium) -> Medium:
        e, material = p.of(face.optic, system.problem.optic), indexing_material(system.problem, face.optic)
        return replace(medium, index=_perturbed_index(medium.index, e, material))

    pairs = zip(system.problem.faces_met, media[1:])
    return [media[0], *(erring(*pair) if pair[0].into_glass else pair[1] for pair in pairs)]


def perturbed_lens(lens: Lens, p: ElementErrors, material: Material | None) -> Lens:
    """Return the lens with other thickness, index, powers and temperature; its front vertex stays.

    It expands uniformly, so that z(x, y) becomes s z(x / s, y / s) with s = 1 + expansion temperature.

    material : None has no known expansion, and no dn/dT.

    Raises UserError : no lens is so wrong.
    """
    try:
        if not any((p.front_power, p.rear_power, p.thickness, p.index, p.temperature)):
            return lens
        front, rear = _bent(lens.front, p.front_power), _bent(lens.rear, p.rear_power)
        thickness = lens.thickness + p.thickness
        if p.temperature and material is not None:
            factor = 1 + (material.expansion or 0.0) * p.temperature
            front, rear, thickness = _scaled(front, factor), _scaled(rear, factor), factor * thickness
        return Lens(front, rear, thickness, _perturbed_index(lens.index, p, material))
    except ValueError as error:
        raise UserError(f"no lens has such an error: {error}") from None


def _made(system: System, optic: Optic, lens: Lens, p: Perturbation) -> Lens:
    """Return what becomes of an element's lens or blank."""
    material = indexing_material(system.problem, optic)
    return perturbed_lens(lens, p.of(optic, system.problem.optic), material)


def _motion(face: FaceMet, e: ElementErrors, stays: bool) -> Pose:
    """Return the motion of a face in the frame of the scene.  stays : its lens, and all else moves."""
    motion = IDENTITY if stays else Pose.at(e.lens_shift, e.lens_tilt)
    if face.face == "front":
        motion = motion @ Pose.at(e.front_shift, e.front_tilt)
    own = pose_of(face.optic)
    return motion if motion.is_identity else own @ motion @ own.inverse()


def _height_error(face: FaceMet, e: ElementErrors) -> HeightError | None:
    """Return the error of a face's heights as light meets it, going to +z."""
    error = e.front_error if face.face == "front" else e.rear_error
    return FromBehind(error) if error is not None and face.backwards else error


@dataclass(frozen=True)
class FromBehind:
    """An error of height as seen from +z, turned about x: -dh(x, -y)."""

    error: HeightError

    def jet(self, x: Floats, y: Floats) -> Floats:
        """Return dh and its derivatives, see `HeightError`."""
        return self.error.jet(x, -y) * [[-1.0], [-1.0], [1.0]]


def _perturbed_index(index: float, p: ElementErrors, material: Material | None) -> float:
    """Return what becomes of an index, by its error and by the temperature."""
    by_kelvin = material.dn_dt if material else None
    return index + p.index + (by_kelvin or 0.0) * p.temperature


def _bent(surface: FreeformSurface, power: float) -> FreeformSurface:
    """Return the surface on a base conic of another curvature."""
    if not power:
        return surface
    radius = np.inf if power == -1 else surface.conic.radius / (1 + power)
    return replace(surface, conic=Conic(radius, surface.conic.constant))


def _scaled(surface: FreeformSurface, factor: float) -> FreeformSurface:
    """Return the surface made larger in all directions."""
    sag = surface.sag
    if sag is not None:
        sag = THBSurface(sag.space, factor * sag.coefficients)
    (hx, hy), (cx, cy) = surface.half_width, surface.corners
    conic = Conic(factor * surface.conic.radius, surface.conic.constant)
    return FreeformSurface((factor * hx, factor * hy), conic, sag, (factor * cx, factor * cy))
