"""What a problem describes, built once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from optics.system.lens import base_lens, freeforms, lens_product
from optics.system.source import LightSource
from optics.system.target import LightTarget
from optics.system.tracing_skips import Skip, skips

if TYPE_CHECKING:
    from optics.problem import Freeform, Problem
    from thbcad.lens import Lens, Product


@dataclass(frozen=True)
class Wavelength:
    """Light of one wavelength.  nm : in air.  weight : of the source's flux.  index : of the lens."""

    nm: float
    weight: float
    index: float


@dataclass(frozen=True)
class LightPath:
    """Which paths light may take.

    parallel : rays stay parallel to z up to the rear: a collimated source before a plane front.
    spreading : the source is not collimated.  far_field : the light is asked for by direction.
    """

    parallel: bool
    spreading: bool
    far_field: bool

    @property
    def by_edges(self) -> bool:
        """Whether light may reach the target by other ways than through front and rear.

        The non-sequential trace needs a target plane.  Parallel beams are left out: the fate `missed_rear`
        shows where a curved front sends them into the edges.
        """
        return self.spreading and not self.far_field


@dataclass(frozen=True, eq=False)
class OpticalSystem:
    """Lens, sources and targets of a problem.  Every part is built when it is first asked for, and once.

    Sources, wavelengths and targets are tuples; a problem file names one of each today.
    """

    problem: Problem

    @cached_property
    def lens(self) -> Lens:
        """The lens before optimisation: sags of zeros on the level-0 meshes.

        Raises
        ------
        UserError : the prescription makes no lens.
        """
        return base_lens(self.problem)

    @cached_property
    def product(self) -> Product:
        """What the CAD files say about the lens."""
        return lens_product(self.problem)

    @property
    def freeforms(self) -> tuple[Freeform, ...]:
        """The settings of the free surfaces, front first, as `Lens.sags`."""
        return freeforms(self.problem)

    @property
    def shaped(self) -> str:
        """The surface that a transport map shapes, "rear" or "front": the last one that is free."""
        return [*self.problem.lens.free][-1]

    @property
    def shapes_parallel(self) -> bool:
        """Whether parallel light meets the surface that a transport map shapes."""
        return self.path.parallel or (self.shaped == "front" and self.source.collimated)

    @property
    def slope_rms(self) -> tuple[float, float]:
        """Of front and rear, radians."""
        return self.problem.lens.front.slope_rms, self.problem.lens.rear.slope_rms

    def sharp(self) -> OpticalSystem:
        """Return the system without the divergence of its beam and without roughness."""
        changes: dict[str, object] = {"lens.front.slope_rms": 0.0, "lens.rear.slope_rms": 0.0}
        if self.source.diverging:
            changes |= {"source.divergence": 0.0, "source.divergence_profile": "uniform"}
        return OpticalSystem(self.problem.with_(**changes))

    @cached_property
    def sources(self) -> tuple[LightSource, ...]:
        return (LightSource(self.problem.source, self.problem.lens.front.half_width),)

    @cached_property
    def wavelengths(self) -> tuple[Wavelength, ...]:
        return (Wavelength(self.problem.source.wavelength, 1.0, self.problem.lens.index),)

    @cached_property
    def targets(self) -> tuple[LightTarget, ...]:
        return (LightTarget(self.problem.target, self.problem.target_z),)

    @property
    def source(self) -> LightSource:
        """The source, where there is one."""
        (source,) = self.sources
        return source

    @property
    def target(self) -> LightTarget:
        """The target, where there is one."""
        (target,) = self.targets
        return target

    @cached_property
    def path(self) -> LightPath:
        collimated = all(source.collimated for source in self.sources)
        far_field = any(target.far_field for target in self.targets)
        return LightPath(collimated and self.lens.front.is_plane, not collimated, far_field)

    @cached_property
    def skips(self) -> tuple[Skip, ...]:
        """What tracing leaves out."""
        return tuple(skips(self.problem, self.path.parallel))
