"""The light path of a perturbed system, in the frame of its front, and what becomes of its source there."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from optics.base.runtime import UserError
from optics.scene.paths import LightPath
from optics.scene.sources import RayGrid, Rays, SourceCells
from optics.scene.system import OpticalSystem
from optics.tolerancing.perturbations.height_errors import Floats
from optics.tolerancing.perturbations.perturbation import Perturbation
from thbcad.lens import FreeformSurface, Lens
from thbcad.poses import Pose
from thbcad.sags import Conic
from thbcad.surfaces import THBSurface


@dataclass(frozen=True, eq=False)
class PerturbedParts:
    """The light path of perturbed parts, and the source, both in the frame of the front.

    source : its motion.  size : factor on its width.
    """

    path: LightPath
    source: Pose
    size: float

    @classmethod
    def of(cls, system: OpticalSystem, lens: Lens, p: Perturbation) -> PerturbedParts:
        """Return the parts of a system whose lens, source and target a perturbation changes.

        Raises UserError : no lens or no source is so wrong.
        """
        if p.source_size <= -1:
            raise UserError(f"a source whose size changes by {p.source_size:.0%} has none left")
        back = Pose.at(p.lens_shift, p.lens_tilt).inverse()  # the lens stays, all else moves back
        source = back @ Pose.at(p.source_shift, p.source_tilt, (0.0, 0.0, -system.problem.source.distance))
        front = Pose.at(p.front_shift, p.front_tilt)
        path = system.path(perturbed_lens(system, lens, p))
        target = Pose.at(p.target_shift, p.target_tilt, path.receiver.pose.shift.tolist())
        path = path.onto(path.receiver.moved(back @ target)).with_stops_moved(back)
        path = path.moved(0, front).seen_from(front)
        errors = p.front_error, p.rear_error
        return cls(path.with_height_errors(errors), front.inverse() @ source, 1 + p.source_size)

    @property
    def half_width(self) -> tuple[float, float]:
        """Of the front, mm."""
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
        width = np.array([[self.size], [self.size], [1.0]])
        sized = replace(rays, origin=width * rays.origin) if self.size != 1.0 else rays
        return sized.posed(self.source)

    def _within(self, s: Floats, t: Floats) -> bool:
        """Whether all of a grid of parallel rays meets the front."""
        return all(np.abs(row).max() <= h * (1 + 1e-12) for row, h in zip((s, t), self.half_width))


def perturbed_lens(system: OpticalSystem, lens: Lens, p: Perturbation) -> Lens:
    """Return the lens with other thickness, index, powers and temperature; its front vertex stays.

    It expands uniformly, so that z(x, y) becomes s z(x / s, y / s) with s = 1 + expansion temperature.

    Raises UserError : no lens is so wrong.
    """
    try:
        if not any((p.front_power, p.rear_power, p.thickness, p.index, p.temperature)):
            return lens
        front, rear = _bent(lens.front, p.front_power), _bent(lens.rear, p.rear_power)
        thickness, material = lens.thickness + p.thickness, system.material
        if p.temperature and material is not None:
            factor = 1 + (material.expansion or 0.0) * p.temperature
            front, rear, thickness = _scaled(front, factor), _scaled(rear, factor), factor * thickness
        return Lens(front, rear, thickness, perturbed_index(system, lens.index, p))
    except ValueError as error:
        raise UserError(f"no lens has such an error: {error}") from None


def perturbed_index(system: OpticalSystem, index: float, p: Perturbation) -> float:
    """Return what becomes of an index of the lens, by its error and by the temperature."""
    material = system.material
    by_kelvin = material.dn_dt if material else None
    return index + p.index + (by_kelvin or 0.0) * p.temperature


def _bent(surface: FreeformSurface, power: float) -> FreeformSurface:
    """Return the surface on a base conic of another curvature."""
    if not power:
        return surface
    radius = np.inf if power == -1 else surface.conic.radius / (1 + power)
    conic = Conic(radius, surface.conic.constant)
    return replace(surface, conic=conic)


def _scaled(surface: FreeformSurface, factor: float) -> FreeformSurface:
    """Return the surface made larger in all directions."""
    sag = surface.sag
    if sag is not None:
        sag = THBSurface(sag.space, factor * sag.coefficients)
    (hx, hy), (cx, cy) = surface.half_width, surface.corners
    conic = Conic(factor * surface.conic.radius, surface.conic.constant)
    return FreeformSurface((factor * hx, factor * hy), conic, sag, (factor * cx, factor * cy))
